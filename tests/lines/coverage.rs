//! Which pixels lines cover, and in which order.

use super::{points::indices_of, *};

/// Lines one after another: each pixel has the colour of the last one.
fn check(mode: LineMode, seeds: std::ops::Range<u64>, cut: bool) {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let (mut drawn, passes) = (0, seeds.end - seeds.start);
    for seed in seeds {
        let mut random = Random::new(seed);
        let width = WIDTHS[random.below(WIDTHS.len())];
        let strip = !cut && random.below(3) == 0;
        let count = 10 + random.below(50);
        let mut corners = lines(&mut random, count, cut);
        if strip {
            for (number, corner) in corners.iter_mut().enumerate() {
                corner.tint = tint(number);
            }
        }
        let mut draw = draw(0, &corners).instances(1 + random.below(3) as u32);
        // Ends that planes cut, and that are beyond a side, lavapipe rounds in its own way unless sides are powers of two.
        if !cut && random.below(2) == 0 {
            draw = draw.viewport(some_viewport(&mut random));
        }
        if random.below(3) == 0 {
            draw = draw.scissor(some_scissor(&mut random));
        }
        if random.below(3) == 0 {
            let any = |_| match strip {
                true => [(); 2].map(|()| random.below(corners.len()) as u32),
                false => {
                    let line = 2 * random.below(corners.len() / 2) as u32;
                    let turned = random.below(2) as u32;
                    [line + turned, line + 1 - turned]
                }
            };
            // An odd one is left over.
            let mut indices: Vec<u32> = (0..40).flat_map(any).collect();
            indices.push(0);
            draw.count = indices.len() as u32;
            draw = draw.indices(indices_of(&indices));
        }
        let topology = if strip { Topology::LineStrip } else { Topology::LineList };
        let what = format!("{mode:?} {topology:?} of width {width}, seed {seed}");
        let pipeline = pipeline(FLAT).topology(topology).line_width(width).line_mode(mode);
        let pass = pass(&what).pipelines([pipeline]).draws([draw]);
        drawn += assert_same(&render(&mut executors, &pass), 0.0, &what);
    }
    assert!(drawn as u64 > 150 * passes, "{drawn} pixels are drawn");
}

#[test]
fn rectangular_lines_cover_what_the_device_says() {
    check(LineMode::Rectangular, 15_000..15_200, false);
}

#[test]
fn bresenham_lines_cover_what_the_device_says() {
    check(LineMode::Bresenham, 15_200..15_400, false);
}

#[test]
fn rectangular_lines_are_cut_by_planes_as_on_the_device() {
    check(LineMode::Rectangular, 15_400..15_500, true);
}

#[test]
fn bresenham_lines_are_cut_by_planes_as_on_the_device() {
    check(LineMode::Bresenham, 15_500..15_600, true);
}

/// Short lines apart from each other: none hides what another one covers.
#[test]
fn short_lines_cover_what_the_device_says() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let mut drawn = 0;
    for seed in 15_600..15_760 {
        let mut random = Random::new(seed);
        let mode = MODES[random.below(2)];
        let width = [1.0, 1.0, 1.5, 2.0][random.below(4)];
        let mut corners = Vec::new();
        for number in 0..64 {
            let cell = [number % 8, number / 8].map(|cell| 8.0 * cell as f32 + 4.0);
            for _ in 0..2 {
                let at = cell.map(|at| {
                    let reach = [0.6, 3.0][random.below(2)];
                    let at = at + reach * random.signed();
                    rounded(&mut random, at)
                });
                corners.push(Corner { place: clip(at, 0.5, 1.0), tint: tint(number), size: 1.0 });
            }
        }
        let what = format!("short lines, {mode:?} of width {width}, seed {seed}");
        let pipeline =
            pipeline(FLAT).topology(Topology::LineList).line_width(width).line_mode(mode);
        let pass = pass(&what).pipelines([pipeline]).draws([draw(0, &corners)]);
        drawn += assert_same(&render(&mut executors, &pass), 0.0, &what);
    }
    assert!(drawn > 16_000, "{drawn} pixels are drawn");
}

/// Lines and points have no face.
#[test]
fn culling_concerns_triangles_alone() {
    on_each_gpu("culling concerns triangles alone", |gpu| {
        let mut renderers: Vec<Box<dyn Executor>> =
            vec![Box::new(compute::Renderer::new(gpu).unwrap())];
        if gpu.has_graphics() {
            renderers.push(Box::new(classic::Renderer::new(gpu).unwrap()));
        }
        let mut random = Random::new(15_800);
        let corners = lines(&mut random, 40, false);
        for renderer in &mut renderers {
            for topology in [Topology::PointList, Topology::LineList, Topology::LineStrip] {
                let frames = [Cull::None, Cull::Front, Cull::Back].map(|cull| {
                    let pipeline = pipeline(FLAT).topology(topology).cull(cull);
                    let pass = pass("culled").pipelines([pipeline]).draws([draw(0, &corners)]);
                    renderer.render(&pass).unwrap().colors.remove(0)
                });
                let drawn = frames[0].values().filter(|value| value[3] > 0.0).count();
                assert!(drawn > 10, "{topology:?}: {drawn}");
                assert!(frames[1..].iter().all(|frame| *frame == frames[0]), "{topology:?}");
            }
        }
    });
}
