//! Do frames that are recorded anew and not waited for draw what prepared passes draw, in their order?

use crate::{
    common::{
        allocations, device_under_test, gpu, kernel_spirv, on_each_gpu, open_with, random::Random,
    },
    twin,
};
use std::sync::Arc;
use tilewright::{
    Error, compute,
    format::Format,
    grid::Capacities,
    image::Extent,
    pass::{Binding, BindingEntry, BindingSet, BufferRange, Draw, Pass, Pipeline},
    shader::{Shader, Stage},
    state::Rect,
    target::{ColorTarget, DepthTarget, LoadOp, StoreOp},
    texture::{Sampler, Texture},
    vk::{
        Buffer, Gpu, GpuOptions, Image, ImageInfo, ImageUse, Kernel, KernelInfo, Memory, Recorder,
        TableSizes,
    },
};

fn target(gpu: &Gpu, name: &str, extent: Extent, format: Format) -> Image {
    let usage = ImageUse::Attachment;
    Image::new(gpu, &ImageInfo::new(name, extent, format, usage)).unwrap()
}

fn shader(stage: Stage, source: &str) -> Arc<Shader> {
    Arc::new(Shader::from_glsl(stage, "frames", source).unwrap_or_else(|e| panic!("{e}")))
}

/// `pass`, which draws to images of its own.
fn on_images(gpu: &Gpu, pass: &Pass) -> Pass {
    let mut pass = pass.clone();
    for color in &mut pass.colors {
        color.image = Some(target(gpu, "color", pass.extent, color.format));
    }
    if let Some(depth) = &mut pass.depth {
        depth.image = Some(target(gpu, "depth", pass.extent, Format::D32Float));
    }
    pass
}

const WHOLE: &str = "#version 450
layout(push_constant) uniform Push { vec4 color; };
layout(location = 0) out vec4 shade;
void main() {
    gl_Position = vec4(4 * (gl_VertexIndex & 1) - 1, 4 * (gl_VertexIndex >> 1) - 1, 0.5, 1);
    shade = color;
}";

const SHADE: &str = "#version 450
layout(location = 0) in vec4 shade;
layout(location = 0) out vec4 color;
void main() { color = shade; }";

/// A pass that fills `image` with a colour that is pushed.
fn fill(image: &Image, shaders: &[Arc<Shader>; 2], color: [f32; 4]) -> Pass {
    let mut pass = Pass::new("fill", image.extent());
    pass.colors = vec![ColorTarget::on_device(image, LoadOp::clear([0.0; 4]))];
    let [vertex, fragment] = shaders.clone();
    pass.pipelines = vec![Arc::new(Pipeline::new("fill", vertex, fragment))];
    let push_constants = bytemuck::bytes_of(&color).to_vec();
    pass.draws = vec![Draw::new(0, 3).push_constants(push_constants)];
    pass
}

fn shaders() -> [Arc<Shader>; 2] {
    [shader(Stage::Vertex, WHOLE), shader(Stage::Fragment, SHADE)]
}

/// Frames of several passes, in memory that they use again: each image has the bytes that the pass gives by itself.
#[test]
fn passes_of_a_frame_draw_as_by_themselves() {
    on_each_gpu("passes of a frame draw as by themselves", |gpu| {
        let shaders = twin::shaders();
        let mut alone = compute::Renderer::new(gpu).unwrap();
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for in_flight in [1, 2, 3] {
            renderer.set_frames_in_flight(in_flight);
            let mut drawn: Vec<(String, Pass)> = Vec::new();
            for frame in 0..8 {
                let mut random = Random::new(8000 + frame);
                let primitives = 1 << (5 + frame % 6);
                renderer.set_batch_limit(Capacities {
                    primitives,
                    vertices: 3 * primitives,
                    varying_words: 1 << 16,
                });
                let passes: Vec<Pass> = (0..1 + random.below(4))
                    .map(|_| on_images(gpu, &twin::random_pass(random.bits(), &shaders)))
                    .collect();
                let mut encoder = renderer.begin().unwrap();
                for pass in &passes {
                    encoder.encode(pass).unwrap();
                }
                encoder.submit().unwrap();
                let what = format!("{}, {in_flight} frames in flight, frame {frame}", gpu.info());
                drawn.extend(passes.into_iter().map(|pass| (what.clone(), pass)));
            }
            for (what, pass) in drawn {
                let snapshot = pass.snapshot().unwrap();
                let expected = alone.render(&snapshot).unwrap();
                let [color, depth] = [&pass.colors[0].image, &pass.depth.as_ref().unwrap().image]
                    .map(|image| image.as_ref().unwrap().download(0).unwrap().bytes);
                assert!(color == expected.colors[0].bytes, "{what}: colour of `{}`", pass.label);
                assert!(
                    depth == expected.depth.unwrap().bytes,
                    "{what}: depth of `{}`",
                    pass.label
                );
            }
        }
    });
}

