//! Do we draw what the device's own pipeline draws? The same pass by compute and by classic.

use crate::{
    colors,
    common::{gpu, on_each_gpu, random::Random},
    twin::{VERTEX, difference, random_pass, shaders},
};
use std::sync::Arc;
use tilewright::{
    classic,
    compare::{self, Difference, Drawn, Limits},
    compute,
    format::Format,
    image::{Extent, Picture, half_to_f32},
    pass::{BufferRange, BufferSource, Draw, Executor, Pass, Pipeline},
    scene::{PassOptions, Scene},
    shader::{Shader, Stage},
    state::{Blend, BlendEquation, BlendFactor, BlendOp, Compare, Cull, DepthState, Topology},
    target::{ColorTarget, DepthTarget},
    vk::Gpu,
};

/// All that may remain between the two executors on lavapipe, measured on 25.0.7, with the reason.
///
/// | what | measured | allowed | why it is there |
/// |---|---|---|---|
/// | coverage, winner | 0 | 0 | fixed point decides the one; depths nearly equal by chance, the other |
/// | colour over 1 of 255 | 0, but 1 pixel of the knot at 16384x256 | 0, 1 | interpolation leaves the last bits free, and shading a smooth metal magnifies them |
/// | depth of the scenes | 6.6e-7 | 1e-6 | the vertices that clipping makes are rounded as each side likes; 0 without them |
/// | 8-bit formats | 1 step | 1 | either may round to the neighbouring value |
/// | 8-bit formats, blended | 2 steps | 2 | so may each layer, and lavapipe computes layers in 8 bits |
/// | half float, blended | 0.5 steps | 0.5 | one unit in the last place of a half from 2 to 4, where subtracting leads |
///
/// Another device is held to the limits that `tilewright parity` has for all ([`Limits`]).
pub mod remains {
    use super::{Difference, Format, Gpu, Limits};

    /// Steps of 1/255 in an 8-bit format.
    pub const STEPS: f32 = 1.0;

    /// Steps of 1/255 where several layers are blended.
    pub fn blended_steps(format: Format) -> f32 {
        if format == Format::Rgba16Float { 0.5 } else { 2.0 }
    }

    /// What a drawing of a scene may differ by, `colour_over_1` pixels of it in colour.
    pub fn limits(gpu: &Gpu, found: &Difference, colour_over_1: u64) -> Limits {
        if !gpu.info().name.contains("llvmpipe") {
            return Limits::new(found.pixels, true);
        }
        Limits { coverage_differing: 0, winner_differing: 0, colour_over_1, depth_max: 1e-6 }
    }
}

/// All factors but those of a second source, which take another shader.
pub const FACTORS: &[BlendFactor] = BlendFactor::ALL.split_at(15).0;
pub const OPS: [BlendOp; 5] =
    [BlendOp::Add, BlendOp::Subtract, BlendOp::ReverseSubtract, BlendOp::Min, BlendOp::Max];

pub fn scene_pass(scene: &Scene, extent: Extent, format: Format) -> Pass {
    let camera = scene.default_camera(extent);
    scene
        .pass(extent, &camera, &PassOptions { format, ..PassOptions::default() })
        .expect("a built-in scene makes a valid pass")
}

/// How the two executors' drawings of `pass` differ.
pub fn differences(gpu: &Gpu, pass: &Pass) -> Difference {
    let ids = compare::id_pass(pass).expect("an id pass");
    let mut compute = compute::Renderer::new(gpu).expect("a compute renderer");
    let (a, a_ids) = (compute.render(pass).unwrap(), compute.render(&ids.pass).unwrap());
    let mut classic = classic::Renderer::new(gpu).expect("a classic renderer");
    let (b, b_ids) = (classic.render(pass).unwrap(), classic.render(&ids.pass).unwrap());
    let drawn = (Drawn { frame: &a, ids: &a_ids }, Drawn { frame: &b, ids: &b_ids });
    compare::compare(drawn.0, drawn.1).expect("comparable frames")
}

#[test]
fn built_in_scenes() {
    let gpu = gpu();
    for name in Scene::builtin_names() {
        let scene = Scene::builtin(name).expect("it is built in");
        let extent = Extent::new(320, 200);
        let found = differences(&gpu, &scene_pass(&scene, extent, Format::Rgba16Float));
        let limits = remains::limits(&gpu, &found, 0);
        assert!(limits.allow(&found), "{name}: {found:?} against {limits:?}");
        // What the device's fixed function adds on the way into 8 bits.
        for format in [Format::Rgba8Srgb, Format::Rgba8Unorm] {
            let pass = scene_pass(&scene, extent, format);
            let blends =
                pass.pipelines.iter().any(|pipeline| pipeline.color_state(0).blend.is_some());
            let allowed = if blends { remains::blended_steps(format) } else { remains::STEPS };
            let steps = largest_step(&gpu, &pass);
            assert!(steps <= allowed, "{name}, {format:?}: {steps} of 255, {allowed} at most");
        }
    }
}

