//! Depths and inputs along lines, and what depth test, stencil test and blending make of them.

use super::*;

/// Lines of several pixels with depths, ws and colours of their own at both ends.
fn slanted(random: &mut Random, count: usize) -> Vec<Corner> {
    let mut corners = Vec::new();
    while corners.len() < 2 * count {
        let [a, b] = ends(random);
        let length = (a[0] - b[0]).hypot(a[1] - b[1]);
        // What is cut out of a very long line is as inexact as all of it.
        if !(4.0..200.0).contains(&length) {
            continue;
        }
        for end in [a, b] {
            let place = clip(end, random.unit(), 0.5 + 1.5 * random.unit());
            let tint = [random.unit(), random.unit(), random.unit(), 0.25 + 0.5 * random.unit()];
            corners.push(Corner { place, tint, size: 1.0 });
        }
    }
    corners
}

fn line_pipeline(fragment: &str, random: &mut Random) -> Pipeline {
    pipeline(fragment)
        .topology([Topology::LineList, Topology::LineStrip][random.below(2)])
        .line_width(WIDTHS[random.below(WIDTHS.len())])
        .line_mode(MODES[random.below(2)])
}

fn depths(frames: [Frame; 2]) -> [Vec<f32>; 2] {
    frames.map(|frame| frame.depth.unwrap().depths())
}

/// Each triangle has one depth and one colour.
fn triangles(random: &mut Random, count: usize, depth: impl Fn(usize) -> f32) -> Vec<Corner> {
    let mut corners = Vec::new();
    for number in 0..count {
        let middle = place(random);
        for _ in 0..3 {
            let at = middle.map(|at| at + 30.0 * random.signed());
            let place = clip(at, depth(number), 1.0);
            corners.push(Corner { place, tint: tint(500 + number), size: 1.0 });
        }
    }
    corners
}

#[test]
fn depths_and_colors_along_lines_are_those_of_the_device() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let mut drawn = 0;
    for seed in 16_000..16_100 {
        let mut random = Random::new(seed);
        let pipeline = line_pipeline(SMOOTH, &mut random).depth(DepthState::new(Compare::Always));
        let corners = slanted(&mut random, 24);
        let pass = pass(&format!("along lines, seed {seed}"))
            .depth(DepthTarget::cleared(1.0))
            .pipelines([pipeline])
            .draws([draw(0, &corners)]);
        let frames = render(&mut executors, &pass);
        drawn += assert_same(&frames, 2.0 / 255.0, &pass.label);
        let [ours, theirs] = depths(frames);
        for (pixel, (a, b)) in ours.iter().zip(&theirs).enumerate() {
            assert!((a - b).abs() < 1e-5, "{}, pixel {pixel}: {a} {b}", pass.label);
        }
    }
    assert!(drawn > 20_000, "{drawn} pixels are drawn");
}

/// Each primitive has a depth of its own, so that rounding decides nothing.
#[test]
fn lines_among_triangles_are_hidden_and_hide() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    for seed in 16_200..16_260 {
        let mut random = Random::new(seed);
        let places: Vec<f32> = (0..80).map(|n| (n * 37 % 80) as f32 / 80.0).collect();
        let below = triangles(&mut random, 20, |n| places[n]);
        let above = triangles(&mut random, 10, |n| places[20 + n]);
        let mut corners = lines(&mut random, 40, false);
        for (number, corner) in corners.iter_mut().enumerate() {
            let [x, y, _, w] = corner.place;
            corner.place = [x / w, y / w, places[30 + number / 2], 1.0];
        }
        let line = line_pipeline(FLAT, &mut random).topology(Topology::LineList);
        let pipelines = [pipeline(FLAT), line].map(|it| it.depth(DepthState::LESS));
        let pass = pass(&format!("lines among triangles, seed {seed}"))
            .depth(DepthTarget::cleared(1.0))
            .pipelines(pipelines)
            .draws([draw(0, &below), draw(1, &corners), draw(0, &above)]);
        let frames = render(&mut executors, &pass);
        assert_same(&frames, 0.0, &pass.label);
        let ours = frames[0].colors[0].values();
        let tints: Vec<_> = (0..40).map(tint).collect();
        let seen = ours.filter(|value| tints.contains(value)).count();
        assert!(seen > 20, "{}: {seen} pixels of lines", pass.label);
        let [ours, theirs] = depths(frames);
        let near = ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near, "{}: depths", pass.label);
    }
}

/// Lines that slant go through triangles and through each other: where depths are all but equal, rounding may decide.
#[test]
fn slanted_lines_hide_each_other() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let mut others = 0;
    for seed in 16_300..16_340 {
        let mut random = Random::new(seed);
        let behind = triangles(&mut random, 12, |n| (n + 3) as f32 / 16.0);
        let corners = slanted(&mut random, 60);
        let line = line_pipeline(FLAT, &mut random);
        let pipelines = [pipeline(FLAT), line].map(|it| it.depth(DepthState::LESS));
        let pass = pass(&format!("slanted lines, seed {seed}"))
            .depth(DepthTarget::cleared(1.0))
            .pipelines(pipelines)
            .draws([draw(0, &behind), draw(1, &corners)]);
        let frames = render(&mut executors, &pass);
        let pictures = frames.each_ref().map(|frame| &frame.colors[0]);
        others += different(pictures, 0.0).len();
        let [ours, theirs] = depths(frames);
        let near = ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near, "{}: depths", pass.label);
    }
    assert!(others <= 8, "{others} of {} pixels differ", 40 * SIDE * SIDE);
}