/// What a pass draws, the next pass of the frame samples, and the next frame as well.
#[test]
fn passes_feed_passes_and_frames_feed_frames() {
    on_each_gpu("passes feed passes and frames feed frames", |gpu| {
        let extent = Extent::new(24, 16);
        let [a, b] = ["a", "b"].map(|name| target(gpu, name, extent, Format::Rgba8Unorm));
        let vertex = shader(Stage::Vertex, WHOLE);
        let step = shader(
            Stage::Fragment,
            "#version 450
layout(location = 0) in vec4 shade;
layout(binding = 0) uniform sampler2D before;
layout(location = 0) out vec4 color;
void main() { color = texelFetch(before, ivec2(gl_FragCoord.xy), 0) + shade; }",
        );
        let pass = |from: &Image, to: &Image, color: [f32; 4]| {
            let mut pass = fill(to, &[vertex.clone(), step.clone()], color);
            let nearest = Sampler::nearest();
            let texture = Binding::Sampled(Arc::new(Texture::on_device(from)), nearest);
            let entry = BindingEntry { binding: 0, resources: vec![texture] };
            pass.draws[0].sets = vec![Arc::new(BindingSet { entries: vec![entry] })];
            pass
        };
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for _ in 0..20 {
            let mut encoder = renderer.begin().unwrap();
            encoder.encode(&pass(&a, &b, [1.0 / 255.0, 0.0, 0.0, 0.0])).unwrap();
            encoder.encode(&pass(&b, &a, [0.0, 2.0 / 255.0, 0.0, 1.0 / 255.0])).unwrap();
            encoder.submit().unwrap();
        }
        let texels = a.download(0).unwrap().bytes;
        assert!(texels.chunks(4).all(|texel| texel == [20, 40, 0, 20]), "{:?}", &texels[..4]);
    });
}

/// Once warm, a frame of passes takes no memory of the host: new push constants, another order, other viewports.
#[test]
fn a_warm_frame_allocates_nothing() {
    for by_address in [true, false] {
        // Without the validation layer: names of what it reports take memory.
        let options = GpuOptions::default()
            .device(device_under_test().index.to_string())
            .cache(None)
            .by_address(by_address);
        let gpu = Gpu::open(&options).unwrap();
        let shaders = shaders();
        let mut renderer = compute::Renderer::new(&gpu).unwrap();
        let (extent, format) = (Extent::new(300, 200), Format::Rgba8Unorm);
        let images = ["a", "b"].map(|name| target(&gpu, name, extent, format));
        let mut passes = images.each_ref().map(|image| {
            let mut pass = fill(image, &shaders, [1.0; 4]);
            pass.draws = vec![pass.draws[0].clone(); 20];
            pass.depth = Some(DepthTarget::cleared(1.0));
            pass.depth.as_mut().unwrap().store = StoreOp::Discard;
            pass
        });
        let mut random = Random::new(10);
        let mut taken = Vec::new();
        for frame in 0..60 {
            for draw in passes.iter_mut().flat_map(|pass| &mut pass.draws) {
                let color = [random.unit(), random.unit(), random.unit(), 1.0];
                draw.push_constants.copy_from_slice(bytemuck::bytes_of(&color));
                draw.scissor = Some(Rect { x: frame, y: 0, width: 100, height: 100 });
            }
            passes.swap(0, 1);
            let before = allocations::count();
            let mut encoder = renderer.begin().unwrap();
            for pass in &passes {
                encoder.encode(pass).unwrap();
            }
            encoder.submit().unwrap().wait().unwrap();
            taken.push(allocations::count() - before);
        }
        assert_eq!(taken[20..], [0; 40], "by address: {by_address}; all frames: {taken:?}");
        assert!(taken[0] > 0, "they are counted");
    }
}