#[test]
fn sizes_that_are_no_multiple_of_a_bin_and_the_largest() {
    let gpu = gpu();
    let sizes = [
        ("torus-knot", 1, 1, 0),
        ("torus-knot", 17, 13, 0),
        ("torus-knot", 1921, 1079, 0),
        ("torus-knot", 16384, 256, 1),
        // Several bands, and little to shade.
        ("triangle", 8192, 8192, 0),
    ];
    for (name, width, height, colour_over_1) in sizes {
        let scene = Scene::builtin(name).expect("it is built in");
        let extent = Extent::new(width, height);
        let found = differences(&gpu, &scene_pass(&scene, extent, Format::Rgba16Float));
        let limits = remains::limits(&gpu, &found, colour_over_1);
        assert!(limits.allow(&found), "{extent}: {found:?} against {limits:?}");
    }
}

/// Overlapping triangles inside the viewport, in no order of depth.
pub fn overlapping(pipeline: &Pipeline, format: Format, seed: u64) -> Pass {
    let mut random = Random::new(seed);
    let positions: Vec<[f32; 4]> = (0..60)
        .map(|_| [random.signed() * 0.99, random.signed() * 0.99, random.unit(), 1.0])
        .collect();
    let bytes = bytemuck::cast_slice(&positions).to_vec();
    let buffer = Arc::new(BufferSource::new("triangles", bytes));
    let mut draw = Draw::new(0, positions.len() as u32);
    draw.vertex_buffers = vec![BufferRange::whole(&buffer)];
    draw.blend_constants = [0.3, 0.6, 0.9, 0.45];
    Pass::new("overlapping", Extent::new(150, 100))
        .colors([ColorTarget::cleared(format, [0.25, 0.5, 0.75, 0.5])])
        .depth(DepthTarget::cleared(0.5))
        .pipelines([Arc::new(pipeline.clone())])
        .draws([draw])
}

