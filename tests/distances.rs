//! Do clip distances and cull distances do what the device's own pipeline does with them?

use crate::common::{gpu, on_each_gpu, random::Random};
use tilewright::{
    Buffer, Frame, Samples, classic, compute,
    format::{Format, VertexFormat},
    grid::Capacities,
    image::Extent,
    pass::{
        BufferRange, Draw, Executor, Indirect, IndirectCommand, Pass, Pipeline, VertexAttribute,
        VertexBinding,
    },
    reference,
    shader::{Distances, Shader, Stage},
    state::{Cull, DepthState, Topology},
    target::{ColorTarget, DepthTarget},
};

const SIDE: u32 = 64;

/// One colour for each primitive.
const FLAT: &str = "#version 450
    layout(location = 0) flat in vec4 shade;
    layout(location = 0) out vec4 written;
    void main() { written = shade; }";

/// A vertex shader that writes so many distances.
fn vertex(clip: u32, cull: u32) -> Shader {
    let declared = |name: &str, count: u32| match count {
        0 => String::new(),
        _ => format!("float gl_{name}Distance[{count}];"),
    };
    let written = |name: &str, count: u32, first: u32| -> String {
        let one = |n: u32| {
            format!("gl_{name}Distance[{n}] = given[{}][{}];", (first + n) / 4, (first + n) % 4)
        };
        (0..count).map(one).collect()
    };
    let text = format!(
        "#version 450
        layout(location = 0) in vec4 corner;
        layout(location = 1) in vec4 tint;
        layout(location = 2) in vec4 low;
        layout(location = 3) in vec4 high;
        layout(location = 0) flat out vec4 shade;
        layout(location = 1) out vec4 color;
        out gl_PerVertex {{ vec4 gl_Position; float gl_PointSize; {} {} }};
        void main() {{
            gl_Position = corner;
            gl_PointSize = 6.0;
            shade = tint;
            color = corner;
            vec4 given[2] = vec4[2](low, high);
            {} {}
        }}",
        declared("Clip", clip),
        declared("Cull", cull),
        written("Clip", clip, 0),
        written("Cull", cull, clip),
    );
    let shader = Shader::from_glsl(Stage::Vertex, "distances", &text);
    let shader = shader.unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(shader.reflection().distances, Distances { clip, cull });
    shader
}

/// A vertex.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Corner {
    place: [f32; 4],
    tint: [f32; 4],
    distances: [f32; 8],
}

fn pipeline(vertex: Shader, fragment: &str) -> Pipeline {
    let fragment = Shader::from_glsl(Stage::Fragment, "distances", fragment);
    Pipeline::new("distances", vertex, fragment.unwrap_or_else(|e| panic!("{e}")))
        .vertex_bindings([VertexBinding::per_vertex(size_of::<Corner>() as u32)])
        .vertex_attributes(
            [0, 16, 32, 48]
                .map(|offset| VertexAttribute::new(offset / 16, 0, VertexFormat::F32X4, offset)),
        )
        .depth(DepthState::OFF)
}

fn draw(corners: &[Corner]) -> Draw {
    let range = BufferRange::host("corners", bytemuck::cast_slice(corners).to_vec());
    Draw::new(0, corners.len() as u32).vertex_buffers([range])
}

fn pass(name: &str) -> Pass {
    Pass::new(name, Extent::new(SIDE, SIDE))
        .colors([ColorTarget::cleared(Format::Rgba32Float, [0.0; 4])])
}

/// A distance: of any size, often 0 or of a side.
fn distance(random: &mut Random) -> f32 {
    match random.below(8) {
        0 => 0.0,
        1 => 1.0,
        2 => -1.0,
        3 => 100.0 * random.signed(),
        _ => random.unit() * 2.0 - 0.7,
    }
}

/// Primitives of `corners` vertices, each of one colour. Some reach out of the view volume, and behind the eye.
fn primitives(random: &mut Random, count: usize, corners: usize) -> Vec<Corner> {
    let of_one = |n: usize| {
        let tint = [(n % 7) as f32 / 8.0, (n / 7 % 7) as f32 / 8.0, n as f32 / 1024.0, 1.0];
        let reach = [0.3, 1.0, 3.0][random.below(3)];
        let at = [(); 2].map(|()| random.signed());
        let corner = |_| {
            let w = if random.below(5) == 0 { random.signed() } else { 0.5 + random.unit() };
            let [x, y] = at.map(|at| (at + reach * random.signed()) * w.abs());
            let z = if random.below(5) == 0 { random.signed() * 2.0 } else { random.unit() * w };
            let distances = [(); 8].map(|()| distance(random));
            Corner { place: [x, y, z, w], tint, distances }
        };
        (0..corners).map(corner).collect::<Vec<_>>()
    };
    (0..count).flat_map(of_one).collect()
}

