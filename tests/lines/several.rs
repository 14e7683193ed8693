//! Points and lines with four samples. Bresenham lines are left out: lavapipe draws all samples of what one sample would cover.

use super::*;

/// The pictures of each sample alone.
fn of_samples(
    executors: &mut [Box<dyn Executor>; 2],
    pipeline: &Pipeline,
    draw: &Draw,
    label: &str,
) -> [[Frame; 2]; 4] {
    [0, 1, 2, 3].map(|sample| {
        let pass = pass(label)
            .samples(Samples::Four)
            .pipelines([pipeline.clone().sample_mask(1 << sample)])
            .draws([draw.clone()]);
        render(executors, &pass)
    })
}

#[test]
fn each_sample_of_points_is_covered_as_on_the_device() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let mut drawn = 0;
    let pipeline = pipeline(FLAT).topology(Topology::PointList);
    for seed in 17_000..17_040 {
        let mut random = Random::new(seed);
        let mut draw = draw(0, &points::points(&mut random, 30));
        if random.below(2) == 0 {
            draw = draw.viewport(some_viewport(&mut random));
        }
        let what = format!("samples of points, seed {seed}");
        for frames in of_samples(&mut executors, &pipeline, &draw, &what) {
            drawn += assert_same(&frames, 0.0, &what);
        }
    }
    assert!(drawn > 100_000, "{drawn} samples are drawn");
}

/// Lavapipe loses samples of lines at the sides of its tiles of 64x64 pixels, here the target, and of lines within a pixel.
#[test]
fn samples_of_rectangular_lines_are_covered_as_on_the_device() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let (mut drawn, mut others) = (0, 0);
    for seed in 17_100..17_140 {
        let mut random = Random::new(seed);
        let mut corners = lines(&mut random, 40, false);
        for line in corners.chunks_exact_mut(2) {
            // One with a length.
            if line[0].place == line[1].place {
                line[1].place[0] += 0.125;
            }
        }
        let width = WIDTHS[random.below(WIDTHS.len())];
        let pipeline = pipeline(FLAT).topology(Topology::LineList).line_width(width);
        let what = format!("samples of lines of width {width}, seed {seed}");
        for frames in of_samples(&mut executors, &pipeline, &draw(0, &corners), &what) {
            let pictures = frames.each_ref().map(|frame| &frame.colors[0]);
            drawn += pictures[1].values().filter(|value| value[3] > 0.0).count();
            others += different(pictures, 0.0).len();
        }
    }
    assert!(drawn > 20_000, "{drawn} samples are drawn");
    assert!(200 * others < drawn, "{others} of {drawn} samples differ");
}

/// Opaque work and work in order draw the same samples.
#[test]
fn opaque_and_ordered_lines_have_the_same_samples() {
    on_each_gpu("opaque and ordered lines have the same samples", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for (topology, mode) in [
            (Topology::PointList, LineMode::Rectangular),
            (Topology::LineList, LineMode::Rectangular),
            (Topology::LineStrip, LineMode::Bresenham),
        ] {
            let mut random = Random::new(17_300);
            let corners: Vec<_> = match topology {
                Topology::PointList => points::points(&mut random, 60),
                _ => lines(&mut random, 60, false),
            };
            // Alpha is 1 already: that says so, and makes the work ordered.
            let frames = [false, true].map(|ordered| {
                let pipeline = pipeline(FLAT)
                    .topology(topology)
                    .line_mode(mode)
                    .line_width(3.7)
                    .depth(DepthState::LESS)
                    .alpha_to_one(ordered);
                let pass = pass("samples")
                    .samples(Samples::Four)
                    .depth(DepthTarget::cleared(1.0))
                    .pipelines([pipeline])
                    .draws([draw(0, &corners)]);
                compute.render(&pass).unwrap()
            });
            assert!(frames[0].colors == frames[1].colors, "{topology:?} {mode:?}");
            assert!(frames[0].depth == frames[1].depth, "{topology:?} {mode:?}");
            let drawn = frames[0].colors[0].values().filter(|value| value[3] > 0.0).count();
            assert!(drawn > 100, "{topology:?} {mode:?}: {drawn}");
        }
    });
}
