//! Values that depend on each other, and work whose order does not matter.

use super::*;

/// Triangles here and there, each of one colour, of both faces.
fn triangles(random: &mut Random, count: usize) -> Vec<Corner> {
    let triangle = |_| {
        let color = [(); 4].map(|()| random.below(5) as f32 / 4.0);
        let w = 0.5 + random.unit();
        let size = [0.1, 0.5, 3.0][random.below(3)];
        let middle = [random.signed(), random.signed()];
        // Equal depths too.
        let flat = (random.below(3) == 0).then(|| random.below(4) as f32 / 4.0);
        [(); 3].map(|()| {
            let [x, y] = middle.map(|at| (at + random.signed() * size) * w);
            [[x, y, flat.unwrap_or(random.unit()) * w, w], color]
        })
    };
    (0..count).flat_map(triangle).collect()
}

fn face(random: &mut Random, writes: bool) -> StencilFace {
    let mask = |random: &mut Random| [0xff, 0xff, 0x0f, 0xf0, 0][random.below(5)];
    let face = StencilFace::new(Compare::ALL[1 + random.below(7)]).compare_mask(mask(random));
    let op = |random: &mut Random| {
        if writes { StencilOp::ALL[random.below(8)] } else { StencilOp::Keep }
    };
    let face = face.write_mask(mask(random)).fail(op(random)).depth_fail(op(random));
    face.pass(op(random))
}

/// A face whose values replace each other.
fn marking(random: &mut Random, mask: u8) -> StencilFace {
    let compare = [Compare::Always, Compare::LessOrEqual, Compare::NotEqual][random.below(3)];
    let op = [StencilOp::Replace, StencilOp::Zero][random.below(2)];
    StencilFace::new(compare).compare_mask(!mask).write_mask(mask).pass(op)
}

/// A pass of several pipelines whose stencil tests depend on each other.
fn random_pass(seed: u64, fragments: &[Pipeline]) -> Pass {
    let mut random = Random::new(seed);
    let random = &mut random;
    let mask = [0xff, 0x0f, 0x3c][random.below(3)];
    let pipelines: Vec<_> = (0..1 + random.below(4))
        .map(|_| {
            let state = match random.below(4) {
                0 => None,
                1 => Some(StencilState::new(marking(random, mask)).back(marking(random, mask))),
                2 => Some(StencilState::new(face(random, false)).back(face(random, false))),
                _ => Some(StencilState::new(face(random, true)).back(face(random, true))),
            };
            let depth = match random.below(3) {
                0 => DepthState::OFF,
                _ => DepthState::new(Compare::ALL[1 + random.below(7)]).write(random.below(4) > 0),
            };
            let color = random.below(5) > 0;
            let pipeline = fragments[random.below(fragments.len())].clone();
            let pipeline = pipeline.stencil(state).depth(depth);
            let pipeline = pipeline.cull([Cull::None, Cull::Front, Cull::Back][random.below(3)]);
            match color {
                true => pipeline.blend((random.below(4) == 0).then_some(Blend::ALPHA)),
                false => {
                    pipeline.colors([tilewright::state::ColorState::default().write([false; 4])])
                }
            }
        })
        .collect();
    let draws: Vec<_> = (0..3 + random.below(5))
        .map(|_| {
            let count = 1 + random.below(12);
            let corners = triangles(random, count);
            let reference = [(); 2].map(|()| [0, 1, 0x18, 0xff, 0x3c][random.below(5)]);
            draw(random.below(pipelines.len()), &corners).stencil_reference(reference)
        })
        .collect();
    let extent = Extent::new(20 + random.below(40) as u32, 20 + random.below(40) as u32);
    let format = [Format::D32Float, Format::X8D24Unorm][random.below(2)];
    let depth = DepthTarget::cleared([1.0, 0.5][random.below(2)]).format(format);
    let mut stencil = StencilTarget::cleared([0, 1, 0x1f][random.below(3)]);
    if random.below(2) == 0 {
        let mut values = Picture::zeroed(extent, Format::S8Uint);
        values.bytes.fill_with(|| [0, 1, 0x18, 0xff][random.below(4)]);
        stencil.load = LoadOp::Picture(Arc::new(values));
    }
    let pass = Pass::new(&format!("seed {seed}"), extent)
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .stencil(stencil)
        .pipelines(pipelines)
        .draws(draws);
    match random.below(5) {
        0 => pass,
        _ => pass.depth(depth),
    }
}