fn executors() -> [Box<dyn Executor>; 2] {
    let gpu = gpu();
    [
        Box::new(compute::Renderer::new(&gpu).unwrap()),
        Box::new(classic::Renderer::new(&gpu).unwrap()),
    ]
}

fn render(executors: &mut [Box<dyn Executor>; 2], pass: &Pass) -> [Frame; 2] {
    executors
        .each_mut()
        .map(|executor| executor.render(pass).unwrap_or_else(|e| panic!("{}: {e}", pass.label)))
}

/// Pixels that differ by more than `limit`, and pixels that something was drawn to.
fn compare(frames: &[Frame; 2], limit: f32) -> (usize, usize) {
    let [ours, theirs] =
        frames.each_ref().map(|frame| frame.colors[0].values().collect::<Vec<_>>());
    let differ = |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|n| (a[n] - b[n]).abs() > limit);
    let different = ours.iter().zip(&theirs).filter(differ).count();
    (different, theirs.iter().filter(|value| **value != [0.0; 4]).count())
}

/// Which pixels are drawn, and by which primitive.
#[test]
fn primitives_are_cut_and_culled_as_the_device_does() {
    let mut executors = executors();
    let mut drawn = 0;
    for seed in 17_000..17_120 {
        let mut random = Random::new(seed);
        let clip = random.below(9) as u32;
        let cull = random.below(9 - clip as usize) as u32;
        let (topology, corners) = [
            (Topology::TriangleList, 3),
            (Topology::TriangleStrip, 1),
            (Topology::TriangleFan, 1),
            (Topology::LineList, 2),
            (Topology::LineStrip, 1),
            (Topology::PointList, 1),
        ][random.below(6)];
        let pipeline = pipeline(vertex(clip, cull), FLAT).topology(topology).cull(Cull::None);
        let corners = primitives(&mut random, 60 / corners, corners);
        let pass =
            pass(&format!("{clip} clip and {cull} cull distances, {topology:?}, seed {seed}"))
                .pipelines([pipeline])
                .draws([draw(&corners)]);
        let frames = render(&mut executors, &pass);
        let (wrong, some) = compare(&frames, 0.0);
        assert!(wrong == 0, "{}: {wrong} of {some} pixels differ", pass.label);
        drawn += some;
    }
    assert!(drawn > 20_000, "{drawn} pixels are drawn");
}

/// Pixels of several samples, and their depths.
#[test]
fn samples_are_cut_as_the_device_does() {
    let mut executors = executors();
    let mut drawn = 0;
    for seed in 17_200..17_216 {
        let mut random = Random::new(seed);
        let pipeline = pipeline(vertex(3, 1), FLAT).cull(Cull::None).depth(DepthState::LESS);
        let pass = pass(&format!("samples, seed {seed}"))
            .samples(Samples::Four)
            .depth(DepthTarget::cleared(1.0))
            .pipelines([pipeline])
            .draws([draw(&primitives(&mut random, 20, 3))]);
        let (wrong, some) = compare(&render(&mut executors, &pass), 1e-6);
        // A depth of a sliver may be another one, and hides another sample.
        assert!(wrong <= 2, "{}: {wrong} of {some} pixels differ", pass.label);
        drawn += some;
    }
    assert!(drawn > 2000, "{drawn} pixels are drawn");
}

/// What a fragment shader reads of the distances.
#[test]
fn fragments_find_the_distances() {
    let mut executors = executors();
    let fragment = "#version 450
        layout(location = 1) in vec4 color;
        in float gl_ClipDistance[4];
        in float gl_CullDistance[3];
        layout(location = 0) out vec4 written;
        void main() {
            written = vec4(gl_ClipDistance[0], gl_ClipDistance[3], gl_CullDistance[0], gl_CullDistance[2]);
            written += 1e-3 * color.x;
        }";
    let pipeline = pipeline(vertex(4, 3), fragment).cull(Cull::None);
    let mut drawn = 0;
    for seed in 17_300..17_330 {
        let mut random = Random::new(seed);
        let mut corners = primitives(&mut random, 20, 3);
        // Weights of small distances beside large ones are rounded by both.
        for distance in corners.iter_mut().flat_map(|corner| &mut corner.distances) {
            *distance = distance.clamp(-2.0, 2.0);
        }
        let pass = pass(&format!("inputs, seed {seed}"))
            .pipelines([pipeline.clone()])
            .draws([draw(&corners)]);
        let (wrong, some) = compare(&render(&mut executors, &pass), 4e-3);
        assert!(wrong * 500 <= some, "{}: {wrong} of {some} pixels differ", pass.label);
        drawn += some;
    }
    assert!(drawn > 5000, "{drawn} pixels are drawn");
}

