//! Which stage is wrong? Every intermediate of the device against the CPU reference, stage by stage
//! and bit for bit, over seeded random meshes. The reference plans for itself; [`planned`] shows that a fault of
//! compute's plan does not stay hidden.

mod planned;
pub mod varied;

use crate::common::{self, random::Random};
use std::sync::{Arc, OnceLock};
use tilewright::{
    Samples, compare, compute,
    format::{Format, VertexFormat},
    grid::Capacities,
    image::Extent,
    pass::{BufferRange, BufferSource, Draw, IndexFormat, Indices, Pass, Pipeline, StepRate},
    pass::{VertexAttribute, VertexBinding},
    reference,
    scene::{PassOptions, Scene},
    shader::{Shader, Stage},
    state::{
        Blend, Compare, Cull, DepthBias, DepthState, FrontFace, LineMode, ProvokingVertex, Rect,
        Topology, Viewport,
    },
    stencil::{StencilFace, StencilOp, StencilState},
    target::{ColorTarget, DepthTarget, LoadOp, StencilTarget},
    trace::{Shaded, Trace, Vertex},
    vk::{Gpu, GpuOptions},
};
use varied::Variation;

/// Takes clip-space positions as they are.
pub const VERTEX: &str = "#version 450
layout(location = 0) in vec4 position;
layout(location = 0) out vec4 color;
void main() {
    gl_Position = position;
    color = vec4(fract(vec3(gl_VertexIndex) * vec3(0.37, 0.61, 0.83)), 0.5);
}";

/// As [`VERTEX`], with distances of any kind.
const VERTEX_WITH_DISTANCES: &str = "#version 450
layout(location = 0) in vec4 position;
layout(location = 0) out vec4 color;
out gl_PerVertex { vec4 gl_Position; float gl_ClipDistance[5]; float gl_CullDistance[2]; };
void main() {
    gl_Position = position;
    color = vec4(fract(vec3(gl_VertexIndex) * vec3(0.37, 0.61, 0.83)), 0.5);
    gl_ClipDistance = float[5](0.7 * position.x + 0.4 * position.w, color.x - 0.1, position.y + 0.5 * position.w,
                               gl_VertexIndex % 3 - 0.5, gl_VertexIndex % 31 == 7 ? uintBitsToFloat(0x7fc00000) : 1e-39);
    gl_CullDistance = float[2](color.y - 0.6, gl_VertexIndex % 29 == 3 ? uintBitsToFloat(0x7f800000) : position.z);
}";

pub const FRAGMENT: &str = "#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 target;
void main() { target = color; }";

/// Clip-space triangles of one kind of trouble each.
fn positions(random: &mut Random, triangles: usize) -> Vec<[f32; 4]> {
    let mut all = Vec::new();
    for _ in 0..triangles {
        let kind = random.below(10);
        let size = [0.01, 0.05, 0.3, 1.0, 4.0][random.below(5)];
        let w = 0.1 + random.unit() * 10.0;
        let center = [random.signed() * 1.2, random.signed() * 1.2, random.unit()];
        let mut corners: Vec<[f32; 4]> = (0..3)
            .map(|_| {
                let w = w * (0.5 + random.unit());
                [
                    (center[0] + random.signed() * size) * w,
                    (center[1] + random.signed() * size) * w,
                    (center[2] + random.signed() * size * 0.3) * w,
                    w,
                ]
            })
            .collect();
        match kind {
            // Through the near plane, or behind the eye altogether.
            0 => corners[random.below(3)][3] *= -1.0,
            1 => corners[random.below(3)][2] = -random.unit(),
            // Far outside, so that it is clipped.
            2 => corners[random.below(3)][random.below(2)] = random.signed() * 1e6,
            3 => corners[random.below(3)] = [1e30, -1e30, 0.5, 1e-3],
            // Exact coincidences with pixel centres and each other.
            4 => {
                for c in &mut corners {
                    let snap = |v: f32| (v / c[3] * 16.0).round() / 16.0;
                    *c = [snap(c[0]), snap(c[1]), snap(c[2]).clamp(0.0, 1.0), 1.0];
                }
            }
            5 => corners[1] = corners[0],
            6 => {
                let bad = [f32::NAN, f32::INFINITY, 1e-40, 0.0][random.below(4)];
                corners[random.below(3)][random.below(4)] = bad;
            }
            _ => {}
        }
        all.extend(corners);
    }
    all
}

