//! What fragment shaders see of samples, and what they say about them.

use super::*;

/// The value of every pixel under a triangle, which all pixels share.
fn of_all(compute: &mut compute::Renderer, samples: Samples, pipeline: Pipeline) -> [f32; 4] {
    let pass = pass(samples, Format::Rgba32Float)
        .depth(DepthTarget::cleared(1.0))
        .pipelines([pipeline])
        .draws([over_all(0, (0.5, [0.25, 0.5, 0.75, 1.0]))]);
    let frame = compute.render(&pass).unwrap();
    let all = values(&frame);
    assert!(all.iter().all(|value| *value == all[0]), "{samples:?}: {:?}", &all[..4]);
    all[0]
}

/// Opaque work, and the same as ordered work.
fn both_ways(fragment: &str) -> [Pipeline; 2] {
    let opaque = pipeline(fragment).depth(DepthState::LESS);
    let ordered = opaque.clone().depth(DepthState::new(Compare::Always)).blend(Blend::ADD);
    [opaque, ordered]
}

#[test]
fn a_shader_runs_for_each_sample_that_asks_for_its_number_or_place() {
    on_each_gpu("a shader runs for each sample that asks for its number or place", |gpu| {
        let mut compute = compute(gpu);
        for samples in [Samples::One, Samples::Two, Samples::Eight] {
            let count = samples.count() as f32;
            let numbers = "#version 450
                layout(location = 0) out vec4 written;
                void main() {
                    vec2 here = fract(gl_FragCoord.xy) - gl_SamplePosition;
                    written = vec4(gl_SampleID, gl_SamplePosition, dot(here, here));
                }";
            let mean = |axis: usize| {
                let all = samples.positions().iter().map(|place| f32::from(place[axis]) / 16.0);
                all.sum::<f32>() / count
            };
            for pipeline in both_ways(numbers) {
                let found = of_all(&mut compute, samples, pipeline);
                let expected = [(count - 1.0) / 2.0, mean(0), mean(1), 0.0];
                let far = found.iter().zip(expected).any(|(a, b)| (a - b).abs() > 1e-5);
                assert!(!far, "{samples:?}: {found:?}, not {expected:?}");
            }
        }
    });
}

/// A counter counts how often shaders run.
#[test]
fn a_shader_runs_once_for_a_pixel_unless_it_asks_for_more() {
    on_each_gpu("a shader runs once for a pixel unless it asks for more", |gpu| {
        let mut compute = compute(gpu);
        let counts = "#version 450
            layout(location = 0) out vec4 written;
            layout(set = 0, binding = 0) buffer Count { uint count; };
            void main() { atomicAdd(count, 1u); written = vec4(1.0); }";
        for (samples, shading) in
            [(Samples::Four, false), (Samples::Four, true), (Samples::Eight, true)]
        {
            let zero = [0u32];
            let count = tilewright::Buffer::with_content(gpu, "count", &zero).unwrap();
            let set = tilewright::BindingSet::new([(
                0,
                tilewright::Binding::Storage(BufferRange::on_device(&count)),
            )]);
            let pass = pass(samples, Format::Rgba8Unorm)
                .pipelines([pipeline(counts).depth(DepthState::OFF).sample_shading(shading)])
                .draws([over_all(0, (0.5, [1.0; 4])).sets([Arc::new(set)])]);
            compute.render(&pass).unwrap();
            let of_pixel = if shading { samples.count() } else { 1 };
            let found = count.download().unwrap()[0];
            assert_eq!(found, SIDE * SIDE * of_pixel, "{samples:?} {shading}");
        }
    });
}

#[test]
fn masks_say_which_samples_are_covered_and_kept() {
    on_each_gpu("masks say which samples are covered and kept", |gpu| {
        let mut compute = compute(gpu);
        let covered = "#version 450
            layout(location = 0) out vec4 written;
            void main() { written = vec4(gl_SampleMaskIn[0]); }";
        let kept = "#version 450
            layout(location = 0) out vec4 written;
            void main() { written = vec4(1.0); gl_SampleMask[0] = 0x5555; }";
        for samples in [Samples::Four, Samples::Sixteen] {
            for pipeline in both_ways(covered) {
                let found = of_all(&mut compute, samples, pipeline);
                assert_eq!(found[0], samples.mask() as f32, "{samples:?}");
            }
            for pipeline in both_ways(kept) {
                assert_eq!(of_all(&mut compute, samples, pipeline), [0.5; 4], "{samples:?}");
            }
        }
        let masked = pipeline(FRAGMENT).depth(DepthState::LESS).sample_mask(0b0110);
        let found = of_all(&mut compute, Samples::Four, masked);
        assert_eq!(found, [0.125, 0.25, 0.375, 0.5]);
        let nothing = pipeline(FRAGMENT).depth(DepthState::LESS).sample_mask(0b10);
        assert_eq!(of_all(&mut compute, Samples::One, nothing), [0.0; 4]);
    });
}