#[test]
fn blended_lines_are_those_of_the_device() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    for seed in 16_400..16_460 {
        let mut random = Random::new(seed);
        let corners = slanted(&mut random, 30);
        let pipeline = line_pipeline(SMOOTH, &mut random).blend(Blend::ALPHA);
        let pass = pass(&format!("blended lines, seed {seed}"))
            .colors([ColorTarget::cleared(Format::Rgba16Float, [0.25, 0.5, 0.75, 1.0])])
            .pipelines([pipeline])
            .draws([draw(0, &corners)]);
        assert_same(&render(&mut executors, &pass), 4e-3, &pass.label);
    }
}

/// Points and lines are front faces.
#[test]
fn stencil_values_count_lines() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    for seed in 16_500..16_560 {
        let mut random = Random::new(seed);
        let counts = StencilFace::new(Compare::Always).pass(StencilOp::IncrementAndWrap);
        let clears = StencilFace::new(Compare::Always).pass(StencilOp::Zero);
        // No line is a back face, and none is culled.
        let keeps = StencilFace::new(Compare::Always);
        let state = StencilState::new(counts).back([clears, keeps][random.below(2)]);
        let cull = [Cull::None, Cull::Front, Cull::Back][random.below(3)];
        let made = |pipeline: Pipeline| pipeline.stencil(state).cull(cull).depth(DepthState::LESS);
        let tested = random.below(2) == 0;
        let corners = lines(&mut random, 60, false);
        let points = points::points(&mut random, 12);
        let line = made(line_pipeline(FLAT, &mut random));
        let point = made(pipeline(FLAT).topology(Topology::PointList));
        let pass = pass(&format!("stencil values of lines, seed {seed}"))
            .stencil(StencilTarget::cleared(0))
            .depth(tested.then(|| DepthTarget::cleared(1.0)))
            .pipelines([line, point])
            .draws([draw(0, &corners), draw(1, &points)]);
        let frames = render(&mut executors, &pass);
        assert_same(&frames, 0.0, &pass.label);
        let [ours, theirs] = frames.map(|frame| frame.stencil.unwrap().bytes);
        assert!(ours.iter().any(|count| *count > 1), "{}", pass.label);
        let others = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
        assert_eq!(others, 0, "{}", pass.label);
    }
}

/// What `gl_FrontFacing` says.
#[test]
fn lines_and_points_face_the_front() {
    on_each_gpu("lines and points face the front", |gpu| {
        let fragment = "#version 450
            layout(location = 0) out vec4 written;
            void main() { written = vec4(gl_FrontFacing, 0.0, 0.0, 1.0); }";
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let corners = lines(&mut Random::new(16_600), 40, false);
        for topology in [Topology::PointList, Topology::LineList, Topology::LineStrip] {
            let pass = pass("faces")
                .pipelines([pipeline(fragment).topology(topology)])
                .draws([draw(0, &corners)]);
            let frame = compute.render(&pass).unwrap();
            let fits = |value| value == [0.0; 4] || value == [1.0, 0.0, 0.0, 1.0];
            assert!(frame.colors[0].values().all(fits), "{topology:?}");
            assert!(frame.colors[0].values().any(|value| value[0] > 0.0), "{topology:?}");
        }
    });
}

/// Commands in a buffer draw points, lines and strips as draws do.
#[test]
fn commands_draw_points_and_lines() {
    on_each_gpu("commands draw points and lines", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let mut random = Random::new(16_700);
        for topology in [Topology::PointList, Topology::LineList, Topology::LineStrip] {
            let mut corners = lines(&mut random, 30, false);
            corners.iter_mut().for_each(|corner| corner.size = 4.0);
            let direct = draw(0, &corners[..31]).instances(2);
            let mut later = direct.clone();
            (later.first, later.count) = (7, 20);
            let commands = [(0, 31, 2), (7, 20, 2)].map(|(first, count, instances)| {
                IndirectCommand { count, instances, first, first_instance: 0 }
            });
            let buffer = Buffer::with_content(gpu, "commands", &commands).unwrap();
            let indirect = direct.clone().indirect(Indirect::new(&buffer, 500));
            let frames = [vec![direct, later], vec![indirect]].map(|draws| {
                let pass = pass("commands")
                    .pipelines([pipeline(FLAT).topology(topology).blend(Blend::ADD)])
                    .draws(draws);
                compute.render(&pass).unwrap()
            });
            assert!(assert_same(&frames, 0.0, "commands") > 100, "{topology:?}");
        }
    });
}