fn pipeline(random: &mut Random, vertex: &Arc<Shader>, fragment: &Arc<Shader>) -> Pipeline {
    use Compare::*;
    let compare =
        [Less, LessOrEqual, Greater, GreaterOrEqual, Equal, NotEqual, Always][random.below(7)];
    Pipeline::new("twin", vertex.clone(), fragment.clone())
        .vertex_bindings([VertexBinding { stride: 16, rate: StepRate::Vertex }])
        .vertex_attributes([VertexAttribute {
            location: 0,
            binding: 0,
            format: VertexFormat::F32X4,
            offset: 0,
        }])
        .topology(
            [Topology::TriangleList, Topology::TriangleStrip, Topology::TriangleFan]
                [random.below(3)],
        )
        .cull([Cull::None, Cull::Back, Cull::Front][random.below(3)])
        .front_face([FrontFace::CounterClockwise, FrontFace::Clockwise][random.below(2)])
        .depth(DepthState::new(compare).test(random.below(8) > 0).write(random.below(4) > 0))
        .blend((random.below(4) == 0).then_some(Blend::ALPHA))
}

/// `pass` with a depth target of any format and several samples, and with draws that are bounded by the depths that are there,
/// that are clamped to the depths of their viewport, not clipped at them, or drawn to some of the samples.
pub fn with_depth_state(seed: u64, mut pass: Pass) -> Pass {
    let mut random = Random::new(seed ^ 0x626f_756e_6473);
    // Drivers compile kernels of their own for stencil tests, and for points and lines. So a pass has one of them at most, and
    // with one kind of depths: their formats meet the other passes.
    let kind = if seed.is_multiple_of(3) { random.below(2) } else { 2 };
    if let Some(depth) = &mut pass.depth {
        // What a pass begins with has the format too.
        let is_cleared = matches!(depth.load, LoadOp::Clear(_)) && depth.image.is_none();
        let formats = [Format::D32Float, Format::D16Unorm, Format::X8D24Unorm];
        depth.format = formats[if is_cleared && kind == 2 { random.below(3) } else { 0 }];
        // Not each number with each format: drivers compile a kernel for every pair.
        let several = match depth.format {
            Format::D16Unorm => Samples::Two,
            Format::X8D24Unorm => Samples::Eight,
            _ if kind < 2 => Samples::Four,
            _ => [Samples::Four, Samples::Sixteen][random.below(2)],
        };
        pass.samples = [Samples::One, several][random.below(2)];
    }
    if kind == 0 {
        pass.stencil = Some(StencilTarget::cleared(random.below(4) as u8));
    }
    for (draw, pipeline) in pass.draws.iter_mut().zip(&mut pass.pipelines) {
        if kind == 0 {
            let op = |random: &mut Random| StencilOp::ALL[random.below(StencilOp::ALL.len())];
            let mut face = || {
                let face = StencilFace::new(Compare::ALL[random.below(8)]);
                let face = face.compare_mask(random.bits() as u8).write_mask(random.bits() as u8);
                match random.below(3) {
                    // Opaque work, if both faces are so.
                    0 => face.compare(Compare::Always).write_mask(15).pass(StencilOp::Replace),
                    1 => face,
                    _ => {
                        let face = face.fail(op(&mut random)).depth_fail(op(&mut random));
                        face.pass(op(&mut random))
                    }
                }
            };
            let front = face();
            let back = if front.pass == StencilOp::Replace { front } else { face() };
            let state = StencilState::new(front).back(back);
            *pipeline = Arc::new((**pipeline).clone().stencil(state));
            draw.stencil_reference = [random.below(5) as u8, random.below(5) as u8];
        }
        if kind == 1 && random.below(2) == 0 {
            let topologies = [
                Topology::PointList,
                Topology::LineList,
                Topology::LineStrip,
                Topology::LineListWithAdjacency,
                Topology::LineStripWithAdjacency,
            ];
            let width = [1.0, 1.0 + 8.0 * random.unit()][random.below(2)];
            let mode = LineMode::ALL[random.below(2)];
            let topology = topologies[random.below(5)];
            let made = (**pipeline).clone().topology(topology).line_mode(mode).line_width(width);
            *pipeline = Arc::new(made);
        }
        if kind == 2 && random.below(6) == 0 {
            let adjacency =
                [Topology::TriangleListWithAdjacency, Topology::TriangleStripWithAdjacency]
                    [random.below(2)];
            *pipeline = Arc::new((**pipeline).clone().topology(adjacency));
        }
        if random.below(3) == 0 {
            let last = (**pipeline).clone().provoking_vertex(ProvokingVertex::Last);
            *pipeline = Arc::new(last);
        }
        if kind == 2 && random.below(4) == 0 {
            *pipeline = Arc::new((**pipeline).clone().vertex(with_distances()));
        }
        if random.below(6) == 0 {
            let depths = [(); 2].map(|()| [0.0, 0.5, 1.0, random.unit()][random.below(4)]);
            draw.depth_bounds = [depths[0].min(depths[1]), depths[0].max(depths[1])];
            let bounded = pipeline.depth.bounds(true);
            *pipeline = Arc::new((**pipeline).clone().depth(bounded));
        }
        if random.below(8) == 0 {
            let mask = random.below(1 << 16) as u32;
            *pipeline = Arc::new((**pipeline).clone().sample_mask(mask));
        }
        if random.below(5) == 0 {
            let clip = [None, None, Some(false), Some(true)][random.below(4)];
            let clamp = random.below(3) > 0;
            *pipeline = Arc::new((**pipeline).clone().depth_clamp(clamp).depth_clip(clip));
        }
    }
    pass
}

