//! Are depths clamped, and primitives clipped, as Vulkan does?

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    parity::remains,
};
use std::sync::Arc;
use tilewright::{
    Frame, classic,
    compare::{self, Limits},
    compute,
    format::{Format, VertexFormat},
    image::Extent,
    pass::{BufferRange, Draw, Executor, Pass, Pipeline, VertexAttribute, VertexBinding},
    shader::{Shader, Stage},
    state::{Blend, Compare, DepthBias, DepthState, Rect, Viewport},
    target::{ColorTarget, DepthTarget},
};

const VERTEX: &str = "#version 450
    layout(location = 0) in vec4 corner;
    layout(location = 0) out vec4 color;
    void main() { gl_Position = corner; color = vec4(fract(corner.xyz * 7.0), 0.5); }";

/// The depth that the shader sees, in a float target.
const FRAGMENT: &str = "#version 450
    layout(location = 0) in vec4 color;
    layout(location = 0) out vec4 written;
    void main() { written = vec4(gl_FragCoord.z, color.yz, 1.0); }";

const WRITES_DEPTH: &str = "#version 450
    layout(location = 0) in vec4 color;
    layout(location = 0) out vec4 written;
    void main() { written = color; gl_FragDepth = gl_FragCoord.x / 32.0 - 0.5; }";

fn pipeline(fragment: &str) -> Pipeline {
    let shader = |stage, text| Shader::from_glsl(stage, "clamp", text).unwrap();
    Pipeline::new("clamp", shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, fragment))
        .vertex_bindings([VertexBinding::per_vertex(16)])
        .vertex_attributes([VertexAttribute::new(0, 0, VertexFormat::F32X4, 0)])
}

/// Triangles of these corners in clip space. The viewport has these depths at the near and the far plane.
fn pass(pipeline: Pipeline, corners: &[[f32; 4]], [near, far]: [f32; 2]) -> Pass {
    let range = BufferRange::host("corners", bytemuck::cast_slice(corners).to_vec());
    let extent = Extent::new(64, 64);
    let whole =
        Viewport { x: 0.0, y: 0.0, width: 64.0, height: 64.0, min_depth: near, max_depth: far };
    Pass::new("clamped", extent)
        .colors([ColorTarget::cleared(Format::Rgba32Float, [0.0; 4])])
        .depth(DepthTarget::cleared(1.0))
        .pipelines([Arc::new(pipeline)])
        .draws([Draw::new(0, corners.len() as u32).vertex_buffers([range]).viewport(whole)])
}

/// A square over everything whose depth is `left` and `right` at the sides.
fn square(left: f32, right: f32) -> [[f32; 4]; 6] {
    let (a, b) = ([-1.0, -1.0, left, 1.0], [1.0, -1.0, right, 1.0]);
    let (c, d) = ([-1.0, 1.0, left, 1.0], [1.0, 1.0, right, 1.0]);
    [a, b, c, c, b, d]
}

/// Depths of a row, and what the shader saw of them.
fn row(frame: &Frame) -> Vec<[f32; 2]> {
    let depths = frame.depth.as_ref().unwrap().depths();
    let values: Vec<_> = frame.colors[0].values().collect();
    (0..64).map(|x| [depths[x], values[x][0]]).collect()
}

/// Across a square whose depth goes from -0.5 to 1.5: what is clipped stays as it was, what is not clipped is clamped to the
/// viewport's depths, and the shader sees the depth as it is.
#[test]
fn what_is_clipped_is_not_there_and_what_is_clamped_ends_at_the_limits() {
    on_each_gpu("what is clipped is not there and what is clamped ends at the limits", |gpu| {
        type Draws = Box<dyn FnMut(&Pass) -> Frame>;
        let mut executors: Vec<(&str, Draws)> = Vec::new();
        let mut compute = compute::Renderer::new(gpu).unwrap();
        executors.push(("compute", Box::new(move |pass| compute.render(pass).unwrap())));
        if gpu.has_graphics() {
            let mut classic = classic::Renderer::new(gpu).unwrap();
            executors.push(("classic", Box::new(move |pass| classic.render(pass).unwrap())));
        }
        for (name, draw) in &mut executors {
            for [near, far] in [[0.0, 1.0], [0.25, 0.75], [0.75, 0.25]] {
                for (clamp, clip) in [(false, None), (true, None), (true, Some(true))] {
                    // Opaque work: nothing is farther than what the target is cleared to.
                    let nearer = DepthState::new(Compare::LessOrEqual);
                    let pipeline =
                        pipeline(FRAGMENT).depth(nearer).depth_clamp(clamp).depth_clip(clip);
                    let frame = draw(&pass(pipeline, &square(-0.5, 1.5), [near, far]));
                    for (x, [depth, seen]) in row(&frame).into_iter().enumerate() {
                        let along = (x as f32 + 0.5) / 32.0 - 0.5;
                        let free = near + (far - near) * along;
                        let what =
                            format!("{name} {near}..{far} {clamp} {clip:?}, {x}: {depth} {seen}");
                        if clip.unwrap_or(!clamp) && !(0.0..=1.0).contains(&along) {
                            assert_eq!([depth, seen], [1.0, 0.0], "{what}");
                            continue;
                        }
                        let limited = free.clamp(near.min(far), near.max(far));
                        assert!(
                            (depth - limited).abs() < 1e-6 && (seen - free).abs() < 1e-6,
                            "{what}"
                        );
                    }
                }
            }
        }
    });
}

