//! Do depth targets of every format hold what the device's own pipeline leaves in them, and test as it tests?

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    twin,
};
use std::sync::Arc;
use tilewright::{
    Error, Frame, classic, compare, compute,
    format::Format,
    image::{Extent, Picture},
    pass::{Binding, BindingSet, BufferRange, Draw, Executor, Pass, Pipeline},
    shader::{Shader, Stage},
    state::{Blend, Compare, Cull, DepthBias, DepthState, Topology},
    target::{ColorTarget, DepthTarget, LoadOp},
    texture::{Sampler, Texture},
    vk::{Gpu, Image, ImageInfo, ImageUse},
};

const FORMATS: [Format; 3] = [Format::D32Float, Format::D16Unorm, Format::X8D24Unorm];

/// Triangles in layers that meet each other, drawn by a few draws with states of their own.
fn pass(format: Format, extent: Extent, seed: u64) -> Pass {
    let mut random = Random::new(seed);
    let template = (*twin::random_pass(0, &twin::shaders()).pipelines[0]).clone();
    let greater = random.below(2) == 0;
    let mut pass = Pass::new(&format!("seed {seed}"), extent)
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .depth(DepthTarget::cleared(if greater { 0.0 } else { 1.0 }).format(format));
    for n in 0..4 {
        let compare = match greater {
            true => [Compare::Greater, Compare::GreaterOrEqual][random.below(2)],
            false => [Compare::Less, Compare::LessOrEqual][random.below(2)],
        };
        let pipeline = template
            .clone()
            .topology(Topology::TriangleList)
            .cull(Cull::None)
            .depth(DepthState::new(compare))
            .blend((random.below(3) == 0).then_some(Blend::ALPHA));
        pass.pipelines.push(Arc::new(pipeline));
        // Some lie in a plane that others lie in too.
        let level = [0.25, 0.5, 0.7][random.below(3)];
        let flat = random.below(2) == 0;
        let corners: Vec<[f32; 4]> = (0..30)
            .map(|_| {
                let z = if flat { level } else { random.unit() };
                [random.signed() * 0.99, random.signed() * 0.99, z, 1.0]
            })
            .collect();
        let range = BufferRange::host("corners", bytemuck::cast_slice(&corners).to_vec());
        let factor = [0.0, 1.0, -1.0, 4.0, -2.5];
        let [constant, slope] = [(); 2].map(|()| factor[random.below(5)]);
        // Lavapipe's constant counts steps of 2^-23 in targets of 16 and of 24 bits: it is left out.
        let constant = if format == Format::D32Float { constant } else { 0.0 };
        let bias = DepthBias::new(constant, slope);
        let draw = Draw::new(n, 30).vertex_buffers([range]);
        pass.draws.push(draw.depth_bias((random.below(3) == 0).then_some(bias)));
    }
    pass
}

/// Coverage and winners are those of the device. A depth is at most one step of its format off where rounding decides, a float
/// at most 2e-7: the slope of a bias is rounded differently.
#[test]
fn every_format_tests_as_the_device_does() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    for format in FORMATS {
        let step = match format {
            Format::D16Unorm => 1.0 / 65535.0,
            Format::X8D24Unorm => 1.0 / 16777215.0 + 6e-8,
            _ => 2e-7,
        };
        let (mut pixels, mut winners) = (0, 0);
        for seed in 9800..9832 {
            let pass = pass(format, Extent::new(64, 64), seed);
            let both = compare::Both::draw(&mut compute, &mut classic, &pass, |_| {}).unwrap();
            let found = both.difference;
            let what = format!("{format:?}, seed {seed}: {found:?}");
            assert_eq!(found.coverage_differing, 0, "{what}");
            assert!(found.depth_max <= step, "{what}");
            pixels += found.pixels;
            winners += found.winner_differing;
        }
        assert_eq!(winners, 0, "{format:?}, of {pixels} pixels");
    }
}

fn image(gpu: &Gpu, format: Format, extent: Extent) -> Image {
    Image::new(gpu, &ImageInfo::new("depth", extent, format, ImageUse::Attachment)).unwrap()
}

fn depth(frame: &Frame) -> &Picture {
    frame.depth.as_ref().unwrap()
}