/// A pass of a few draws in a random target.
pub fn random_pass(seed: u64, shaders: &(Arc<Shader>, Arc<Shader>)) -> Pass {
    let mut random = Random::new(seed);
    let random = &mut random;
    let extent = Extent::new(1 + random.below(150) as u32, 1 + random.below(150) as u32);
    let mut pass = Pass::new(&format!("seed {seed}"), extent)
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .depth(DepthTarget::cleared([0.0, 0.5, 1.0][random.below(3)]));
    for _ in 0..1 + random.below(4) {
        let pipeline = pipeline(random, &shaders.0, &shaders.1);
        let triangles = 1 + random.below(40);
        let positions = positions(random, triangles);
        let buffer = |label: &str, bytes: &[u8]| Arc::new(BufferSource::new(label, bytes.to_vec()));
        // Elements before the range that is bound, and elements of the range before the first that is drawn.
        let (unbound, skipped) = (random.below(3), random.below(3));
        let other = [[0.9f32, -0.9, 0.1, 1.0], [-0.9, 0.9, 0.2, 1.0]];
        let before = other.iter().cycle().take(unbound + skipped);
        let vertices: Vec<[f32; 4]> = before.chain(&positions).copied().collect();
        let vertices = buffer("positions", bytemuck::cast_slice(&vertices));
        let mut draw = Draw::new(pass.pipelines.len(), positions.len() as u32);
        let (offset, bytes) = (16 * unbound, 16 * (skipped + positions.len()));
        draw.vertex_buffers = vec![BufferRange { buffer: vertices, offset, bytes }];
        draw.first = skipped as u32;
        if random.below(2) == 0 {
            let count = 3 + random.below(3 * triangles);
            // The smallest index may be larger than its vertex's number, and smaller.
            let more = random.below(5);
            draw.base_vertex = skipped as i32 - more as i32;
            let (unbound, skipped) = (random.below(3), random.below(3));
            let values: Vec<u32> = (0..unbound + skipped + count)
                .map(|_| (more + random.below(positions.len())) as u32)
                .collect();
            let wide = random.below(2) == 0;
            let bytes: Vec<u8> = match wide {
                true => bytemuck::cast_slice(&values).to_vec(),
                false => values.iter().flat_map(|&v| (v as u16).to_le_bytes()).collect(),
            };
            let format = if wide { IndexFormat::U32 } else { IndexFormat::U16 };
            let (offset, bound) = (format.bytes() * unbound, format.bytes() * (skipped + count));
            let range = BufferRange { buffer: buffer("indices", &bytes), offset, bytes: bound };
            draw.indices = Some(Indices::new(range, format));
            draw.first = skipped as u32;
            draw.count = count as u32;
        }
        draw.instances = 1 + random.below(3) as u32;
        draw.first_instance = random.below(3) as u32;
        if random.below(4) == 0 {
            let (w, h) = (extent.width as f32, extent.height as f32);
            let flip = random.below(2) == 0;
            let height = 1.0 + random.unit() * h;
            draw.viewport = Some(Viewport {
                x: random.signed() * w * 0.3,
                y: if flip { h } else { random.signed() * h * 0.3 },
                width: 1.0 + random.unit() * w,
                height: if flip { -height } else { height },
                min_depth: 0.25 * random.unit(),
                max_depth: 0.25 + 0.75 * random.unit(),
            });
        }
        if random.below(4) == 0 {
            let x = random.below(extent.width as usize) as u32;
            let y = random.below(extent.height as usize) as u32;
            draw.scissor = Some(Rect { x, y, width: 1 + x, height: 1 + y });
        }
        if random.below(4) == 0 {
            let factor =
                |random: &mut Random| [0.0, 1.0, -3.0, 1e5, random.signed(), 1e38][random.below(6)];
            let bias = DepthBias::new(factor(random), factor(random));
            draw.depth_bias = Some(bias.clamp([0.0, 0.0, 0.01, -0.01][random.below(4)]));
        }
        pass.pipelines.push(Arc::new(pipeline));
        pass.draws.push(draw);
    }
    pass
}

