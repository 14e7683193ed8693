//! Are points and lines what the device's own pipeline draws: coverage, order, depth, inputs, and everything that comes after?

use crate::common::{gpu, on_each_gpu, random::Random};
use tilewright::{
    Buffer, Error, Frame, Picture, Samples, classic, compute,
    format::{Format, VertexFormat},
    image::Extent,
    pass::{
        BufferRange, Draw, Executor, IndexFormat, Indices, Indirect, IndirectCommand, Pass,
        Pipeline, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::{Blend, Compare, Cull, DepthState, LineMode, Rect, Topology, Viewport},
    stencil::{StencilFace, StencilOp, StencilState},
    target::{ColorTarget, DepthTarget, StencilTarget},
    vk::Gpu,
};

mod coverage;
mod points;
mod refused;
mod several;
mod values;

/// A power of two: places in the window have the same bits whether products are fused with sums or not.
const SIDE: u32 = 64;

const WIDTHS: [f32; 5] = [1.0, 1.5, 2.0, 3.7, 9.0];
const MODES: [LineMode; 2] = [LineMode::Rectangular, LineMode::Bresenham];

/// Every other instance is turned by a quarter and has its colours exchanged; nothing is rounded on the way.
const VERTEX: &str = "#version 450
    layout(location = 0) in vec4 corner;
    layout(location = 1) in vec4 tint;
    layout(location = 2) in float size;
    layout(location = 0) flat out vec4 shade;
    layout(location = 1) out vec4 color;
    layout(location = 2) noperspective out vec4 straight;
    void main() {
        bool turned = (gl_InstanceIndex & 1) != 0;
        gl_Position = turned ? vec4(-corner.y, corner.x, corner.zw) : corner;
        gl_PointSize = size;
        shade = turned ? tint.zxyw : tint;
        color = shade;
        straight = shade;
    }";

/// One colour for each primitive.
const FLAT: &str = "#version 450
    layout(location = 0) flat in vec4 shade;
    layout(location = 0) out vec4 written;
    void main() { written = shade; }";

const SMOOTH: &str = "#version 450
    layout(location = 1) in vec4 color;
    layout(location = 0) out vec4 written;
    void main() { written = color; }";

const POINT_COORD: &str = "#version 450
    layout(location = 0) out vec4 written;
    void main() { written = vec4(gl_PointCoord, 0.0, 1.0); }";

fn shader(stage: Stage, text: &str) -> Shader {
    Shader::from_glsl(stage, "lines", text).unwrap_or_else(|e| panic!("{e}"))
}

/// A pipeline for [`draw`].
fn pipeline(fragment: &str) -> Pipeline {
    Pipeline::new("lines", shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, fragment))
        .vertex_bindings([VertexBinding::per_vertex(size_of::<Corner>() as u32)])
        .vertex_attributes([
            VertexAttribute::new(0, 0, VertexFormat::F32X4, 0),
            VertexAttribute::new(1, 0, VertexFormat::F32X4, 16),
            VertexAttribute::new(2, 0, VertexFormat::F32X1, 32),
        ])
        .depth(DepthState::OFF)
}

/// A vertex.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Corner {
    /// In clip space.
    place: [f32; 4],
    tint: [f32; 4],
    /// Of a point.
    size: f32,
}

fn draw(pipeline: usize, corners: &[Corner]) -> Draw {
    let range = BufferRange::host("corners", bytemuck::cast_slice(corners).to_vec());
    Draw::new(pipeline, corners.len() as u32).vertex_buffers([range])
}

/// A pass over a square of floats.
fn pass(name: &str) -> Pass {
    Pass::new(name, Extent::new(SIDE, SIDE))
        .colors([ColorTarget::cleared(Format::Rgba32Float, [0.0; 4])])
}

/// Compute, then the device's own pipeline.
fn executors(gpu: &Gpu) -> [Box<dyn Executor>; 2] {
    [Box::new(compute::Renderer::new(gpu).unwrap()), Box::new(classic::Renderer::new(gpu).unwrap())]
}

fn render(executors: &mut [Box<dyn Executor>; 2], pass: &Pass) -> [Frame; 2] {
    executors
        .each_mut()
        .map(|executor| executor.render(pass).unwrap_or_else(|e| panic!("{}: {e}", pass.label)))
}

/// Pixels whose values differ by more than `limit`, in any channel. NaNs differ from all but themselves.
fn different([ours, theirs]: [&Picture; 2], limit: f32) -> Vec<(u32, u32, [[f32; 4]; 2])> {
    assert_eq!(ours.extent, theirs.extent);
    let width = ours.extent.width;
    let both = ours.values().zip(theirs.values()).enumerate();
    let near = |(a, b): (f32, f32)| a.to_bits() == b.to_bits() || (a - b).abs() <= limit;
    both.filter(|(_, (a, b))| !(0..4).all(|n| near((a[n], b[n]))))
        .map(|(pixel, (a, b))| (pixel as u32 % width, pixel as u32 / width, [a, b]))
        .collect()
}