/// What Vulkan says of distances that are 0, negative zeros, no numbers or infinite, on a triangle over everything.
#[test]
fn distances_at_the_edge_of_numbers() {
    let tiny = f32::from_bits(1);
    on_each_gpu("distances at the edge of numbers", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let mut drawn = |clip: u32, cull: u32, distances: [f32; 3]| {
            let corner = |n: usize| Corner {
                place: [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]][n]
                    .iter()
                    .copied()
                    .chain([0.5, 1.0])
                    .collect::<Vec<_>>()
                    .try_into()
                    .unwrap(),
                tint: [1.0; 4],
                distances: [distances[n]; 8],
            };
            let pass = pass("numbers")
                .pipelines([pipeline(vertex(clip, cull), FLAT).cull(Cull::None)])
                .draws([draw(&[0, 1, 2].map(corner))]);
            let frame = compute.render(&pass).unwrap();
            frame.colors[0].values().filter(|value| value[3] == 1.0).count()
        };
        let all = (SIDE * SIDE) as usize;
        for (clip, cull) in [(1, 0), (0, 1), (8, 0), (0, 8), (3, 5)] {
            assert_eq!(drawn(clip, cull, [0.0; 3]), all, "{clip}, {cull}");
            assert_eq!(drawn(clip, cull, [-0.0; 3]), all, "{clip}, {cull}");
            assert_eq!(drawn(clip, cull, [-tiny; 3]), all, "{clip}, {cull}");
            assert_eq!(drawn(clip, cull, [f32::INFINITY; 3]), all, "{clip}, {cull}");
            assert_eq!(drawn(clip, cull, [-1.0; 3]), 0, "{clip}, {cull}");
            assert_eq!(drawn(clip, cull, [f32::NAN; 3]), 0, "{clip}, {cull}");
            assert_eq!(drawn(clip, cull, [f32::NEG_INFINITY; 3]), 0, "{clip}, {cull}");
        }
        // One corner is outside. The line between the halves is an upper left edge. One corner alone culls nothing.
        assert_eq!(drawn(1, 0, [-1.0, 1.0, 1.0]), all / 2 + SIDE as usize / 2);
        assert_eq!(drawn(0, 1, [-1.0, 1.0, 1.0]), all);
        // A distance that is no number has no place where it is 0.
        assert_eq!(drawn(1, 0, [f32::NAN, 1.0, 1.0]), 0);
        assert_eq!(drawn(0, 1, [f32::NAN, 1.0, 1.0]), all);
    });
}