/// A shader that discards where it would change values, and one that tests before it does.
fn fragments() -> [Pipeline; 3] {
    let discarding = "#version 450
        layout(location = 0) in vec4 color;
        layout(location = 0) out vec4 written;
        void main() { if ((int(gl_FragCoord.x) & 3) == 1) discard; written = color; }";
    let early = discarding.replace("void main", "layout(early_fragment_tests) in; void main");
    [pipeline(FRAGMENT), pipeline(discarding), pipeline(&early)]
}

/// Colours, depths and stencil values of random passes are those of the device's own pipeline.
#[test]
fn passes_are_those_of_the_device() {
    let gpu = gpu();
    let (mut compute, mut classic) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    let fragments = fragments();
    let (mut kinds, mut changed) = ([0; 2], 0);
    for seed in 13_000..13_300 {
        let pass = random_pass(seed, &fragments);
        let [ours, theirs] = [compute.render(&pass), classic.render(&pass)].map(Result::unwrap);
        assert_eq!(ours.stencil, theirs.stencil, "seed {seed}");
        // The planes of depths are rounded differently, and those of slivers are steep.
        let depths = |frame: &Frame| frame.depth.as_ref().map(Picture::depths);
        let both = depths(&ours).into_iter().zip(depths(&theirs));
        let mut both = both.flat_map(|(ours, theirs)| ours.into_iter().zip(theirs));
        assert!(both.all(|(a, b)| (a - b).abs() < 1e-5), "seed {seed}");
        let near = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
        let mut colors = ours.colors[0].bytes.iter().zip(&theirs.colors[0].bytes);
        assert!(colors.all(near), "seed {seed}");
        let begun = pass.stencil.unwrap();
        kinds[usize::from(matches!(begun.load, LoadOp::Picture(_)))] += 1;
        let values = ours.stencil.unwrap().bytes;
        changed += usize::from(match &begun.load {
            LoadOp::Picture(picture) => picture.bytes != values,
            load => values.iter().any(|value| Some(*value) != load.clear_value()),
        });
    }
    assert!(kinds.iter().all(|kind| *kind > 50) && changed > 120, "{kinds:?} {changed}");
}

/// Opaque work draws as ordered work does: the stencil test is for both.
#[test]
fn opaque_work_is_as_if_it_were_ordered() {
    on_each_gpu("opaque work with a stencil test is as if it were ordered", |gpu| {
        let mut compute = compute(gpu);
        let plain = [pipeline(FRAGMENT)];
        for (seed, samples) in (13_500..13_508)
            .flat_map(|seed| [Samples::One, Samples::Four].map(|samples| (seed, samples)))
        {
            let mut random = Random::new(seed ^ 0x6f72_6465);
            let mut pass = random_pass(seed, &plain).samples(samples);
            let (compare, clear) =
                [(Compare::Less, 1.0), (Compare::LessOrEqual, 1.0), (Compare::GreaterOrEqual, 0.0)]
                    [random.below(3)];
            pass.depth = Some(DepthTarget::cleared(clear));
            let frames = [false, true].map(|ordered| {
                for pipeline in &mut pass.pipelines {
                    let made = Pipeline::clone(pipeline).alpha_to_one(ordered).blend(None);
                    *pipeline = Arc::new(made.depth(DepthState::new(compare)));
                }
                compute.render(&pass).unwrap()
            });
            assert_eq!(frames[0].stencil, frames[1].stencil, "seed {seed}, {samples:?}");
            assert_eq!(frames[0].depth, frames[1].depth, "seed {seed}, {samples:?}");
            let colors = |frame: &Frame| {
                // One of them has alpha 1 where it drew.
                let texels = frame.colors[0].bytes.chunks_exact(4).map(|t| [t[0], t[1], t[2]]);
                texels.collect::<Vec<_>>()
            };
            assert!(colors(&frames[0]) == colors(&frames[1]), "seed {seed}, {samples:?}");
        }
    });
}

/// Of several samples, the device resolves sample 0 alone.
#[test]
fn sample_zero_has_its_value() {
    let gpu = gpu();
    let (mut compute, mut classic) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    let fragments = fragments();
    for seed in 13_600..13_660 {
        let mut pass = random_pass(seed, &fragments).samples(Samples::Four);
        // The device loads no target of several samples.
        let stencil = StencilTarget::cleared(Random::new(seed).below(256) as u8);
        pass.stencil = Some(stencil);
        // Planes end at the sides of the target, where lavapipe and clipping part: see `samples`.
        pass.extent = Extent::new(32, 32);
        let [ours, theirs] = [compute.render(&pass), classic.render(&pass)].map(Result::unwrap);
        let (ours, theirs) = (ours.stencil.unwrap().bytes, theirs.stencil.unwrap().bytes);
        let different = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "seed {seed}");
    }
}