pub fn shaders() -> (Arc<Shader>, Arc<Shader>) {
    (
        Arc::new(Shader::from_glsl(Stage::Vertex, "twin.vert", VERTEX).expect("a valid shader")),
        Arc::new(
            Shader::from_glsl(Stage::Fragment, "twin.frag", FRAGMENT).expect("a valid shader"),
        ),
    )
}

fn with_distances() -> Arc<Shader> {
    static SHADER: OnceLock<Arc<Shader>> = OnceLock::new();
    let shader = || Shader::from_glsl(Stage::Vertex, "distances.vert", VERTEX_WITH_DISTANCES);
    SHADER.get_or_init(|| Arc::new(shader().expect("a valid shader"))).clone()
}

/// The first difference between what the device left of `pass` and the reference; `seen` counts the
/// pixels that batches drew.
pub fn difference(
    renderer: &mut compute::Renderer,
    pass: &Pass,
    seen: &mut usize,
) -> Option<String> {
    let (_, trace) = renderer.trace(pass).expect("the pass is drawn");
    *seen += pixels(&trace);
    reference::first_difference(pass, &trace)
}

/// The pixels that batches drew.
fn pixels(trace: &Trace) -> usize {
    let keys = trace.bands.iter().flatten().flat_map(|batch| &batch.visibility);
    keys.filter(|key| **key != 0).count()
}

/// A vertex of `pass` that is not where its buffer says. [`VERTEX`] takes positions as they are, so that they need
/// not be believed.
fn misplaced(pass: &Pass, trace: &Trace) -> Option<Vertex> {
    let wrong = |(vertex, found): &(Vertex, Shaded)| {
        let range = &pass.draws[vertex.draw as usize].vertex_buffers[0];
        let at = range.offset + 16 * vertex.vertex as usize;
        let position: [f32; 4] =
            bytemuck::pod_read_unaligned(&range.buffer.host_bytes().unwrap()[at..at + 16]);
        position.map(f32::to_bits) != found.position.map(f32::to_bits)
    };
    trace.positions.iter().find(wrong).map(|(vertex, _)| vertex)
}

fn random_meshes(gpu: &Gpu, seeds: std::ops::Range<u64>, counts: &[Samples]) {
    let shaders = shaders();
    let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
    let (mut seen, count) = (0, seeds.end - seeds.start);
    for seed in seeds {
        // Batches of every size, so that draws are cut in all places.
        let primitives = 1 << (3 + seed % 10);
        renderer.set_batch_limit(Capacities {
            primitives,
            vertices: 3 * primitives,
            varying_words: 1 << 16,
        });
        let variation = Variation::ALL[seed as usize / 10 % 4];
        let mut pass = with_depth_state(seed, random_pass(seed, &shaders));
        if !counts.contains(&pass.samples) {
            pass.samples = Samples::One;
        }
        let (pass, snapshot) = variation.apply(&mut renderer, seed, pass);
        let (_, trace) = renderer.trace(&pass).expect("the pass is drawn");
        seen += pixels(&trace);
        let what = format!("{}, seed {seed}, {variation:?}", gpu.info());
        if let Some(found) = reference::first_difference(&snapshot, &trace) {
            panic!("{what}: {found}");
        }
        if let Some(vertex) = misplaced(&snapshot, &trace) {
            panic!("{what}: {vertex} is not where its buffer says");
        }
    }
    assert!(seen as u64 > 1000 * count, "{seen} pixels drawn in {count} meshes test nothing");
}