/// Memory and kernels do not add up, whatever changes: push constants, sizes, what is bound. `FRAMES=10000` draws more; run
/// it alone then to see the memory of the process.
#[test]
fn frames_keep_nothing_of_those_before() {
    let gpu = gpu();
    let shaders = shaders();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let sizes = [(8, 8), (200, 100), (33, 57), (640, 4)];
    let images = sizes.map(|(w, h)| target(&gpu, "image", Extent::new(w, h), Format::Rgba8Unorm));
    let mut random = Random::new(9);
    let mut after_some = None;
    let frames = std::env::var("FRAMES").map_or(400, |frames| frames.parse().unwrap());
    let pages = || std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    for frame in 0..frames {
        if frame % 1000 == 999 {
            eprintln!("frame {frame}: pages in all and resident: {}", pages());
        }
        let mut encoder = renderer.begin().unwrap();
        for _ in 0..1 + random.below(3) {
            let image = &images[random.below(images.len())];
            let color = [random.unit(), random.unit(), random.unit(), 1.0];
            encoder.encode(&fill(image, &shaders, color)).unwrap();
        }
        encoder.submit().unwrap();
        let kept = renderer.cached();
        match frame {
            100 => after_some = Some(kept),
            101.. => assert_eq!(Some(kept), after_some, "frame {frame}"),
            _ => {}
        }
    }
}

const COUNT: &str = "#version 460
layout(local_size_x = 1) in;
layout(binding = 0) buffer Cells { uint cells[]; };
void main() {
    for (uint i = 0; i < cells[1]; i++) cells[0] = cells[0] * 1664525u + 1013904223u;
}";

/// Kernels and copies run where they are recorded, between passes. The host's writes wait for the frames that read.
#[test]
fn kernels_and_the_hosts_writes_keep_their_order() {
    on_each_gpu("kernels and the host's writes keep their order", |gpu| {
        let spirv = kernel_spirv(COUNT);
        let info = KernelInfo::new("count", &spirv);
        let count = Kernel::new(gpu, &info).unwrap();
        let cells = Buffer::<u32>::new(gpu, "cells", 2, Memory::Device).unwrap();
        let input = Buffer::with_content(gpu, "input", &[0u32, 0]).unwrap();
        let results = Buffer::<u32>::new(gpu, "results", 40, Memory::Device).unwrap();
        let step = |n: u32, times: u32| {
            (0..times).fold(n, |n, _| n.wrapping_mul(1_664_525).wrapping_add(1_013_904_223))
        };
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let mut expected = Vec::new();
        for frame in 0..20u32 {
            let times = 20_000 + 1000 * frame;
            // The frame before may be running and reads `input` at its end.
            input.write(0, &[frame, times]).unwrap();
            let mut encoder = renderer.begin().unwrap();
            encoder.upload(&cells, &[7, 100_000]).unwrap();
            encoder.kernel(&count).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
            let at = 2 * frame as usize;
            encoder.copy(&cells.slice(0..1).unwrap(), &results.slice(at..at + 1).unwrap()).unwrap();
            encoder.copy(&input, &cells).unwrap();
            encoder.kernel(&count).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
            let to = results.slice(at + 1..at + 2).unwrap();
            encoder.copy(&cells.slice(0..1).unwrap(), &to).unwrap();
            let frame_submission = encoder.submit().unwrap();
            if frame % 7 == 3 {
                frame_submission.wait().unwrap();
                assert!(frame_submission.is_done());
            }
            expected.extend([step(7, 100_000), step(frame, times)]);
        }
        assert_eq!(results.download().unwrap(), expected);
    });
}

