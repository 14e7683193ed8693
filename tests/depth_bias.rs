//! Is the depth bias the one of Vulkan?

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    parity::{self, remains},
    twin,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compare, compute,
    format::Format,
    image::Extent,
    pass::{BufferRange, Draw, Pass},
    state::{Compare, Cull, DepthBias, DepthState, Topology},
    target::{ColorTarget, DepthTarget},
    vk::Gpu,
};

/// A pass of triangles of these corners in clip space, with the biases `biases`, one draw each.
fn pass(corners: &[[f32; 4]], compare: Compare, biases: &[Option<DepthBias>]) -> Pass {
    let pipeline = (*twin::random_pass(0, &twin::shaders()).pipelines[0]).clone();
    let pipeline = pipeline
        .topology(Topology::TriangleList)
        .cull(Cull::None)
        .depth(DepthState::new(compare))
        .blend(None);
    let range = BufferRange::host("corners", bytemuck::cast_slice(corners).to_vec());
    let draw = |bias: &Option<DepthBias>| {
        Draw::new(0, corners.len() as u32).vertex_buffers([range.clone()]).depth_bias(*bias)
    };
    Pass::new("biased", Extent::new(64, 64))
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .depth(DepthTarget::cleared(0.0))
        .pipelines([Arc::new(pipeline)])
        .draws(biases.iter().map(draw).collect::<Vec<_>>())
}

/// Depths, row by row, of a square over everything whose depth is `left` and `right` at the sides.
fn depths(gpu: &Gpu, left: f32, right: f32, bias: DepthBias) -> Vec<f32> {
    let (a, b) = ([-1.0, -1.0, left, 1.0], [1.0, -1.0, right, 1.0]);
    let (c, d) = ([-1.0, 1.0, left, 1.0], [1.0, 1.0, right, 1.0]);
    let pass = pass(&[a, b, c, c, b, d], Compare::Greater, &[Some(bias)]);
    compute::Renderer::new(gpu).unwrap().render(&pass).unwrap().depth.unwrap().depths()
}

#[test]
fn the_constant_counts_least_steps() {
    on_each_gpu("the constant counts least steps", |gpu| {
        for (depth, step) in
            [(0.5f32, 2f32.powi(-24)), (0.75, 2f32.powi(-24)), (0.3, 2f32.powi(-25))]
        {
            for constant in [1.0f32, 5.0, -7.0, 1000.0] {
                let expected = depth + constant * step;
                let found = depths(gpu, depth, depth, DepthBias::new(constant, 0.0));
                assert!(found.iter().all(|d| *d == expected), "{depth}, {constant}: {}", found[0]);
            }
        }
        // The step is that of the largest depth of the triangle.
        let found = depths(gpu, 0.125, 0.625, DepthBias::new(1024.0, 0.0));
        let plain = depths(gpu, 0.125, 0.625, DepthBias::new(0.0, 0.0));
        for (found, plain) in found.iter().zip(plain) {
            assert!((found - plain - 2f32.powi(-14)).abs() < 2f32.powi(-23), "{found} {plain}");
        }
    });
}

#[test]
fn the_slope_counts_changes_from_pixel_to_pixel() {
    on_each_gpu("the slope counts changes from pixel to pixel", |gpu| {
        // 1/128 from pixel to pixel.
        let plain = depths(gpu, 0.25, 0.75, DepthBias::new(0.0, 0.0));
        for slope in [1.0, 2.0, -4.0] {
            let found = depths(gpu, 0.25, 0.75, DepthBias::new(0.0, slope));
            for (found, plain) in found.iter().zip(&plain) {
                assert_eq!(found - plain, slope / 128.0);
            }
        }
    });
}

#[test]
fn the_clamp_limits_the_sum() {
    on_each_gpu("the clamp limits the sum", |gpu| {
        for (slope, clamp, added) in [
            (4.0, 1.0 / 64.0, 1.0 / 64.0),
            (4.0, 1.0, 4.0 / 128.0),
            (4.0, -1.0 / 64.0, 4.0 / 128.0),
            (-4.0, -1.0 / 64.0, -1.0 / 64.0),
            (-4.0, 1.0 / 64.0, -4.0 / 128.0),
        ] {
            let plain = depths(gpu, 0.25, 0.75, DepthBias::new(0.0, 0.0));
            let found = depths(gpu, 0.25, 0.75, DepthBias::new(0.0, slope).clamp(clamp));
            for (found, plain) in found.iter().zip(plain) {
                assert_eq!(found - plain, added, "{slope}, {clamp}");
            }
        }
        // Beyond all depths there are no others.
        for constant in [1e38, -1e38] {
            let found = depths(gpu, 0.25, 0.75, DepthBias::new(constant, 0.0));
            assert!(found.iter().all(|d| *d == if constant > 0.0 { 1.0 } else { 0.0 }));
        }
    });
}

/// Surfaces that are drawn again over themselves, with and without a bias: which of them shows is decided by the last bits
/// of depth.
#[test]
fn the_winner_among_surfaces_is_the_devices_own() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    for seed in 0..32 {
        let mut random = Random::new(9100 + seed);
        let corners: Vec<_> = (0..30)
            .map(|_| [random.signed() * 0.99, random.signed() * 0.99, random.unit(), 1.0])
            .collect();
        let compare = [Compare::Greater, Compare::GreaterOrEqual][random.below(2)];
        let mut bias = || {
            let factor = [0.0, 1.0, -1.0, 4.0, -2.5];
            let bias = DepthBias::new(factor[random.below(5)], factor[random.below(5)]);
            (random.below(4) > 0).then_some(bias.clamp([0.0, 0.001, -0.001][random.below(3)]))
        };
        let biases = [None, bias(), bias(), bias()];
        let pass = pass(&corners, compare, &biases);
        let both = compare::Both::draw(&mut compute, &mut classic, &pass, |_| {}).unwrap();
        let (found, limits) = (both.difference, remains::limits(&gpu, &both.difference, 0));
        assert!(limits.allow(&found), "seed {seed}, {biases:?}: {found:?} against {limits:?}");
        assert!(parity::largest_step(&gpu, &pass) <= remains::STEPS, "seed {seed}");
    }
}

#[test]
fn a_bias_that_is_no_number_is_refused() {
    let gpu = gpu();
    let corners = [[0.0, 0.0, 0.5, 1.0]; 3];
    for bias in [DepthBias::new(f32::NAN, 0.0), DepthBias::new(0.0, f32::INFINITY)] {
        let pass = pass(&corners, Compare::Less, &[Some(bias)]);
        match compute::Renderer::new(&gpu).unwrap().render(&pass) {
            Err(Error::Usage(text)) => assert!(text.contains("depth bias"), "{text}"),
            other => panic!("{other:?}"),
        }
    }
}
