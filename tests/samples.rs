//! Do pixels have several samples as Vulkan says: coverage, depth and colour of each, and what becomes of them?

use crate::{
    common::{
        gpu,
        mesh::{Corner, FRAGMENT, VERTEX, draw, pipeline},
        on_each_gpu,
        random::Random,
    },
    targets,
};
use std::sync::Arc;
use tilewright::{
    Error, Frame, Picture, Samples, classic, compute,
    format::Format,
    image::Extent,
    pass::{BufferRange, Draw, Executor, Pass, Pipeline},
    shader::{Shader, Stage},
    state::{Blend, Compare, DepthState, ResolveMode, Viewport},
    target::{ColorTarget, DepthTarget, LoadOp, StoreOp},
    vk::Gpu,
};

mod resolved;
mod several;
mod shading;

const SIDE: u32 = 48;

const SEVERAL: [Samples; 4] = [Samples::Two, Samples::Four, Samples::Eight, Samples::Sixteen];

/// A triangle over everything, at a depth and of a colour. It lies in its viewport, so that clipping does not divide it: pixels
/// on the line between two parts have fragments of both.
fn over_all(pipeline: usize, (depth, color): (f32, [f32; 4])) -> Draw {
    let corner = |[x, y]: [f32; 2]| [[x, y, depth, 1.0], color];
    let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]].map(corner);
    let side = 2.0 * SIDE as f32;
    draw(pipeline, &corners).viewport(Viewport {
        x: 0.0,
        y: 0.0,
        width: side,
        height: side,
        min_depth: 0.0,
        max_depth: 1.0,
    })
}

/// Triangles here and there, each of one colour.
fn triangles(random: &mut Random, count: usize) -> Vec<Corner> {
    let triangle = |_| {
        let color = [(); 4].map(|()| random.below(5) as f32 / 4.0);
        let w = 0.5 + random.unit();
        let size = [0.05, 0.3, 2.0][random.below(3)];
        let middle = [random.signed(), random.signed()];
        [(); 3].map(|()| {
            let [x, y] = middle.map(|at| (at + random.signed() * size) * w);
            [[x, y, random.unit() * w, w], color]
        })
    };
    (0..count).flat_map(triangle).collect()
}

fn pass(samples: Samples, format: Format) -> Pass {
    Pass::new("samples", Extent::new(SIDE, SIDE))
        .colors([ColorTarget::cleared(format, [0.0; 4])])
        .samples(samples)
}

fn compute(gpu: &Gpu) -> compute::Renderer {
    compute::Renderer::new(gpu).unwrap()
}

fn values(frame: &Frame) -> Vec<[f32; 4]> {
    frame.colors[0].values().collect()
}

/// The first pixel in which two pictures differ by more than `limit`, with the values of both.
fn difference(ours: &Picture, theirs: &Picture, limit: f32) -> Option<(usize, [[f32; 4]; 2])> {
    let both = ours.values().zip(theirs.values()).enumerate();
    let mut different = both.filter(|(_, (a, b))| {
        let far = |n: usize| (a[n] - b[n]).abs() > limit;
        (0..4).any(far)
    });
    different.next().map(|(pixel, (a, b))| (pixel, [a, b]))
}

/// With a mask of one sample, a pixel tells whether the device covers that very sample.
#[test]
fn each_sample_is_covered_as_on_the_device() {
    let gpu = gpu();
    let mut renderers: [Box<dyn Executor>; 2] =
        [Box::new(compute(&gpu)), Box::new(classic::Renderer::new(&gpu).unwrap())];
    let mut partly = 0;
    for seed in 11_000..11_040 {
        let mut random = Random::new(seed);
        let corners = triangles(&mut random, 12);
        let viewport = match random.below(3) {
            0 => None,
            // Whole pixels: of a pixel that its right or lower edge divides, lavapipe draws no sample if the centre is
            // outside, and Vulkan clips by geometry alone.
            _ => Some(Viewport {
                x: random.below(19) as f32 - 9.0,
                y: random.below(19) as f32 - 9.0,
                width: 20.0 + random.below(40) as f32,
                height: 20.0 + random.below(40) as f32,
                min_depth: 0.0,
                max_depth: 1.0,
            }),
        };
        let mut of_pixel = vec![0; (SIDE * SIDE) as usize];
        for sample in 0..4 {
            let pipeline = pipeline(
                "#version 450
                layout(location = 0) out vec4 written;
                void main() { written = vec4(1.0); }",
            );
            let mut draw = draw(0, &corners);
            draw.viewport = viewport;
            let pass = pass(Samples::Four, Format::Rgba32Float)
                .pipelines([pipeline.sample_mask(1 << sample).depth(DepthState::OFF)])
                .draws([draw]);
            let frames = renderers.each_mut().map(|renderer| renderer.render(&pass).unwrap());
            let found = difference(&frames[0].colors[0], &frames[1].colors[0], 0.0);
            assert_eq!(found, None, "seed {seed}, sample {sample}");
            for (all, [value, ..]) in of_pixel.iter_mut().zip(values(&frames[0])) {
                *all += u32::from(value > 0.0);
            }
        }
        partly += of_pixel.iter().filter(|covered| (1..4).contains(*covered)).count();
    }
    assert!(partly > 3000, "{partly} pixels are covered in part");
}