/// Both drew the same, up to `limit`. Returns the number of pixels that something was drawn to.
fn assert_same(frames: &[Frame; 2], limit: f32, what: &str) -> usize {
    let pictures = frames.each_ref().map(|frame| &frame.colors[0]);
    let found = different(pictures, limit);
    assert!(
        found.is_empty(),
        "{what}: {} pixels differ, first {:?}",
        found.len(),
        &found[..found.len().min(4)]
    );
    pictures[1].values().filter(|value| *value != [0.0; 4]).count()
}

/// A coordinate near `at`: anything, or where it is rounded: centres of pixels, steps of the device's grid and halves of them.
fn rounded(random: &mut Random, at: f32) -> f32 {
    let step = |step: f32| (at * step).round() / step;
    match random.below(7) {
        0 => at.floor() + 0.5,
        1 => step(2.0),
        2 => step(16.0),
        3 => step(256.0),
        4 => step(512.0),
        _ => at,
    }
}

/// A place in the window, on the target or around it.
fn place(random: &mut Random) -> [f32; 2] {
    let around = [2.0, 24.0, 24.0, 200.0][random.below(4)];
    let side = SIDE as f32;
    [(); 2].map(|()| {
        let at = random.unit() * (side + 2.0 * around) - around;
        rounded(random, at)
    })
}

/// Clip space of a place in the window, a depth in 0..1 and a w.
fn clip([x, y]: [f32; 2], depth: f32, w: f32) -> [f32; 4] {
    let half = SIDE as f32 / 2.0;
    [(x / half - 1.0) * w, (y / half - 1.0) * w, depth * w, w]
}

/// A colour that no other number has.
fn tint(number: usize) -> [f32; 4] {
    let n = number + 1;
    [(n % 5) as f32 / 4.0, (n / 5 % 5) as f32 / 4.0, n as f32 / 1024.0, 1.0]
}

/// A w, often 1.
fn some_w(random: &mut Random) -> f32 {
    if random.below(2) == 0 { 1.0 } else { 0.3 + 2.0 * random.unit() }
}

/// A line of whatever length and direction, in the window.
fn ends(random: &mut Random) -> [[f32; 2]; 2] {
    let a = place(random);
    let short = [1.0, 4.0, 12.0][random.below(3)];
    let [dx, dy] = [(); 2].map(|()| short * random.signed());
    let b = match random.below(7) {
        0 => place(random),
        1 => [a[0], place(random)[1]],
        2 => [place(random)[0], a[1]],
        3 => [a[0] + dx, a[1] + if random.below(2) == 0 { dx } else { -dx }],
        4 if random.below(8) == 0 => a,
        _ => [a[0] + dx, a[1] + dy].map(|at| rounded(random, at)),
    };
    [a, b]
}

/// Whether lavapipe drops a line that is wide enough to be seen: one that near or far plane cut, with both ends beyond
/// one side of the viewport.
fn is_dropped([a, b]: [[f32; 4]; 2]) -> bool {
    let is_cut = |[_, _, z, w]: [f32; 4]| z < 0.0 || z > w;
    let beyond = |[x, y, _, w]: [f32; 4]| [x > w, x < -w, y > w, y < -w];
    let sides = beyond(a).into_iter().zip(beyond(b));
    (is_cut(a) || is_cut(b)) && sides.into_iter().any(|(a, b)| a && b)
}

/// Lines, each of one colour. If `cut`, some reach beyond near and far plane, or behind the eye.
fn lines(random: &mut Random, count: usize, cut: bool) -> Vec<Corner> {
    let line = |number| {
        let ends = ends(random);
        let mut corners = ends.map(|end| clip(end, random.unit(), some_w(random)));
        if cut && random.below(3) == 0 {
            let behind = random.below(3) == 0;
            corners = ends.map(|end| match behind {
                true => {
                    let w = 2.0 * random.unit() - 0.5;
                    let [x, y, ..] = clip(end, 0.0, w.abs());
                    [x, y, 1.1 * w - 0.11, w]
                }
                false => clip(end, 2.0 * random.unit() - 0.5, some_w(random)),
            });
        }
        if is_dropped(corners) {
            corners = ends.map(|end| clip(end, 0.5, 1.0));
        }
        corners.map(|place| Corner { place, tint: tint(number), size: 1.0 })
    };
    (0..count).map(line).collect::<Vec<_>>().into_iter().flatten().collect()
}

/// A rectangle of whole pixels that overlaps the target.
fn some_viewport(random: &mut Random) -> Viewport {
    let [x, y] = [(); 2].map(|()| random.below(41) as f32 - 20.0);
    let [width, height] = [(); 2].map(|()| 24.0 + random.below(70) as f32);
    Viewport { x, y, width, height, min_depth: 0.0, max_depth: 1.0 }
}

fn some_scissor(random: &mut Random) -> Rect {
    let [x, y] = [(); 2].map(|()| random.below(40) as u32);
    let [width, height] = [(); 2].map(|()| 4 + random.below(50) as u32);
    Rect { x, y, width, height }
}