#[test]
fn alpha_covers_samples() {
    on_each_gpu("alpha covers samples", |gpu| {
        let mut compute = compute(gpu);
        let fragment = "#version 450
            layout(location = 0) in vec4 color;
            layout(location = 0) out vec4 written;
            void main() { written = vec4(1.0, 1.0, 1.0, color.a); }";
        for samples in [Samples::Two, Samples::Four] {
            let count = samples.count();
            for (n, one) in (0..=count).flat_map(|n| [(n, false), (n, true)]) {
                let alpha = n as f32 / count as f32;
                let pipeline = pipeline(fragment)
                    .depth(DepthState::LESS)
                    .alpha_to_coverage(true)
                    .alpha_to_one(one);
                let pass = pass(samples, Format::Rgba32Float)
                    .depth(DepthTarget::cleared(1.0))
                    .pipelines([pipeline])
                    .draws([over_all(0, (0.5, [0.0, 0.0, 0.0, alpha]))]);
                let opacity = if one { 1.0 } else { alpha };
                let expected = [alpha, alpha, alpha, alpha * opacity];
                for found in values(&compute.render(&pass).unwrap()) {
                    assert_eq!(found, expected, "{samples:?} {one}");
                }
            }
        }
    });
}

/// Inputs at the centre leave the triangle where it does not cover the centre; at a centroid or at a sample they do not.
#[test]
fn centroid_and_sample_inputs_stay_inside_of_the_triangle() {
    on_each_gpu("centroid and sample inputs stay inside of the triangle", |gpu| {
        let mut compute = compute(gpu);
        for (qualifier, stays) in
            [("", false), ("centroid", true), ("sample", true), ("noperspective centroid", true)]
        {
            let vertex = VERTEX.replace("out vec4 color", &format!("{qualifier} out vec4 color"));
            let fragment = format!(
                "#version 450
                layout(location = 0) {qualifier} in vec4 color;
                layout(location = 0) out vec4 written;
                void main() {{ written = vec4(color.x < 0.0 ? 1.0 : 0.0, 0.0, 0.0, 1.0); }}"
            );
            let vertex = Shader::from_glsl(Stage::Vertex, "varying", &vertex).unwrap();
            for mut pipeline in both_ways(&fragment) {
                pipeline.vertex = Arc::new(vertex.clone());
                // The first component is the distance from the long side.
                let mut random = Random::new(11_700);
                let corners: Vec<Corner> = (0..20)
                    .flat_map(|_| {
                        let mut at = || [random.signed(), random.signed(), 0.5, 1.0];
                        [[at(), [0.0; 4]], [at(), [0.0; 4]], [at(), [1.0; 4]]]
                    })
                    .collect();
                let pass = pass(Samples::Four, Format::Rgba32Float)
                    .depth(DepthTarget::cleared(1.0))
                    .pipelines([pipeline])
                    .draws([draw(0, &corners)]);
                let outside = values(&compute.render(&pass).unwrap());
                let outside = outside.iter().filter(|value| value[0] > 0.0).count();
                match stays {
                    true => assert_eq!(outside, 0, "`{qualifier}`"),
                    false => assert!(outside > 20, "{outside} pixels test nothing"),
                }
            }
        }
    });
}

/// Shaders that run for each sample see what the device's own pipeline shows them.
#[test]
fn shaders_of_samples_draw_as_on_the_device() {
    let gpu = gpu();
    let (mut ours, mut theirs) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    for (n, body) in [
        "written = vec4(gl_SampleID / 3.0, gl_SamplePosition, 1.0);",
        "written = vec4(fract(gl_FragCoord.xy), gl_FragCoord.z, 1.0);",
        "written = color;",
        "written = vec4(color.rgb, 1.0); gl_SampleMask[0] = gl_SampleID == 2 ? 0 : 15;",
    ]
    .into_iter()
    .enumerate()
    {
        let fragment = format!(
            "#version 450
            layout(location = 0) sample in vec4 color;
            layout(location = 0) out vec4 written;
            void main() {{ {body} }}"
        );
        let vertex = VERTEX.replace("out vec4 color", "sample out vec4 color");
        let vertex = Arc::new(Shader::from_glsl(Stage::Vertex, "varying", &vertex).unwrap());
        for seed in 11_800..11_808 {
            let mut random = Random::new(seed);
            let corners = triangles(&mut random, 20);
            let mut pipeline = pipeline(&fragment).depth(DepthState::OFF);
            pipeline.vertex = vertex.clone();
            let pass = pass(Samples::Four, Format::Rgba32Float)
                .pipelines([pipeline])
                .draws([draw(0, &corners)]);
            let frames = [ours.render(&pass).unwrap(), theirs.render(&pass).unwrap()];
            let found = difference(&frames[0].colors[0], &frames[1].colors[0], 2e-4);
            assert_eq!(found, None, "shader {n}, seed {seed}");
        }
    }
}