/// Opaque work with a depth test, several colours in a pixel: the averages are the device's.
#[test]
fn opaque_work_is_resolved_as_on_the_device() {
    let gpu = gpu();
    let (mut ours, mut theirs) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    let (mut pixels, mut others) = (0, 0);
    for seed in 11_100..11_132 {
        let mut random = Random::new(seed);
        let corners = triangles(&mut random, 60);
        let compare = [Compare::Less, Compare::LessOrEqual, Compare::Greater][random.below(3)];
        let clear = if compare == Compare::Greater { 0.0 } else { 1.0 };
        let pass = pass(Samples::Four, Format::Rgba32Float)
            .depth(DepthTarget::cleared(clear))
            .pipelines([pipeline(FRAGMENT).depth(DepthState::new(compare))])
            .draws([draw(0, &corners)]);
        let frames = [ours.render(&pass).unwrap(), theirs.render(&pass).unwrap()];
        let both = values(&frames[0]).into_iter().zip(values(&frames[1]));
        pixels += (SIDE * SIDE) as usize;
        others += both.filter(|(a, b)| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-5)).count();
        let [depth, other] = frames.map(|frame| frame.depth.unwrap().depths());
        let far = depth.iter().zip(&other).filter(|(a, b)| (*a - *b).abs() > 1e-4).count();
        assert!(far <= 4, "seed {seed}: {far} depths of sample 0 differ");
    }
    assert_eq!(others, 0, "of {pixels} pixels differ");
}

/// The same triangles through the path that knows no order and through the one that does: the same bytes.
#[test]
fn opaque_and_ordered_work_draw_the_same() {
    on_each_gpu("opaque and ordered work draw the same samples", |gpu| {
        let mut compute = compute(gpu);
        for (n, samples) in SEVERAL.into_iter().enumerate() {
            let mut random = Random::new(11_200 + n as u64);
            let mut corners = triangles(&mut random, 80);
            // One that covers whole bins, behind everything.
            corners.extend(
                [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]]
                    .map(|[x, y]| [[x, y, 0.99, 1.0], [0.25, 0.5, 0.75, 1.0]]),
            );
            for corner in &mut corners {
                corner[1][3] = 1.0;
            }
            // Alpha is 1 already: that says so, and makes the work ordered.
            let frames = [false, true].map(|ordered| {
                let pipeline = pipeline(FRAGMENT).depth(DepthState::LESS).alpha_to_one(ordered);
                let pass = pass(samples, Format::Rgba8Unorm)
                    .depth(DepthTarget::cleared(1.0))
                    .pipelines([pipeline])
                    .draws([draw(0, &corners)]);
                compute.render(&pass).unwrap()
            });
            assert_eq!(frames[0].colors[0].bytes, frames[1].colors[0].bytes, "{samples:?}");
            let depths = frames.each_ref().map(|frame| frame.depth.as_ref().unwrap().depths());
            assert_eq!(depths[0], depths[1], "{samples:?}");
            let between = frames[0].colors[0]
                .bytes
                .iter()
                .filter(|byte| ![0, 64, 128, 191, 255].contains(*byte));
            assert!(between.count() > 500, "{samples:?}: few pixels are averages");
        }
    });
}

