//! Several targets, pipelines and batches, with several samples.

use super::*;

/// Each of several targets is what it would be alone: texels of every width, an odd number of pixels, clears of every kind.
#[test]
fn targets_among_others_are_the_same() {
    on_each_gpu("targets of several samples among others are the same", |gpu| {
        let mut compute = compute(gpu);
        let formats =
            [Format::Rgba8Unorm, Format::Rgba32Float, Format::R8Unorm, Format::Rgba16Float];
        let fragment = "#version 450
            layout(location = 0) in vec4 color;
            layout(location = 0) out vec4 a;
            layout(location = 1) out vec4 b;
            layout(location = 2) out vec4 c;
            layout(location = 3) out vec4 d;
            void main() { a = b = c = d = color; }";
        let mut random = Random::new(12_100);
        let corners = triangles(&mut random, 20);
        let clear = [0.125, 0.25, 0.5, 1.0];
        let extent = Extent::new(37, 29);
        let of = |pipeline: Pipeline, formats: &[Format]| {
            let targets = formats.iter().map(|format| ColorTarget::cleared(*format, clear));
            Pass::new("several", extent)
                .samples(Samples::Four)
                .colors(targets.collect::<Vec<_>>())
                .depth(DepthTarget::transient(1.0))
                .pipelines([pipeline.depth(DepthState::LESS)])
                .draws([draw(0, &corners)])
        };
        let mut pass = of(pipeline(fragment), &formats);
        let all = compute.render(&pass).unwrap();
        for (n, format) in formats.iter().enumerate() {
            let alone = compute.render(&of(pipeline(FRAGMENT), &[*format])).unwrap();
            assert_eq!(all.colors[n].bytes, alone.colors[0].bytes, "{format:?}");
        }
        // One is discarded, one begins with what it was.
        pass.colors[1].store = StoreOp::Discard;
        pass.colors[2].load = LoadOp::Picture(Arc::new(all.colors[2].clone()));
        pass.draws.clear();
        let kept = compute.render(&pass).unwrap();
        assert_eq!(kept.colors.len(), 3);
        assert_eq!(kept.colors[1].bytes, all.colors[2].bytes, "what is loaded is stored again");
    });
}

/// What an image holds is the same after a pass that draws nothing, whatever the bits are.
#[test]
fn what_nothing_is_drawn_to_stays() {
    on_each_gpu("what nothing is drawn to stays", |gpu| {
        let mut compute = compute(gpu);
        for format in [Format::Rgba32Float, Format::Rgba8Srgb, Format::Rgba16Float] {
            let mut random = Random::new(12_200);
            let nothing = tilewright::ClearColor::Float([0.0; 4]);
            let mut begun = Picture::filled(Extent::new(SIDE, SIDE), format, nothing);
            for texel in begun.bytes.chunks_exact_mut(4) {
                let float = random.signed() * 3e38;
                let halves = (random.bits() as u32) & 0x77ff_77ff;
                let bits = match format {
                    Format::Rgba32Float => float.to_bits(),
                    Format::Rgba16Float => halves | 0x0400_0400,
                    _ => random.bits() as u32,
                };
                texel.copy_from_slice(&bits.to_ne_bytes());
            }
            for samples in [Samples::Four, Samples::Sixteen] {
                let mut pass = pass(samples, format);
                pass.colors[0].load = LoadOp::Picture(Arc::new(begun.clone()));
                let found = compute.render(&pass).unwrap().colors.remove(0);
                assert_eq!(found.bytes, begun.bytes, "{samples:?} {format:?}");
            }
        }
    });
}

/// Opaque pipelines in one batch, and batches that follow each other, against the same as ordered work.
#[test]
fn pipelines_and_batches_follow_each_other() {
    on_each_gpu("pipelines and batches of several samples follow each other", |gpu| {
        let mut compute = compute(gpu);
        let other = FRAGMENT.replace("written = color", "written = vec4(1.0 - color.rgb, 1.0)");
        let mut random = Random::new(12_300);
        let mut corners = triangles(&mut random, 60);
        for corner in &mut corners {
            corner[1][3] = 1.0;
        }
        let frames = [false, true].map(|ordered| {
            let made =
                |fragment: &str| pipeline(fragment).depth(DepthState::LESS).alpha_to_one(ordered);
            let reversed = made(FRAGMENT).depth(DepthState::new(Compare::LessOrEqual));
            let draws =
                corners.chunks(30).enumerate().map(|(n, some)| draw([0, 1, 0, 2][n % 4], some));
            let pass = pass(Samples::Four, Format::Rgba8Unorm)
                .depth(DepthTarget::cleared(1.0))
                .pipelines([made(FRAGMENT), made(&other), reversed])
                .draws(draws.collect::<Vec<_>>());
            compute.render(&pass).unwrap()
        });
        assert_eq!(frames[0].colors[0].bytes, frames[1].colors[0].bytes);
        assert!(values(&frames[0]).iter().filter(|value| value[3] > 0.0).count() > 1000);
    });
}

#[test]
fn alpha_that_covers_has_to_be_written() {
    let gpu = gpu();
    let blind = pipeline(
        "#version 450
        layout(location = 0) in vec4 color;
        layout(location = 0) out vec3 written;
        void main() { written = color.rgb; }",
    );
    let draws = [over_all(0, (0.5, [1.0; 4]))];
    let pass = pass(Samples::Four, Format::Rgba8Unorm).draws(draws);
    let mut compute = compute(&gpu);
    compute.render(&pass.clone().pipelines([blind.clone()])).unwrap();
    let fault = compute.render(&pass.pipelines([blind.alpha_to_coverage(true)])).unwrap_err();
    assert!(matches!(&fault, Error::Usage(text) if text.contains("writes none")), "{fault}");
}

/// A `sample` in an array of blocks makes the shader run for each sample, as any other does.
#[test]
fn samples_in_blocks_are_seen() {
    let shader = |qualifier: &str| {
        let text = format!(
            "#version 450
            layout(location = 0) in Block {{ {qualifier} vec4 color; }} blocks[2];
            layout(location = 0) out vec4 written;
            void main() {{ written = blocks[0].color + blocks[1].color; }}"
        );
        Shader::from_glsl(Stage::Fragment, "blocks", &text).unwrap()
    };
    assert!(shader("sample").reflection().per_sample);
    assert!(!shader("centroid").reflection().per_sample);
}