/// What alpha leaves out does not hide what comes later.
#[test]
fn samples_that_alpha_leaves_out_keep_their_depth() {
    on_each_gpu("samples that alpha leaves out keep their depth", |gpu| {
        let mut compute = compute(gpu);
        for samples in [Samples::One, Samples::Four] {
            for (alpha, covered) in
                [(0.0, 0.0), (0.5, if samples == Samples::One { 1.0 } else { 0.5 })]
            {
                let far = pipeline(FRAGMENT).depth(DepthState::LESS);
                let near = far.clone().alpha_to_coverage(true);
                let pass = pass(samples, Format::Rgba32Float)
                    .depth(DepthTarget::cleared(1.0))
                    .pipelines([near, far])
                    .draws([
                        over_all(0, (0.25, [1.0, 0.0, 0.0, alpha])),
                        over_all(1, (0.75, [0.0, 1.0, 0.0, 1.0])),
                    ]);
                let frame = compute.render(&pass).unwrap();
                for [red, green, ..] in values(&frame) {
                    assert_eq!([red, green], [covered, 1.0 - covered], "{samples:?} {alpha}");
                }
            }
        }
    });
}

/// Samples that something nearer hides count as covered.
#[test]
fn coverage_does_not_depend_on_depth() {
    on_each_gpu("coverage does not depend on depth", |gpu| {
        let mut compute = compute(gpu);
        let black = pipeline(FRAGMENT).depth(DepthState::LESS);
        let covered = pipeline(
            "#version 450
            layout(location = 0) out vec4 written;
            void main() { written = vec4(gl_SampleMaskIn[0]); }",
        );
        let mut random = Random::new(11_900);
        let mut corners = triangles(&mut random, 10);
        for corner in &mut corners {
            corner[0][2] = 0.25 * corner[0][3];
            corner[1] = [0.0; 4];
        }
        let pass = pass(Samples::Four, Format::Rgba32Float)
            .depth(DepthTarget::cleared(1.0))
            .pipelines([black, covered.depth(DepthState::LESS)])
            .draws([draw(0, &corners), over_all(1, (0.75, [0.0; 4]))]);
        let mut partly = 0;
        for [value, ..] in values(&compute.render(&pass).unwrap()) {
            let shown = value / 15.0 * 4.0;
            assert_eq!(shown, shown.round(), "{value}");
            partly += u32::from(shown > 0.0 && shown < 4.0);
        }
        assert!(partly > 50, "{partly} pixels are hidden in part");
    });
}

/// All times at which ordered work tests depth, with shaders that discard, write depth, or have tests before them.
#[test]
fn depth_is_tested_for_each_sample_when_it_should_be() {
    let gpu = gpu();
    let (mut ours, mut theirs) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    for (n, (layout, body)) in [
        ("", "if (fract(gl_FragCoord.x / 8.0) < 0.5) discard; written = color;"),
        ("", "gl_FragDepth = fract(gl_PrimitiveID * 0.377 + gl_FragCoord.y / 64.0); written = color;"),
        (
            "layout(early_fragment_tests) in;",
            "if (fract(gl_FragCoord.x / 8.0) < 0.5) discard; written = color;",
        ),
        ("", "written = vec4(color.rgb, dFdx(gl_FragCoord.x)); gl_SampleMask[0] = 0xd;"),
    ]
    .into_iter()
    .enumerate()
    {
        let fragment = format!(
            "#version 450
            {layout}
            layout(location = 0) in vec4 color;
            layout(location = 0) out vec4 written;
            void main() {{ {body} }}"
        );
        let (mut pixels, mut others) = (0, 0);
        for seed in 12_000..12_008 {
            let mut random = Random::new(seed);
            let corners = triangles(&mut random, 30);
            let pass = pass(Samples::Four, Format::Rgba32Float)
                .depth(DepthTarget::cleared(1.0))
                .pipelines([pipeline(&fragment).depth(DepthState::LESS)])
                .draws([draw(0, &corners)]);
            let frames = [ours.render(&pass).unwrap(), theirs.render(&pass).unwrap()];
            let both = values(&frames[0]).into_iter().zip(values(&frames[1]));
            let far = |(a, b): &([f32; 4], [f32; 4])| (0..4).any(|n| (a[n] - b[n]).abs() > 1e-4);
            pixels += (SIDE * SIDE) as usize;
            others += both.filter(far).count();
        }
        // Depths at samples are rounded as each side likes, and surfaces meet.
        assert!(others * 1000 <= pixels, "shader {n}: {others} of {pixels} pixels differ");
    }
}