/// The largest difference of a channel between the two executors' colours, in steps of 1/255.
pub fn largest_step(gpu: &Gpu, pass: &Pass) -> f32 {
    let a = compute::Renderer::new(gpu).unwrap().render(pass).unwrap();
    let b = classic::Renderer::new(gpu).unwrap().render(pass).unwrap();
    let channels = |picture: &Picture| -> Vec<f32> {
        match picture.format {
            Format::Rgba16Float => (picture.bytes.chunks(2))
                .map(|h| half_to_f32(u16::from_le_bytes([h[0], h[1]])) * 255.0)
                .collect(),
            _ => picture.bytes.iter().map(|&b| f32::from(b)).collect(),
        }
    };
    assert_eq!((a.colors.len(), b.colors.len()), (pass.colors.len(), pass.colors.len()));
    let targets = a.colors.iter().zip(&b.colors);
    let steps = |(a, b)| {
        let both = channels(a).into_iter().zip(channels(b));
        both.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    targets.map(steps).fold(0.0, f32::max)
}

/// Vulkan lets a shader write where no target is, and the size of points that it does not draw.
#[test]
fn outputs_without_a_target_and_point_sizes_change_nothing() {
    on_each_gpu("outputs without a target and point sizes change nothing", |gpu| {
        let body = |more: &str, writes: &str| {
            format!(
                "#version 450
                 layout(location = 0) in vec4 color;
                 layout(location = 0) out vec4 target;
                 {more}
                 void main() {{ target = color; {writes} }}"
            )
        };
        let plain = (*random_pass(0, &shaders()).pipelines[0]).clone();
        let more = body(
            "layout(location = 1) out vec4 a; layout(location = 2) out uvec2 b;
             layout(location = 3) out float c;",
            "a = 1.0 - color; b = uvec2(7); c = 0.5;",
        );
        let sized = VERTEX
            .replace("gl_Position = position;", "gl_Position = position; gl_PointSize = 9.0;");
        let shader =
            |stage, source: &str| Arc::new(Shader::from_glsl(stage, "extra", source).unwrap());
        let extra = plain
            .clone()
            .vertex(shader(Stage::Vertex, &sized))
            .fragment(shader(Stage::Fragment, &more));
        let pictures = [plain, extra].map(|pipeline| {
            let pipeline =
                pipeline.topology(Topology::TriangleList).depth(DepthState::LESS).blend(None);
            let pass = overlapping(&pipeline, Format::Rgba8Unorm, 3);
            let mut compute = compute::Renderer::new(gpu).unwrap();
            let mut classic = classic::Renderer::new(gpu).unwrap();
            [compute.render(&pass).unwrap(), classic.render(&pass).unwrap()]
                .map(|frame| frame.into_color().unwrap())
        });
        assert!(pictures[0] == pictures[1]);
        assert!(pictures[0][0].bytes.chunks(4).any(|texel| texel != &pictures[0][0].bytes[..4]));
    });
}

#[test]
fn every_blend_equation_in_api_order() {
    let gpu = gpu();
    let (plain, constant) = FACTORS.split_at(10);
    for (n, op) in OPS.into_iter().cycle().take(20).enumerate() {
        let color = BlendEquation { src: plain[n % 10], dst: plain[(n * 7 + 3) % 10], op };
        let alpha = BlendEquation { src: plain[(n * 3 + 1) % 10], dst: plain[n * 9 % 10], op };
        for format in [Format::Rgba8Unorm, Format::Rgba16Float] {
            let pass = blended_layers(Blend { color, alpha }, format, n as u64);
            let (steps, allowed) = (largest_step(&gpu, &pass), remains::blended_steps(format));
            assert!(
                steps <= allowed,
                "{color:?}, {alpha:?}, {format:?}: {steps} of 255, {allowed} at most"
            );
        }
    }
    // No layer makes an error of the layers below it larger.
    let tame = [0, 1, 2, 3, 6, 7].map(|n| plain[n]);
    for (n, op) in OPS.into_iter().cycle().take(25).enumerate() {
        let (new, other) = (constant[n % 5], tame[(n * 7 + 3) % 6]);
        let (src, dst) = if n % 2 == 0 { (new, other) } else { (other, new) };
        let color = BlendEquation { src, dst, op };
        let alpha = BlendEquation { src: constant[(n + 1) % 5], dst: tame[n * 5 % 6], op };
        let pass = blended_layers(Blend { color, alpha }, Format::Rgba16Float, n as u64);
        let a = compute::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
        let b = classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
        let found = colors::difference(&a.colors[0], &b.colors[0]);
        assert!(found.is_none(), "{color:?}, {alpha:?}: {found:?}");
        // Lavapipe rounds constants to 8 bits too, in each layer.
        let pass = blended_layers(Blend { color, alpha }, Format::Rgba8Unorm, n as u64);
        let allowed = remains::blended_steps(Format::Rgba8Unorm) + 2.0;
        let steps = largest_step(&gpu, &pass);
        assert!(steps <= allowed, "{color:?}, {alpha:?}: {steps} of 255, {allowed} at most");
    }
}

fn blended_layers(blend: Blend, format: Format, seed: u64) -> Pass {
    let template = (*random_pass(0, &shaders()).pipelines[0]).clone();
    let pipeline = template
        .topology(Topology::TriangleList)
        .cull(Cull::None)
        .depth(DepthState::OFF)
        .blend(blend);
    overlapping(&pipeline, format, seed)
}

#[test]
fn every_depth_comparison() {
    let gpu = gpu();
    let template = (*random_pass(0, &shaders()).pipelines[0]).clone();
    let compares = [
        Compare::Never,
        Compare::Less,
        Compare::Equal,
        Compare::LessOrEqual,
        Compare::Greater,
        Compare::NotEqual,
        Compare::GreaterOrEqual,
        Compare::Always,
    ];
    for compare in compares {
        let cases = [(true, true), (true, false), (false, true)];
        for (n, (test, write)) in cases.into_iter().chain(cases).enumerate() {
            // The second time, only pixels of some depths change.
            // Lavapipe has no such test; the reference has.
            let bounds = n >= cases.len();
            let pipeline = template
                .clone()
                .topology(Topology::TriangleList)
                .cull(Cull::None)
                .depth(DepthState::new(compare).test(test).write(write).bounds(bounds))
                .blend(None);
            let mut pass = overlapping(&pipeline, Format::Rgba8Unorm, 7);
            pass.draws[0].depth_bounds = [0.3, 0.6];
            if !bounds {
                let steps = largest_step(&gpu, &pass);
                assert!(
                    steps <= remains::STEPS,
                    "{compare:?}, test {test}, write {write}: {steps}"
                );
            }
            let mut renderer = compute::Renderer::new(&gpu).unwrap();
            let found = difference(&mut renderer, &pass, &mut 0);
            assert_eq!(found, None, "{compare:?}, test {test}, write {write}, bounds {bounds}");
        }
    }
}