/// A pass in one go, in two passes on an image, and in two passes with a picture between them.
#[test]
fn what_a_pass_leaves_another_one_begins_with() {
    on_each_gpu("what a pass leaves another one begins with", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for (seed, format) in (9850..).zip(FORMATS) {
            let extent = Extent::new(61, 47);
            let whole = pass(format, extent, seed);
            let expected = compute.render(&whole).unwrap();
            assert_eq!(depth(&expected).format, format);
            assert_eq!(depth(&expected).bytes.len(), extent.pixels() * format.texel_bytes());
            let (mut first, mut second) = (whole.clone(), whole.clone());
            first.draws.truncate(2);
            second.draws.drain(..2);
            let begun = compute.render(&first).unwrap();
            second.colors[0].load = LoadOp::Picture(Arc::new(begun.colors[0].clone()));
            second.depth.as_mut().unwrap().load = LoadOp::Picture(Arc::new(depth(&begun).clone()));
            let frame = compute.render(&second).unwrap();
            assert_eq!(frame.colors, expected.colors, "picture, {format:?}");
            assert_eq!(frame.depth, expected.depth, "picture, {format:?}");

            let image = match Image::new(
                gpu,
                &ImageInfo::new("depth", extent, format, ImageUse::Attachment),
            ) {
                Ok(image) => image,
                // SwiftShader has no images of 24 bits.
                Err(Error::Device(_)) if format == Format::X8D24Unorm => continue,
                Err(error) => panic!("{format:?}: {error}"),
            };
            first.depth = Some(DepthTarget::on_device(
                &image,
                LoadOp::Clear(match whole.depth {
                    Some(DepthTarget { load: LoadOp::Clear(depth), .. }) => depth,
                    _ => unreachable!(),
                }),
            ));
            let mut second = second.clone();
            second.depth = Some(DepthTarget::on_device(&image, LoadOp::Load));
            compute.render(&first).unwrap();
            let frame = compute.render(&second).unwrap();
            assert_eq!(frame.colors, expected.colors, "image, {format:?}");
            assert_eq!(depth(&frame).depths(), depth(&expected).depths(), "image, {format:?}");
        }
    });
}

/// The last band ends within a word of two texels.
#[test]
fn a_target_in_bands_is_stored_and_loaded_whole() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    for format in [Format::D16Unorm, Format::X8D24Unorm] {
        let extent = Extent::new(4097, 2101);
        let mut whole = pass(format, extent, 9860);
        let image = image(&gpu, format, extent);
        let cleared = whole.depth.clone();
        let expected = compute.render(&whole).unwrap();
        whole.depth = Some(DepthTarget::on_device(&image, cleared.unwrap().load));
        compute.render(&whole).unwrap();
        assert_eq!(image.download(0).unwrap().depths(), depth(&expected).depths(), "{format:?}");
        // Nothing is drawn: what was loaded is stored again.
        whole.draws.clear();
        whole.depth = Some(DepthTarget::on_device(&image, LoadOp::Load));
        compute.render(&whole).unwrap();
        assert_eq!(image.download(0).unwrap().depths(), depth(&expected).depths(), "{format:?}");
    }
}

/// A cleared target holds the nearest depth of its format, also where nothing is drawn.
#[test]
fn clears_are_rounded_as_the_device_rounds_them() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    let mut random = Random::new(9870);
    for format in FORMATS {
        for value in (0..40).map(|_| random.unit()).chain([0.0, 1.0, 0.5, 1.0 / 3.0]) {
            let cleared = Pass::new("cleared", Extent::new(5, 3))
                .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
                .depth(DepthTarget::cleared(value).format(format));
            let ours = compute.render(&cleared).unwrap();
            let theirs = classic.render(&cleared).unwrap();
            let of = |frame: &Frame| depth(frame).depths();
            let step = [0.0, 1.0 / 65535.0, 1.0 / 16777215.0]
                [FORMATS.iter().position(|f| *f == format).unwrap()];
            // A number halfway between two may become either of them.
            let (ours, theirs) = (of(&ours), of(&theirs));
            assert!((ours[0] - value).abs() <= 0.51 * step + 2f32.powi(-24), "{format:?}, {value}");
            assert!((ours[0] - theirs[0]).abs() <= 1.01 * step, "{format:?}, {value}");
            assert_eq!(ours, vec![ours[0]; 15]);
        }
    }
}

