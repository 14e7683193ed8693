//! Do we draw what the device's own pipeline draws? The same pass by compute and by classic.

use crate::{
    common::{gpu, random::Random},
    twin::{difference, random_pass, shaders},
};
use std::sync::Arc;
use tilewright::{
    classic,
    compare::{self, Difference, Drawn, Limits},
    compute,
    format::Format,
    image::Extent,
    pass::{Buffer, BufferRange, Draw, Executor, Pass, Pipeline},
    scene::{PassOptions, Scene},
    state::{Blend, BlendEquation, BlendFactor, BlendOp, Compare, Cull, DepthState, Topology},
    target::{ColorTarget, DepthTarget},
    vk::Gpu,
};

fn scene_pass(scene: &Scene, extent: Extent, format: Format) -> Pass {
    let camera = scene.default_camera(extent);
    scene
        .pass(extent, &camera, &PassOptions { format, ..PassOptions::default() })
        .expect("a built-in scene makes a valid pass")
}

/// How the two executors' drawings of `pass` differ.
fn differences(gpu: &Gpu, pass: &Pass) -> Difference {
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
        // Whether triangles cross the border decides the limits; a camera may be inside.
        let limits = Limits::new(found.pixels, name != "soup");
        assert!(limits.allow(&found), "{name}: {found:?} against {limits:?}");
        // Lavapipe's encoding to sRGB is off by up to 2 of 255, and it blends 8-bit targets in 8
        // bits: what its fixed function adds to the differences above.
        for format in [Format::Rgba8Srgb, Format::Rgba8Unorm] {
            let pass = scene_pass(&scene, extent, format);
            assert_eq!(colours_over(&gpu, &pass, 3.0), 0, "{name}, {format:?}");
        }
    }
}

#[test]
fn sizes_that_are_no_multiple_of_a_bin_and_the_largest() {
    let gpu = gpu();
    let sizes = [
        ("torus-knot", 1, 1),
        ("torus-knot", 17, 13),
        ("torus-knot", 1921, 1079),
        ("torus-knot", 16384, 256),
        // Several bands, and little to shade.
        ("triangle", 8192, 8192),
    ];
    for (name, width, height) in sizes {
        let scene = Scene::builtin(name).expect("it is built in");
        let extent = Extent::new(width, height);
        let found = differences(&gpu, &scene_pass(&scene, extent, Format::Rgba16Float));
        let limits = Limits::new(found.pixels, true);
        assert!(limits.allow(&found), "{extent}: {found:?} against {limits:?}");
    }
}

/// Overlapping triangles inside the viewport, in no order of depth.
fn overlapping(pipeline: &Pipeline, format: Format, seed: u64) -> Pass {
    let mut random = Random::new(seed);
    let positions: Vec<[f32; 4]> = (0..60)
        .map(|_| [random.signed() * 0.99, random.signed() * 0.99, random.unit(), 1.0])
        .collect();
    let bytes = bytemuck::cast_slice(&positions).to_vec();
    let buffer = Arc::new(Buffer { label: "triangles".into(), bytes });
    let mut draw = Draw::new(0, positions.len() as u32);
    draw.vertex_buffers = vec![BufferRange::whole(&buffer)];
    Pass {
        label: "overlapping".into(),
        extent: Extent::new(150, 100),
        color: ColorTarget { format, clear: [0.25, 0.5, 0.75, 0.5] },
        depth: Some(DepthTarget { clear: 0.5 }),
        pipelines: vec![Arc::new(pipeline.clone())],
        draws: vec![draw],
    }
}

/// Pixels of which a channel of the two executors' colours differs by more than `steps` of 255.
fn colours_over(gpu: &Gpu, pass: &Pass, steps: f32) -> usize {
    let a = compute::Renderer::new(gpu).unwrap().render(pass).unwrap();
    let b = classic::Renderer::new(gpu).unwrap().render(pass).unwrap();
    let texel = pass.color.format.texel_bytes();
    let channel = |bytes: &[u8]| -> Vec<f32> {
        match texel {
            8 => bytes.chunks(2).map(|h| half(u16::from_le_bytes([h[0], h[1]])) * 255.0).collect(),
            _ => bytes.iter().map(|&b| f32::from(b)).collect(),
        }
    };
    let differs = |(a, b): (&[u8], &[u8])| {
        channel(a).iter().zip(channel(b)).any(|(a, b)| (a - b).abs() > steps)
    };
    a.color.bytes.chunks(texel).zip(b.color.bytes.chunks(texel)).filter(|&p| differs(p)).count()
}

/// A half float's value.
fn half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023) / 1024.0);
    sign * match exponent {
        0 => fraction * 2f32.powi(-14),
        e => (1.0 + fraction) * 2f32.powi(e - 15),
    }
}

#[test]
fn every_blend_equation_in_api_order() {
    use BlendFactor::*;
    let gpu = gpu();
    let template = (*random_pass(0, &shaders()).pipelines[0]).clone();
    let factors = [
        Zero,
        One,
        SrcColor,
        OneMinusSrcColor,
        DstColor,
        OneMinusDstColor,
        SrcAlpha,
        OneMinusSrcAlpha,
        DstAlpha,
        OneMinusDstAlpha,
    ];
    let ops =
        [BlendOp::Add, BlendOp::Subtract, BlendOp::ReverseSubtract, BlendOp::Min, BlendOp::Max];
    for (n, op) in ops.into_iter().cycle().take(20).enumerate() {
        let color = BlendEquation { src: factors[n % 10], dst: factors[(n * 7 + 3) % 10], op };
        let alpha = BlendEquation { src: factors[(n * 3 + 1) % 10], dst: factors[n * 9 % 10], op };
        let pipeline = Pipeline {
            topology: Topology::TriangleList,
            cull: Cull::None,
            depth: DepthState::OFF,
            blend: Some(Blend { color, alpha }),
            ..template.clone()
        };
        for format in [Format::Rgba8Unorm, Format::Rgba16Float] {
            let pass = overlapping(&pipeline, format, n as u64);
            // A layer may round to the neighbouring value, and up to 20 of them lie on each other.
            let over = colours_over(&gpu, &pass, 4.0);
            assert_eq!(over, 0, "{color:?}, {alpha:?}, {format:?}: pixels over 4 of 255");
        }
    }
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
        for (test, write) in [(true, true), (true, false), (false, true)] {
            let pipeline = Pipeline {
                topology: Topology::TriangleList,
                cull: Cull::None,
                depth: DepthState { test, write, compare },
                blend: None,
                ..template.clone()
            };
            let pass = overlapping(&pipeline, Format::Rgba8Unorm, 7);
            let over = colours_over(&gpu, &pass, 1.0);
            assert_eq!(over, 0, "{compare:?}, test {test}, write {write}: differing pixels");
            let mut renderer = compute::Renderer::new(&gpu).unwrap();
            let found = difference(&mut renderer, &pass, &mut 0);
            assert_eq!(found, None, "{compare:?}, test {test}, write {write}");
        }
    }
}