/// Triangles that all planes cut leave as many parts as there may be, also in batches of one primitive.
#[test]
fn every_plane_cuts_a_triangle() {
    on_each_gpu("every plane cuts a triangle", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        // A triangle around the view volume. Eight planes of the user, the four sides, the near and the far plane all cut it.
        let corners: Vec<Corner> = (0..40)
            .flat_map(|n| {
                let more = n as f32 / 400.0;
                [0.25f32, 0.916, 1.583].map(|turn| {
                    let (y, x) = (turn * std::f32::consts::PI).sin_cos();
                    let distances = std::array::from_fn(|plane| {
                        let (b, a) = (plane as f32 * std::f32::consts::FRAC_PI_4 + 0.1).sin_cos();
                        1.01 - 4.0 * (a * x + b * y)
                    });
                    Corner {
                        place: [4.0 * x, 4.0 * y, 0.5 - more + 1.96 * (0.883 * x + 0.469 * y), 1.0],
                        tint: [more, 0.0, 0.0, 1.0],
                        distances,
                    }
                })
            })
            .collect();
        let pass = pass("octagons")
            .depth(DepthTarget::cleared(1.0))
            .pipelines([pipeline(vertex(8, 0), FLAT).cull(Cull::None).depth(DepthState::LESS)])
            .draws([draw(&corners)]);
        let whole = compute.render(&pass).unwrap();
        let (_, trace) = compute.trace(&pass).unwrap();
        assert_eq!(reference::first_difference(&pass, &trace), None, "{}", gpu.info());
        let parts = trace.bands[0].iter().flat_map(|batch| &batch.triangles).map(Vec::len).max();
        assert!(parts.unwrap() >= 12, "{parts:?} parts");
        // A fragment shader without inputs leaves the distances alone among the varyings.
        let fragment = "#version 450
            layout(location = 0) out vec4 written;
            void main() { written = vec4(1.0); }";
        let plain = pipeline(vertex(8, 0), fragment).cull(Cull::None).depth(DepthState::LESS);
        let plain = compute.render(&pass.clone().pipelines([plain])).unwrap();
        let drawn =
            |frame: &Frame| frame.colors[0].values().map(|value| value[3]).collect::<Vec<_>>();
        assert_eq!(drawn(&plain), drawn(&whole));
        for primitives in [1, 2, 7] {
            compute.set_batch_limit(Capacities {
                primitives,
                vertices: 4 * primitives,
                varying_words: 64 * primitives,
            });
            assert_eq!(compute.render(&pass).unwrap().colors, whole.colors, "{primitives}");
        }
        compute.set_batch_limit(Capacities::DEFAULT);
        let commands = [IndirectCommand {
            count: corners.len() as u32,
            instances: 1,
            first: 0,
            first_instance: 0,
        }];
        let buffer = Buffer::with_content(gpu, "commands", &commands).unwrap();
        let indirect = pass.clone().draws([draw(&corners).indirect(Indirect::new(&buffer, 100))]);
        assert_eq!(compute.render(&indirect).unwrap().colors, whole.colors);
    });
}

#[test]
fn too_many_distances_are_refused() {
    let text = "#version 450
        out gl_PerVertex { vec4 gl_Position; float gl_ClipDistance[5]; float gl_CullDistance[4]; };
        void main() { gl_Position = vec4(0.0); gl_ClipDistance[4] = 1.0; gl_CullDistance[3] = 1.0; }";
    let refusal = Shader::from_glsl(Stage::Vertex, "many", text).unwrap_err().to_string();
    assert!(
        refusal.contains("5 clip distances and 4 cull distances; there are 8 of both together"),
        "{refusal}"
    );

    let fragment = "#version 450
        in float gl_ClipDistance[3];
        layout(location = 0) out vec4 written;
        void main() { written = vec4(gl_ClipDistance[2]); }";
    let fault = pipeline(vertex(2, 4), fragment).validate().unwrap_err().to_string();
    assert!(
        fault.contains("reads 3 elements of gl_ClipDistance, of which `distances` writes 2"),
        "{fault}"
    );
}

/// Vulkan lets outputs that nobody writes be anything. Here they are 0, whatever the vertices before them got.
#[test]
fn distances_that_are_not_written_are_0() {
    let vertex = "#version 450
        layout(location = 0) in vec4 corner;
        layout(location = 1) in vec4 tint;
        layout(location = 0) flat out vec4 shade;
        out gl_PerVertex { vec4 gl_Position; float gl_ClipDistance[2]; };
        void main() {
            gl_Position = corner;
            shade = tint;
            if (tint.x > 0.5) gl_ClipDistance[1] = -1.0;
            if (tint.x > 2.0) gl_ClipDistance[0] = -1.0;
        }";
    let vertex = Shader::from_glsl(Stage::Vertex, "some", vertex).unwrap();
    on_each_gpu("distances that are not written are 0", |gpu| {
        // Every second triangle is outside, and there are more than one turn of the kernel takes. The others cover a few rows each.
        let corners: Vec<Corner> = (0..6000)
            .flat_map(|n| {
                let row = (n % SIDE as usize) as f32 / 32.0 - 1.0;
                [[-1.0, row], [3.0, row], [-1.0, row + 0.25]].map(|[x, y]| Corner {
                    place: [x, y, 0.5, 1.0],
                    tint: [(n % 2) as f32, 0.25, 0.0, 1.0],
                    distances: [0.0; 8],
                })
            })
            .collect();
        let pass = pass("unwritten")
            .pipelines([pipeline(vertex.clone(), FLAT).cull(Cull::None)])
            .draws([draw(&corners)]);
        let frame = compute::Renderer::new(gpu).unwrap().render(&pass).unwrap();
        let mut values = frame.colors[0].values();
        assert!(values.all(|value| value == [0.0, 0.25, 0.0, 1.0]), "{}", gpu.info());
    });
}