#[test]
fn colours_are_no_depth_target() {
    let gpu = gpu();
    let mut wrong = pass(Format::D16Unorm, Extent::new(8, 8), 9880);
    wrong.depth = Some(DepthTarget::cleared(1.0).format(Format::R16Unorm));
    let error = compute::Renderer::new(&gpu).unwrap().render(&wrong).unwrap_err().to_string();
    assert!(error.contains("R16Unorm, which is no format of a depth target"), "{error}");
    let image = image(&gpu, Format::D16Unorm, Extent::new(8, 8));
    wrong.depth = Some(DepthTarget::on_device(&image, LoadOp::Clear(1.0)).format(Format::D32Float));
    let error = wrong.validate().unwrap_err().to_string();
    assert!(error.contains("D16Unorm") && error.contains("D32Float"), "{error}");
}

/// A bias of whole steps of the format moves a depth by so many of them.
#[test]
fn a_constant_bias_counts_the_steps_of_the_format() {
    on_each_gpu("a constant bias counts the steps of the format", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for (format, depth_of) in
            [(Format::D16Unorm, 30_000.0 / 65535.0), (Format::X8D24Unorm, 1_000_000.0 / 16777215.0)]
        {
            let template = (*twin::random_pass(0, &twin::shaders()).pipelines[0]).clone();
            let pipeline = template
                .topology(Topology::TriangleList)
                .cull(Cull::None)
                .depth(DepthState::new(Compare::Always))
                .blend(None);
            let corners = [
                [-1.0, -1.0, depth_of, 1.0],
                [3.0, -1.0, depth_of, 1.0],
                [-1.0, 3.0, depth_of, 1.0f32],
            ];
            let range = BufferRange::host("corners", bytemuck::cast_slice(&corners).to_vec());
            let mut number = |bias: Option<DepthBias>| -> u32 {
                let draw = Draw::new(0, 3).vertex_buffers([range.clone()]).depth_bias(bias);
                let pass = Pass::new("steps", Extent::new(4, 4))
                    .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
                    .depth(DepthTarget::cleared(1.0).format(format))
                    .pipelines([pipeline.clone()])
                    .draws([draw]);
                let frame = compute.render(&pass).unwrap();
                match depth(&frame).bytes[..] {
                    [a, b, ..] if format == Format::D16Unorm => u16::from_ne_bytes([a, b]).into(),
                    [a, b, c, d, ..] => u32::from_ne_bytes([a, b, c, d]),
                    _ => unreachable!(),
                }
            };
            let plain = number(None);
            for steps in [3i32, -2, 100] {
                let moved = number(Some(DepthBias::new(steps as f32, 0.0)));
                assert_eq!(moved as i32 - plain as i32, steps, "{format:?}");
            }
        }
    });
}

/// What a pass left is sampled by another one, also by a copy of it on the host.
#[test]
fn shaders_sample_depths_of_every_format() {
    on_each_gpu("shaders sample depths of every format", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let shader = |stage, text| Shader::from_glsl(stage, "sampled", text).unwrap();
        let vertex = "#version 450
            void main() {
                gl_Position = vec4(vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0, 0.5, 1.0);
            }";
        let fragment = "#version 450
            layout(binding = 0) uniform sampler2D depths;
            layout(location = 0) out float color;
            void main() { color = texelFetch(depths, ivec2(gl_FragCoord.xy), 0).r; }";
        let pipeline = Pipeline::new(
            "sampled",
            shader(Stage::Vertex, vertex),
            shader(Stage::Fragment, fragment),
        );
        for (seed, format) in (9890..).zip(FORMATS) {
            let extent = Extent::new(31, 17);
            let info = ImageInfo::new("depth", extent, format, ImageUse::Attachment);
            let image = match Image::new(gpu, &info) {
                // SwiftShader has no images of 24 bits.
                Err(Error::Device(_)) if format == Format::X8D24Unorm => continue,
                image => image.unwrap(),
            };
            let mut first = pass(format, extent, seed);
            let clear = first.depth.take().unwrap().load;
            first.depth = Some(DepthTarget::on_device(&image, clear));
            compute.render(&first).unwrap();
            let binding = Binding::sampled(Texture::on_device(&image), Sampler::default());
            let second = Pass::new("sampled", extent)
                .colors([ColorTarget::cleared(Format::R32Float, [0.0; 4])])
                .pipelines([pipeline.clone()])
                .draws([Draw::new(0, 3).sets([BindingSet::new([(0, binding)])])]);
            let expected = image.download(0).unwrap().depths();
            for pass in [&second, &*second.snapshot().unwrap()] {
                let frame = compute.render(pass).unwrap();
                for (found, [depth, ..]) in expected.iter().zip(frame.colors[0].values()) {
                    assert!((found - depth).abs() < 1e-7, "{format:?}: {found} {depth}");
                }
            }
        }
    });
}