/// The depth that a shader writes is clamped too, and so is a biased one.
#[test]
fn depths_of_shaders_and_biased_ones_are_clamped() {
    on_each_gpu("depths of shaders and biased ones are clamped", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for blend in [None, Some(Blend::ALPHA)] {
            for clamp in [false, true] {
                let state = |fragment: &str| {
                    let always = DepthState::new(Compare::Always);
                    pipeline(fragment)
                        .depth(always)
                        .depth_clamp(clamp)
                        .depth_clip(true)
                        .blend(blend)
                };
                let limits = if clamp { [0.25, 0.75] } else { [0.0, 1.0] };
                let frame = compute
                    .render(&pass(state(WRITES_DEPTH), &square(0.5, 0.5), [0.25, 0.75]))
                    .unwrap();
                for (x, [depth, _]) in row(&frame).into_iter().enumerate() {
                    let written = (x as f32 + 0.5) / 32.0 - 0.5;
                    assert_eq!(depth, written.clamp(limits[0], limits[1]), "{clamp} {blend:?} {x}");
                }
                let mut biased = pass(state(FRAGMENT), &square(0.5, 0.5), [0.25, 0.75]);
                biased.draws[0].depth_bias = Some(DepthBias::new(2f32.powi(23), 0.0));
                let frame = compute.render(&biased).unwrap();
                for [depth, seen] in row(&frame) {
                    assert_eq!([depth, seen], [limits[1], 1.0], "{clamp} {blend:?}");
                }
            }
        }
    });
}

/// The depth may differ by so much: the depth of slivers changes by almost 1 from pixel to pixel, and clipping rounds their
/// corners as each side likes. 1.3e-5 was measured.
const DEPTH_MAX: f32 = 3e-5;

/// Triangles that reach beyond the near and the far plane.
#[test]
fn the_picture_is_the_devices_own() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    for seed in 9700..9748 {
        let mut random = Random::new(seed);
        let corners: Vec<_> = (0..60)
            .map(|_| {
                let w = 0.5 + random.unit() * 2.0;
                let z = random.signed() * 1.5 + 0.5;
                [random.signed() * w, random.signed() * w, z * w, w]
            })
            .collect();
        let compare = [Compare::Less, Compare::LessOrEqual][random.below(2)];
        let clip = [None, Some(false), Some(true)][random.below(3)];
        let clamp = clip != Some(false) || random.below(2) == 0;
        let depths = [[0.0, 1.0], [0.2, 0.9], [0.9, 0.2]][random.below(3)];
        let pipeline = pipeline(FRAGMENT)
            .depth(DepthState::new(compare))
            .depth_clamp(clamp)
            .depth_clip(clip)
            .blend((random.below(4) == 0).then_some(Blend::ALPHA));
        let mut pass = pass(pipeline, &corners, depths);
        pass.colors = vec![ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])];
        let both = compare::Both::draw(&mut compute, &mut classic, &pass, |_| {}).unwrap();
        let found = both.difference;
        let limits = Limits { depth_max: DEPTH_MAX, ..remains::limits(&gpu, &found, 0) };
        assert!(limits.allow(&found), "seed {seed}, {clip:?}: {found:?} against {limits:?}");
    }
}

/// Depths may be as far out as floats reach: they end at the limits.
#[test]
fn depths_far_beyond_the_planes_end_at_the_limits() {
    on_each_gpu("depths far beyond the planes end at the limits", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for far in [1e6, 1e21, 1e30, 3e37] {
            let always = DepthState::new(Compare::Always);
            let pipeline = pipeline(FRAGMENT).depth(always).depth_clamp(true);
            let frame = compute.render(&pass(pipeline, &square(0.5, far), [0.0, 1.0])).unwrap();
            for (x, [depth, _]) in row(&frame).into_iter().enumerate() {
                assert_eq!(depth, 1.0, "{far}, {x}");
            }
        }
    });
}

/// What a shader sees of a depth does not depend on other draws.
#[test]
fn a_draw_beside_another_sees_the_same_depth() {
    on_each_gpu("a draw beside another sees the same depth", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        // A depth that rounding leaves a little below 0 at the left.
        let corners = square(0.0, 1.0).map(|[x, y, z, w]| [x * 3.0, y * 3.0, z * 3.0, w * 3.0]);
        let one =
            pass(pipeline(FRAGMENT).depth(DepthState::new(Compare::Less)), &corners, [0.0, 1.0]);
        let mut two = one.clone();
        // It is drawn outside the scissor.
        let mut other = two.draws[0].clone().depth_bias(DepthBias::new(1.0, 1.0));
        other.scissor = Some(Rect { x: 63, y: 63, width: 1, height: 1 });
        two.draws.push(other);
        let [one, two] = [one, two].map(|pass| row(&compute.render(&pass).unwrap()));
        assert_eq!(one, two);
    });
}
