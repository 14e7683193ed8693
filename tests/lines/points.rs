//! Points.

use super::*;

/// Points of all sizes, each of one colour. Some are beyond the near or the far plane, or behind the eye.
pub(super) fn points(random: &mut Random, count: usize) -> Vec<Corner> {
    let point = |number| {
        let at = place(random);
        let size = match random.below(4) {
            0 => 1.0 + random.below(64) as f32,
            1 => 1.0 + 3.0 * random.unit(),
            2 => ((1.0 + 20.0 * random.unit()) * 256.0).round() / 256.0,
            _ => 1.0 + 63.0 * random.unit(),
        };
        let place = match random.below(8) {
            0 => clip(at, 2.0 * random.unit() - 0.5, some_w(random)),
            1 => clip(at, random.unit(), some_w(random) - 0.8),
            _ => clip(at, random.unit(), some_w(random)),
        };
        Corner { place, tint: tint(number), size }
    };
    (0..count).map(point).collect()
}

fn point_pipeline(fragment: &str) -> Pipeline {
    pipeline(fragment).topology(Topology::PointList)
}

/// The last of all points at a pixel, with viewports, scissors, indices and instances.
#[test]
fn points_cover_what_the_device_says() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let mut drawn = 0;
    for seed in 14_000..14_100 {
        let mut random = Random::new(seed);
        let corners = points(&mut random, 40);
        let mut draw = draw(0, &corners).instances(1 + random.below(3) as u32);
        if random.below(2) == 0 {
            draw = draw.viewport(some_viewport(&mut random));
        }
        if random.below(3) == 0 {
            draw = draw.scissor(some_scissor(&mut random));
        }
        if random.below(3) == 0 {
            let indices: Vec<u32> = (0..50).map(|_| random.below(corners.len()) as u32).collect();
            draw.count = indices.len() as u32;
            draw = draw.indices(indices_of(&indices));
        }
        let pass =
            pass(&format!("points, seed {seed}")).pipelines([point_pipeline(FLAT)]).draws([draw]);
        drawn += assert_same(&render(&mut executors, &pass), 0.0, &pass.label);
    }
    assert!(drawn > 100_000, "{drawn} pixels are drawn");
}

pub(super) fn indices_of(indices: &[u32]) -> Indices {
    let bytes = bytemuck::cast_slice(indices).to_vec();
    Indices::new(BufferRange::host("indices", bytes), IndexFormat::U32)
}

/// Small points apart from each other: none hides what another one covers.
#[test]
fn small_points_cover_what_the_device_says() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let mut drawn = 0;
    for seed in 14_100..14_160 {
        let mut random = Random::new(seed);
        let corner = |number: usize| {
            let cell = [number % 8, number / 8].map(|cell| 8.0 * cell as f32 + 4.0);
            let at = cell.map(|at| rounded(&mut random, at + random_step(seed, number)));
            let size = rounded(&mut random, 1.0 + 5.0 * random_step(seed, number + 64).abs());
            Corner { place: clip(at, 0.5, 1.0), tint: tint(number), size: size.max(1.0) }
        };
        let corners: Vec<_> = (0..64).map(corner).collect();
        let pass = pass(&format!("small points, seed {seed}"))
            .pipelines([point_pipeline(FLAT)])
            .draws([draw(0, &corners)]);
        drawn += assert_same(&render(&mut executors, &pass), 0.0, &pass.label);
    }
    assert!(drawn > 20_000, "{drawn} pixels are drawn");
}

/// A number in -1..1.
fn random_step(seed: u64, number: usize) -> f32 {
    Random::new(seed << 16 | number as u64).signed()
}

#[test]
fn point_coordinates_are_those_of_the_device() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    for seed in 14_200..14_240 {
        let mut random = Random::new(seed);
        let corners = points(&mut random, 24);
        let pass = pass(&format!("coordinates of points, seed {seed}"))
            .pipelines([point_pipeline(POINT_COORD)])
            .draws([draw(0, &corners)]);
        let frames = render(&mut executors, &pass);
        assert_same(&frames, 1e-5, &pass.label);
        let mut values = frames[0].colors[0].values();
        let within = |[x, y, _, drawn]: [f32; 4]| {
            drawn == 0.0 || [x, y].iter().all(|at| (-0.01..=1.01).contains(at))
        };
        assert!(values.all(within), "{}", pass.label);
    }
}

/// Inputs of all interpolations, and the depth, are those of the vertex.
#[test]
fn inputs_of_points_are_those_of_the_vertex() {
    let gpu = gpu();
    let mut executors = executors(&gpu);
    let fragment = "#version 450
        layout(location = 0) flat in vec4 shade;
        layout(location = 1) in vec4 color;
        layout(location = 2) noperspective in vec4 straight;
        layout(location = 0) out vec4 written;
        void main() {
            float far = max(distance(shade, color), distance(shade, straight));
            written = vec4(far, abs(dFdx(color.z)) + abs(dFdy(color.z)), gl_FragCoord.z, 1.0);
        }";
    for seed in 14_300..14_330 {
        let mut random = Random::new(seed);
        let corners = points(&mut random, 24);
        let pass = pass(&format!("inputs of points, seed {seed}"))
            .depth(DepthTarget::cleared(0.0))
            .pipelines([point_pipeline(fragment).depth(DepthState::new(Compare::Always))])
            .draws([draw(0, &corners)]);
        let frames = render(&mut executors, &pass);
        assert_same(&frames, 1e-5, &pass.label);
        let [far, slope] = [0, 1].map(|channel| {
            frames[0].colors[0].values().map(|value| value[channel]).fold(0.0, f32::max)
        });
        assert!(far < 1e-6 && slope < 1e-6, "{}: {far} {slope}", pass.label);
        let [ours, theirs] = frames.map(|frame| frame.depth.unwrap().depths());
        let near = ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near, "{}: depths", pass.label);
    }
}

/// A vertex shader that says no size draws points of one pixel.
#[test]
fn points_without_a_size_are_one_pixel() {
    on_each_gpu("points without a size are one pixel", |gpu| {
        let vertex = VERTEX.replace("gl_PointSize = size;", "");
        let pipeline = point_pipeline(FLAT).vertex(shader(Stage::Vertex, &vertex));
        let corners: Vec<_> = (0..64)
            .map(|n| {
                let at = [n % 8, n / 8].map(|cell| 8.0 * cell as f32 + 3.5);
                Corner { place: clip(at, 0.5, 1.0), tint: tint(n), size: 7.0 }
            })
            .collect();
        let pass = pass("no size").pipelines([pipeline]).draws([draw(0, &corners)]);
        let frame = compute::Renderer::new(gpu).unwrap().render(&pass).unwrap();
        for (pixel, value) in frame.colors[0].values().enumerate() {
            let [x, y] = [pixel % SIDE as usize, pixel / SIDE as usize];
            let is_point = x % 8 == 3 && y % 8 == 3;
            let wanted = if is_point { tint(x / 8 + y / 8 * 8) } else { [0.0; 4] };
            assert_eq!(value, wanted, "{x} {y}");
        }
    });
}