#[test]
fn a_thousand_random_meshes_on_the_driver_under_test() {
    random_meshes(&common::gpu(), 0..1000, &Samples::ALL);
}

#[test]
fn a_thousand_random_meshes_on_swiftshader() {
    if let Some(gpu) = common::swiftshader("twin on SwiftShader") {
        // It takes seconds to compile what each number of samples needs.
        random_meshes(&gpu, 0..1000, &[Samples::Four]);
    }
}

#[test]
fn a_target_of_several_bands() {
    let gpu = common::gpu();
    let shaders = shaders();
    let mut renderer = compute::Renderer::new(&gpu).expect("kernels are made");
    let (mut seen, mut bands) = (0, 0);
    for seed in 0..3 {
        // The narrower target has its bands further down.
        let extent = [Extent::new(16384, 520), Extent::new(4100, 2080)][seed as usize % 2];
        let mut pass = random_pass(seed, &shaders).extent(extent);
        let cut = (*pass.pipelines[0]).clone().vertex(with_distances());
        pass.pipelines[0] = Arc::new(cut);
        let (_, trace) = renderer.trace(&pass).expect("the pass is drawn");
        let found = reference::first_difference(&pass, &trace);
        assert_eq!(found, None, "seed {seed}");
        bands += trace.bands.len();
        seen += pixels(&trace);
    }
    assert_eq!(bands, 6, "each target has two bands");
    assert!(seen > 1_000_000, "only {seen} pixels are drawn");
}

fn built_in_scenes(gpu: &Gpu, extent: Extent) {
    for name in Scene::builtin_names() {
        let scene = Scene::builtin(name).expect("it is built in");
        let camera = scene.default_camera(extent);
        let pass = scene.pass(extent, &camera, &PassOptions::default()).expect("a valid pass");
        // A fragment shader that discards decides coverage by itself; the reference runs none.
        let ids = compare::id_pass(&pass).expect("an id pass");
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let mut seen = 0;
        if let Some(found) = difference(&mut renderer, &ids.pass, &mut seen) {
            panic!("{}, {name}: {found}", gpu.info());
        }
        assert!(seen > 0, "{name} shows nothing");
    }
}

#[test]
fn built_in_scenes_on_the_driver_under_test() {
    built_in_scenes(&common::gpu(), Extent::new(333, 187));
}

/// How kernels reach buffers, by address or by descriptor, decides nothing; and by descriptor the
/// validation layer sees all of it, a barrier that is missing included.
#[test]
fn built_in_scenes_by_descriptor_are_those_by_address() {
    let device = Some(common::device_under_test().index.to_string());
    let options = |by_address| GpuOptions::default().device(device.clone()).by_address(by_address);
    let gpus = [true, false].map(|by_address| common::open_with(options(by_address)));
    for name in Scene::builtin_names() {
        let scene = Scene::builtin(name).expect("it is built in");
        let extent = Extent::new(331, 211);
        let camera = scene.default_camera(extent);
        let pass = scene.pass(extent, &camera, &PassOptions::default()).expect("a valid pass");
        let [by_address, by_descriptor] = gpus.each_ref().map(|gpu| {
            let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
            renderer.render(&pass).expect("it is drawn")
        });
        assert!(by_address.colors[0] == by_descriptor.colors[0], "{name}: colours differ");
        assert!(by_address.depth == by_descriptor.depth, "{name}: depths differ");
    }
}

#[test]
fn built_in_scenes_on_swiftshader() {
    if let Some(gpu) = common::swiftshader("built-in scenes on SwiftShader") {
        built_in_scenes(&gpu, Extent::new(99, 61));
    }
}