/// Layers of blended triangles.
#[test]
fn blended_layers_are_those_of_the_device() {
    let gpu = gpu();
    let (mut ours, mut theirs) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    for seed in 11_300..11_316 {
        let mut random = Random::new(seed);
        let corners = triangles(&mut random, 30);
        let pass = pass(Samples::Four, Format::Rgba16Float)
            .pipelines([pipeline(FRAGMENT).depth(DepthState::OFF).blend(Blend::ALPHA)])
            .draws([draw(0, &corners)]);
        let frames = [ours.render(&pass).unwrap(), theirs.render(&pass).unwrap()];
        let found = difference(&frames[0].colors[0], &frames[1].colors[0], 4e-3);
        assert_eq!(found, None, "seed {seed}");
    }
}

/// Bands, and bins at the border of a target, hold all samples.
#[test]
fn large_targets_are_the_same_in_parts() {
    on_each_gpu("large targets of several samples are the same in parts", |gpu| {
        let mut compute = compute(gpu);
        let mut random = Random::new(11_400);
        let corners = triangles(&mut random, 50);
        let extent = Extent::new(2051, 1030);
        let mut pass = pass(Samples::Sixteen, Format::Rgba8Unorm)
            .extent(extent)
            .depth(DepthTarget::transient(1.0))
            .pipelines([pipeline(FRAGMENT).depth(DepthState::LESS)])
            .draws([draw(0, &corners)]);
        let whole = compute.render(&pass).unwrap();
        // The part from a column and a row on, by a viewport that reaches over the target.
        let [left, top] = [1024, 515];
        pass.extent = Extent::new(extent.width - left, extent.height - top);
        pass.draws[0].viewport = Some(Viewport {
            x: -(left as f32),
            y: -(top as f32),
            width: extent.width as f32,
            height: extent.height as f32,
            min_depth: 0.0,
            max_depth: 1.0,
        });
        let part = compute.render(&pass).unwrap();
        let row = |picture: &Picture, y: u32, x: u32, count: u32| {
            let at = 4 * (y * picture.extent.width + x) as usize;
            picture.bytes[at..at + 4 * count as usize].to_vec()
        };
        let mut other = 0;
        for y in 0..pass.extent.height {
            let width = pass.extent.width;
            let ours = row(&whole.colors[0], top + y, left, width);
            let theirs = row(&part.colors[0], y, 0, width);
            other += ours.chunks(4).zip(theirs.chunks(4)).filter(|(a, b)| a != b).count();
        }
        // Places in the window are rounded where they are far from the origin.
        assert!(other < 200, "{other} pixels differ");
    });
}

#[test]
fn what_cannot_be_is_refused() {
    let gpu = gpu();
    let interpolates = pipeline(
        "#version 450
        layout(location = 0) in vec4 color;
        layout(location = 0) out vec4 written;
        void main() { written = interpolateAtSample(color, 0); }",
    );
    let of = |samples, pipeline: Pipeline| {
        pass(samples, Format::Rgba8Unorm)
            .pipelines([pipeline])
            .draws([over_all(0, (0.5, [1.0; 4]))])
    };
    let mut compute = compute(&gpu);
    compute.render(&of(Samples::One, interpolates.clone())).unwrap();
    let fault = compute.render(&of(Samples::Four, interpolates)).unwrap_err();
    assert!(
        matches!(&fault, Error::Usage(text) if text.contains("interpolateAtSample")),
        "{fault}"
    );
    let mut wide = of(Samples::Sixteen, pipeline(FRAGMENT)).extent(Extent::new(16384, 4));
    wide.colors = vec![ColorTarget::cleared(Format::Rgba32Float, [0.0; 4]); 8];
    let fault = compute.render(&wide).unwrap_err();
    assert!(
        matches!(&fault, Error::Usage(text) if text.contains("16384 columns of 16")),
        "{fault}"
    );
    // What lavapipe's own pipeline does not do, and compute does.
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    let fault = classic.render(&of(Samples::Sixteen, pipeline(FRAGMENT))).unwrap_err();
    assert!(matches!(&fault, Error::Device(text) if text.contains("16 samples")), "{fault}");
    compute.render(&of(Samples::Sixteen, pipeline(FRAGMENT))).unwrap();
    let mut begun = of(Samples::Four, pipeline(FRAGMENT));
    let image = targets::target(&gpu, "begun", begun.extent, Format::Rgba8Unorm);
    begun.colors = vec![ColorTarget::on_device(&image, LoadOp::Load)];
    compute.render(&begun).unwrap();
    let fault = classic.render(&begun).unwrap_err();
    assert!(matches!(&fault, Error::Device(text) if text.contains("loads no target")), "{fault}");
}