/// The memory of a frame goes back when the frame has ended, unless somebody still has a slice of it.
#[test]
fn what_was_uploaded_for_a_frame_stays_with_its_holder() {
    on_each_gpu("what was uploaded for a frame stays with its holder", |gpu| {
        let extent = Extent::new(4, 4);
        let image = target(gpu, "image", extent, Format::Rgba8Unorm);
        let vertex = shader(Stage::Vertex, WHOLE);
        let shaded = shader(
            Stage::Fragment,
            "#version 450
layout(location = 0) in vec4 shade;
layout(binding = 0) uniform Block { vec4 factor; };
layout(location = 0) out vec4 color;
void main() { color = shade * factor; }",
        );
        let shaders = [vertex, shaded];
        let pass = |block: &Buffer<[f32; 4]>| {
            let mut pass = fill(&image, &shaders, [1.0; 4]);
            let block = Binding::Uniform(BufferRange::on_device(block));
            let entry = BindingEntry { binding: 0, resources: vec![block] };
            pass.draws[0].sets = vec![Arc::new(BindingSet { entries: vec![entry] })];
            pass
        };
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let mut encoder = renderer.begin().unwrap();
        let held = encoder.transient(&[[0.0f32, 1.0, 0.0, 1.0]]).unwrap();
        encoder.encode(&pass(&held)).unwrap();
        encoder.submit().unwrap();
        for n in 0..10 {
            let mut encoder = renderer.begin().unwrap();
            let value = [n as f32 / 255.0; 4];
            let of_frame = encoder.transient(&[value]).unwrap();
            encoder.encode(&pass(&of_frame)).unwrap();
            encoder.submit().unwrap();
            drop(of_frame);
            assert_eq!(image.download(0).unwrap().texel(2, 2), [n; 4]);
        }
        let mut encoder = renderer.begin().unwrap();
        encoder.encode(&pass(&held)).unwrap();
        encoder.submit().unwrap();
        assert_eq!(image.download(0).unwrap().texel(2, 2), [0, 255, 0, 255]);
    });
}

/// A frame that nobody submits does not run, and a pass that is refused leaves the rest of the frame as it is.
#[test]
fn frames_that_are_dropped_and_passes_that_are_refused_draw_nothing() {
    let gpu = gpu();
    let image = target(&gpu, "image", Extent::new(4, 4), Format::Rgba8Unorm);
    let shaders = shaders();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let zeros = |image: &Image| image.download(0).unwrap().bytes.iter().all(|byte| *byte == 0);
    for _ in 0..5 {
        let mut encoder = renderer.begin().unwrap();
        encoder.encode(&fill(&image, &shaders, [1.0; 4])).unwrap();
        drop(encoder);
        assert!(zeros(&image));
    }
    let mut encoder = renderer.begin().unwrap();
    let mut homeless = fill(&image, &shaders, [1.0; 4]);
    homeless.colors[0].image = None;
    let error = encoder.encode(&homeless).unwrap_err();
    assert!(matches!(&error, Error::Usage(text) if text.contains("has none")), "{error}");
    let mut homeless = fill(&image, &shaders, [1.0; 4]);
    homeless.depth = Some(DepthTarget::cleared(1.0));
    let error = encoder.encode(&homeless).unwrap_err();
    assert!(matches!(&error, Error::Usage(text) if text.contains("has none")), "{error}");
    let mut wrong = fill(&image, &shaders, [1.0; 4]);
    wrong.draws[0].push_constants.clear();
    let error = encoder.encode(&wrong).unwrap_err();
    assert!(matches!(&error, Error::Usage(text) if text.contains("push constants")), "{error}");
    // An image of another device: noticed before anything is recorded.
    let other = crate::common::gpu();
    let stranger = target(&other, "stranger", Extent::new(4, 4), Format::Rgba8Unorm);
    let error = encoder.encode(&fill(&stranger, &shaders, [1.0; 4])).unwrap_err();
    assert!(error.to_string().contains("stranger"), "{error}");
    let mut right = fill(&image, &shaders, [1.0; 4]);
    let mut depth = DepthTarget::cleared(1.0);
    depth.store = StoreOp::Discard;
    right.depth = Some(depth);
    encoder.encode(&right).unwrap();
    encoder.submit().unwrap();
    assert_eq!(image.download(0).unwrap().texel(1, 3), [255; 4]);
}

/// The passes of a frame share a resource table until it is full.
#[test]
fn a_frame_goes_on_when_a_table_is_full() {
    let table = TableSizes { buffers: 12, ..TableSizes::default() };
    let gpu =
        open_with(GpuOptions::default().device(device_under_test().index.to_string()).table(table));
    let shaders = shaders();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    for round in 0..3 {
        let images: Vec<_> =
            (0..30).map(|_| target(&gpu, "image", Extent::new(4, 4), Format::Rgba8Unorm)).collect();
        let mut encoder = renderer.begin().unwrap();
        for (n, image) in images.iter().enumerate() {
            let color = [n as f32 / 255.0, round as f32 / 255.0, 0.0, 1.0];
            encoder.encode(&fill(image, &shaders, color)).unwrap();
        }
        encoder.submit().unwrap();
        for (n, image) in images.iter().enumerate() {
            assert_eq!(image.download(0).unwrap().texel(0, 3), [n as u8, round, 0, 255]);
        }
    }
}

/// Targets of several bands, whose rows are copied to the image before those of the next band take their place.
#[test]
fn bands_of_a_frame_take_turns() {
    let gpu = gpu();
    let extent = Extent::new(4096, 2100);
    let image = target(&gpu, "image", extent, Format::Rgba8Unorm);
    let coordinates = shader(
        Stage::Fragment,
        "#version 450
layout(location = 0) in vec4 shade;
layout(location = 0) out vec4 color;
void main() { ivec2 p = ivec2(gl_FragCoord.xy); color = vec4(p.x & 255, p.y & 255, p.y >> 8, 255) / 255.0 * shade; }",
    );
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let mut encoder = renderer.begin().unwrap();
    let shaders = [shader(Stage::Vertex, WHOLE), coordinates];
    encoder.encode(&fill(&image, &shaders, [1.0; 4])).unwrap();
    encoder.submit().unwrap();
    let drawn = image.download(0).unwrap();
    for (x, y) in [(0, 0), (4095, 2099), (17, 2047), (18, 2048), (300, 2049), (4000, 1)] {
        assert_eq!(drawn.texel(x, y), [x as u8, y as u8, (y >> 8) as u8, 255], "{x},{y}");
    }
}

/// A recording that was started can be started again, waited for, and dropped while it runs.
#[test]
fn recordings_start_without_waiting() {
    on_each_gpu("recordings start without waiting", |gpu| {
        let spirv = kernel_spirv(COUNT);
        let info = KernelInfo::new("count", &spirv);
        let count = Kernel::new(gpu, &info).unwrap();
        let cells = Buffer::with_content(gpu, "cells", &[1u32, 10_000]).unwrap();
        let mut recorder = Recorder::new(gpu, "count").unwrap();
        recorder.kernel(&count).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
        let mut recording = recorder.finish().unwrap();
        let mut last = None;
        for _ in 0..10 {
            last = Some(recording.start().unwrap());
        }
        recording.run().unwrap();
        drop(recording);
        let last = last.unwrap();
        assert!(last.is_done(), "a recording that is dropped was waited for");
        last.wait().unwrap();
        let expected = (0..110_000u32)
            .fold(1u32, |n, _| n.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
        assert_eq!(cells.download().unwrap()[0], expected);
    });
}

/// Fewer frames may be in flight than before: those that are too many are waited for.
#[test]
fn the_number_of_frames_in_flight_may_shrink() {
    let gpu = gpu();
    let image = target(&gpu, "image", Extent::new(64, 64), Format::Rgba8Unorm);
    let shaders = shaders();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let frame = |renderer: &mut compute::Renderer| {
        let mut encoder = renderer.begin().unwrap();
        encoder.encode(&fill(&image, &shaders, [1.0; 4])).unwrap();
        encoder.submit().unwrap()
    };
    renderer.set_frames_in_flight(4);
    let submitted: Vec<_> = (0..4).map(|_| frame(&mut renderer)).collect();
    renderer.set_frames_in_flight(1);
    frame(&mut renderer);
    assert!(submitted.iter().all(|submission| submission.is_done()));
}
