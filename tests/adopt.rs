//! Does the library draw on a device that its caller opened, in the caller's commands, from the caller's buffers and to
//! the caller's images?

use crate::common::{
    gpu,
    vulkan::{Opened, Program},
};
use ash::vk;
use std::{sync::Arc, time::Duration};
use tilewright::{
    Error, compute,
    format::{Format, VertexFormat},
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, Draw, IndexFormat, Indices, Pass, Pipeline,
        StepRate, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    target::{ColorTarget, DepthTarget, LoadOp},
    texture::{Sampler, Texture},
    vk::{
        Buffer, CallerBuffer, CallerCommands, CallerImage, GpuOptions, Image, ImageInfo, ImageUse,
    },
};

#[allow(dead_code)]
#[path = "../examples/ash.rs"]
mod ash_program;

const SIZE: (u32, u32) = (200, 150);
const EXTENT: Extent = Extent::new(SIZE.0, SIZE.1);
const BYTES: usize = (SIZE.0 * SIZE.1 * 4) as usize;
const COLOR: vk::ImageAspectFlags = vk::ImageAspectFlags::COLOR;
const UNDEFINED: vk::ImageLayout = vk::ImageLayout::UNDEFINED;
const GENERAL: vk::ImageLayout = vk::ImageLayout::GENERAL;
const READ: vk::ImageLayout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
const COPIED: vk::ImageUsageFlags = vk::ImageUsageFlags::from_raw(
    vk::ImageUsageFlags::TRANSFER_SRC.as_raw() | vk::ImageUsageFlags::TRANSFER_DST.as_raw(),
);

const VERTEX: &str = "#version 450
layout(push_constant) uniform Push { vec4 shift; };
layout(location = 0) in vec3 position;
layout(location = 0) out vec3 shade;
void main() {
    gl_Position = vec4(position + shift.xyz, 1.0);
    shade = position * 0.5 + 0.5;
}";
const FRAGMENT: &str = "#version 450
layout(location = 0) in vec3 shade;
layout(location = 0) out vec4 color;
void main() { color = vec4(shade, 1.0); }";
const WHOLE: &str = "#version 450
layout(location = 0) out vec2 at;
void main() {
    vec2 corner = vec2(4 * (gl_VertexIndex & 1) - 1, 4 * (gl_VertexIndex >> 1) - 1);
    gl_Position = vec4(corner, 0.5, 1.0);
    at = corner * 0.5 + 0.5;
}";
const SAMPLE: &str = "#version 450
layout(set = 0, binding = 0) uniform sampler2D before;
layout(location = 0) in vec2 at;
layout(location = 0) out vec4 color;
void main() { color = texture(before, at).brga; }";

/// Five corners, and indices of three triangles that hide each other in part.
const CORNERS: [[f32; 3]; 5] =
    [[-0.9, -0.8, 0.2], [0.8, -0.7, 0.6], [0.1, 0.9, 0.4], [-0.6, 0.7, 0.9], [0.9, 0.5, 0.1]];
const TRIANGLES: [u32; 9] = [0, 1, 2, 3, 1, 4, 0, 4, 2];

fn shader(stage: Stage, source: &str) -> Arc<Shader> {
    Arc::new(Shader::from_glsl(stage, "adopt", source).unwrap_or_else(|e| panic!("{e}")))
}

/// The triangles, drawn from these buffers.
fn triangles(corners: BufferRange, indices: BufferRange, shift: f32) -> Pass {
    let mut pass = Pass::new("triangles", EXTENT);
    let (vertex, fragment) = (shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, FRAGMENT));
    let mut pipeline = Pipeline::new("triangles", vertex, fragment);
    pipeline.vertex_bindings = vec![VertexBinding { stride: 12, rate: StepRate::Vertex }];
    let format = VertexFormat::F32X3;
    pipeline.vertex_attributes =
        vec![VertexAttribute { location: 0, binding: 0, format, offset: 0 }];
    pass.pipelines = vec![Arc::new(pipeline)];
    pass.depth = Some(DepthTarget::transient(1.0));
    pass.draws = vec![
        Draw::new(0, 9)
            .vertex_buffers([corners])
            .indices(Indices::new(indices, IndexFormat::U32))
            .push_constants(bytemuck::bytes_of(&[shift, 0.0, 0.0, 0.0]).to_vec()),
    ];
    pass
}

fn host_triangles(shift: f32) -> Pass {
    let buffer = |label: &str, bytes: &[u8]| {
        BufferRange::whole(&Arc::new(tilewright::pass::BufferSource::new(label, bytes.to_vec())))
    };
    let corners = buffer("corners", bytemuck::cast_slice(&CORNERS));
    triangles(corners, buffer("indices", bytemuck::cast_slice(&TRIANGLES)), shift)
}

/// A pass that draws `before` with its colours exchanged.
fn exchange(before: &Image) -> Pass {
    let mut pass = Pass::new("exchange", EXTENT);
    let (vertex, fragment) = (shader(Stage::Vertex, WHOLE), shader(Stage::Fragment, SAMPLE));
    pass.pipelines = vec![Arc::new(Pipeline::new("exchange", vertex, fragment))];
    let sampler = Sampler::nearest();
    let resources = vec![Binding::Sampled(Arc::new(Texture::on_device(before)), sampler)];
    let entries = vec![BindingEntry { binding: 0, resources }];
    pass.draws = vec![Draw::new(0, 3).sets([Arc::new(BindingSet { entries })])];
    pass
}

/// What the triangles look like, drawn over `background` on a device of the library, and with their colours exchanged.
fn expected(background: [u8; 4], shift: f32) -> [Vec<u8>; 2] {
    let gpu = gpu();
    let usage = ImageUse::Attachment;
    let info = ImageInfo::new("a", EXTENT, Format::Rgba8Unorm, usage);
    let [first, second] = [0; 2].map(|_| Image::new(&gpu, &info).unwrap());
    first.upload(&[background.repeat(BYTES / 4)]).unwrap();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let mut pass = host_triangles(shift);
    pass.colors = vec![ColorTarget::on_device(&first, LoadOp::Load)];
    renderer.render(&pass).unwrap();
    let mut pass = exchange(&first);
    pass.colors = vec![ColorTarget::on_device(&second, LoadOp::clear([0.0; 4]))];
    renderer.render(&pass).unwrap();
    [first, second].map(|image| image.download(0).unwrap().bytes)
}

/// Frames of two passes in the caller's commands, two of them in flight, from the caller's buffers, over what the caller
/// drew, to an image that the caller then reads. Each frame is submitted twice.
#[test]
fn passes_run_in_the_callers_commands() {
    let program = Program::new();
    for by_address in [true, false] {
        let options = GpuOptions::default().by_address(by_address).cache(None);
        let opened = Opened::new(&program, vk::DeviceCreateInfo::default(), &options);
        let gpu = opened.gpu().clone();
        let (size, usage) = (64, gpu.buffer_usage());
        let [corners, indices] = [("corners", 64), ("indices", 48)].map(|(name, size)| {
            let (buffer, at) = opened.buffer(size, usage);
            let whole = CallerBuffer { name, buffer, size, usage };
            // SAFETY: the device is adopted, and `opened` keeps the buffer until the end.
            (unsafe { Buffer::adopt(&gpu, &whole) }.unwrap(), at)
        });
        // SAFETY: the buffers have room, and nothing runs.
        unsafe {
            std::ptr::copy_nonoverlapping(CORNERS.as_ptr().cast(), corners.1, 60);
            std::ptr::copy_nonoverlapping(TRIANGLES.as_ptr().cast(), indices.1, 36);
        }
        assert_eq!(corners.0.len(), size as usize);
        let image = |name, usage, layout| {
            let image = opened.image(SIZE, vk::Format::R8G8B8A8_UNORM, usage);
            let whole =
                CallerImage::new(image, EXTENT, Format::Rgba8Unorm, usage, layout).name(name);
            // SAFETY: as above; the commands below bring the image to this layout.
            (unsafe { Image::adopt(&gpu, &whole) }.unwrap(), image)
        };
        let (first, first_raw) = image("first", COPIED | vk::ImageUsageFlags::SAMPLED, GENERAL);
        let (second, second_raw) = image("second", COPIED, READ);
        let mut renderer = compute::Renderer::new(&gpu).unwrap();
        let mut flying = Vec::new();
        for frame in 0..5 {
            let shift = frame as f32 * 0.1;
            let commands = opened.begin();
            opened.change(commands, (first_raw, COLOR), (UNDEFINED, GENERAL));
            let value = vk::ClearColorValue { float32: [0.2, 0.4, 0.6, 1.0] };
            let range = vk::ImageSubresourceRange::default().aspect_mask(COLOR);
            let range = [range.level_count(1).layer_count(1)];
            // SAFETY: the commands are being recorded, and the image is in this layout.
            unsafe {
                opened.device.cmd_clear_color_image(commands, first_raw, GENERAL, &value, &range);
            }
            opened.change(commands, (second_raw, COLOR), (UNDEFINED, READ));
            let corners = BufferRange::on_device(&corners.0.slice(0..60).unwrap());
            let indices = BufferRange::on_device(&indices.0.slice(0..36).unwrap());
            let mut draw = triangles(corners, indices, shift);
            draw.colors = vec![ColorTarget::on_device(&first, LoadOp::Load)];
            let mut then = exchange(&first);
            then.colors = vec![ColorTarget::on_device(&second, LoadOp::clear([0.0; 4]))];
            then.depth = None;
            // SAFETY: the commands are being recorded; what is recorded is held until they have ended.
            let borrowed = unsafe { CallerCommands::new(&gpu, commands) };
            let recorded = renderer.record(borrowed, |frame| {
                frame.encode(&draw)?;
                frame.encode(&then)
            });
            let reads = [first_raw, second_raw].map(|image| {
                let (read, at) = opened.buffer(BYTES as u64, vk::BufferUsageFlags::TRANSFER_DST);
                let layout = if image == first_raw { GENERAL } else { READ };
                opened.copy_to(commands, (image, layout), SIZE, read);
                at
            });
            opened.end(commands);
            if flying.len() == 2 {
                check(&opened, flying.remove(0));
            }
            let fence = opened.submit(commands);
            flying.push((commands, fence, recorded.unwrap(), reads, shift));
        }
        flying.into_iter().for_each(|frame| check(&opened, frame));
        assert_eq!(renderer.cached().tables, 0);
    }
}

type Flying = (vk::CommandBuffer, vk::Fence, compute::Recorded, [*mut u8; 2], f32);

/// Waits for a frame, checks its pictures, submits it again and checks it again.
fn check(opened: &Opened<'_>, (commands, fence, recorded, reads, shift): Flying) {
    let expected = expected([51, 102, 153, 255], shift);
    assert!(expected[0] != expected[1]);
    let mut fence = fence;
    for run in 0..2 {
        opened.wait(fence);
        for (at, expected) in reads.iter().zip(&expected) {
            // SAFETY: the buffer has as many bytes, and the device is done with it.
            let bytes = unsafe { std::slice::from_raw_parts_mut(*at, BYTES) };
            assert!(bytes == *expected, "frame shifted by {shift}, run {run}");
            bytes.fill(0);
        }
        if run == 0 {
            fence = opened.submit(commands);
        }
    }
    drop(recorded);
}

/// While the device is at work, a frame is recorded and started that uploads a texture: whoever waited would wait until the
/// time is up, since the queue goes on only afterwards.
#[test]
fn a_frame_that_uploads_waits_for_nobody() {
    let program = Program::new();
    let options = GpuOptions::default().timeout(Duration::from_secs(10));
    let opened = Opened::new(&program, vk::DeviceCreateInfo::default(), &options);
    let gpu = opened.gpu();
    let info = ImageInfo::new("shown", EXTENT, Format::Rgba8Unorm, ImageUse::Attachment);
    let shown = Image::new(gpu, &info).unwrap();
    let mut pass = exchange(&shown);
    pass.colors = vec![ColorTarget::on_device(&shown, LoadOp::clear([0.0; 4]))];
    let mut renderer = compute::Renderer::new(gpu).unwrap();
    for color in [[10, 20, 30, 40], [50, 60, 70, 80]] {
        let texels = vec![color.repeat(4 * 4)];
        let texture = Texture::new("fresh", Extent::new(4, 4), Format::Rgba8Unorm, texels);
        let set = BindingSet::new([(0, Binding::sampled(texture, Sampler::nearest()))]);
        pass.draws[0] = Draw::new(0, 3).sets([set]);
        // Kernels and tables are made by the first frame.
        let held = (color[0] != 10).then(|| opened.hold());
        let mut frame = renderer.begin().unwrap();
        frame.encode(&pass).unwrap();
        let submission = frame.submit().unwrap();
        assert!(held.is_none() || !submission.is_done());
        drop(held);
        submission.wait().unwrap();
        let [r, g, b, a] = color;
        assert!(shown.download(0).unwrap().bytes.chunks(4).all(|texel| texel == [b, r, g, a]));
    }
}

/// The chains that a caller may have already: none, features of Vulkan 1.0 in either place, the structures of the
/// versions, or those that became part of them.
#[test]
fn whatever_is_enabled_already_what_is_needed_is_added() {
    let program = Program::new();
    let extensions = [ash::khr::maintenance1::NAME.as_ptr()];
    let sampling = vk::PhysicalDeviceFeatures::default().independent_blend(true);
    let info = || vk::DeviceCreateInfo::default().enabled_extension_names(&extensions);
    let draws = |info: vk::DeviceCreateInfo<'_>| {
        let options = GpuOptions::default().cache(None);
        let opened = Opened::new(&program, info, &options);
        let mut renderer = compute::Renderer::new(opened.gpu()).unwrap();
        let frame = renderer.render(&host_triangles(0.0)).unwrap();
        assert!(frame.colors[0].bytes.iter().any(|byte| *byte != 0));
        let frame = renderer.begin().unwrap();
        frame.submit().unwrap();
    };
    draws(info());
    draws(info().enabled_features(&sampling));
    let mut all = vk::PhysicalDeviceFeatures2::default().features(sampling);
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().shader_int8(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default().inline_uniform_block(true);
    draws(info().push_next(&mut all).push_next(&mut v12).push_next(&mut v13));
    let mut indexing = vk::PhysicalDeviceDescriptorIndexingFeatures::default()
        .shader_input_attachment_array_dynamic_indexing(true);
    let mut draw_parameters =
        vk::PhysicalDeviceShaderDrawParametersFeatures::default().shader_draw_parameters(true);
    let mut rendering = vk::PhysicalDeviceDynamicRenderingFeatures::default();
    let info = info().push_next(&mut indexing).push_next(&mut draw_parameters);
    draws(info.push_next(&mut rendering));
    assert_eq!(indexing.runtime_descriptor_array, vk::TRUE);
    assert_eq!(rendering.dynamic_rendering, vk::TRUE);
}

#[test]
fn a_device_without_what_is_needed_is_refused_by_name() {
    let program = Program::new();
    let options = GpuOptions::default().cache(None);
    // SAFETY: the info is valid.
    let opened = unsafe { Opened::with(&program, vk::DeviceCreateInfo::default(), &options) };
    match opened.err() {
        Some(Error::Device(text)) => {
            for part in ["synchronization2", "`robustBufferAccess` not enabled", "vk::Enable"] {
                assert!(text.contains(part), "{text}");
            }
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn buffers_and_images_that_lack_a_usage_are_refused_where_it_matters() {
    let program = Program::new();
    let options = GpuOptions::default().cache(None);
    let opened = Opened::new(&program, vk::DeviceCreateInfo::default(), &options);
    let gpu = opened.gpu();
    let refused = |result: Result<(), Error>, parts: &[&str]| match result {
        Err(Error::Usage(text)) => {
            assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        }
        other => panic!("{parts:?}: {other:?}"),
    };
    let adopt = |size, usage| {
        let (buffer, _) = opened.buffer(size, usage);
        // SAFETY: the device is adopted, and `opened` keeps the buffer until the end.
        unsafe { Buffer::adopt(gpu, &CallerBuffer { name: "mine", buffer, size, usage }) }
            .map(|_| ())
    };
    adopt(64, gpu.buffer_usage()).unwrap();
    let less = gpu.buffer_usage() & !vk::BufferUsageFlags::INDEX_BUFFER;
    refused(adopt(64, less), &["`mine`", "INDEX_BUFFER", "buffer_usage"]);
    if gpu.reads_by_address() {
        refused(adopt(60, gpu.buffer_usage()), &["`mine`", "60 bytes", "16"]);
    }
    let image = |usage, layout| {
        let image = opened.image(SIZE, vk::Format::R8G8B8A8_UNORM, usage);
        let whole = CallerImage::new(image, EXTENT, Format::Rgba8Unorm, usage, layout).name("mine");
        // SAFETY: as above; nothing runs that uses it.
        unsafe { Image::adopt(gpu, &whole) }
    };
    let mut renderer = compute::Renderer::new(gpu).unwrap();
    let mut draw = |target: &Image, load, from: Option<&Image>| {
        let mut pass = from.map_or_else(|| host_triangles(0.0), exchange);
        pass.colors = vec![ColorTarget::on_device(target, load)];
        pass.depth = None;
        // A frame that is refused in part can go on.
        let mut frame = renderer.begin().unwrap();
        let refused = frame.encode(&pass);
        frame.fill(&Buffer::<u32>::new(gpu, "b", 4, tilewright::vk::Memory::Device)?, 0)?;
        drop(frame);
        refused
    };
    let clear = || LoadOp::clear([0.0; 4]);
    let sampled = vk::ImageUsageFlags::SAMPLED;
    for layout in [UNDEFINED, vk::ImageLayout::PREINITIALIZED] {
        refused(image(COPIED, layout).map(drop), &["`mine`", "layout"]);
    }
    let unsampled = image(COPIED, GENERAL).unwrap();
    let only_written = image(vk::ImageUsageFlags::TRANSFER_DST, GENERAL).unwrap();
    let only_read = image(sampled | vk::ImageUsageFlags::TRANSFER_SRC, GENERAL).unwrap();
    let elsewhere = image(COPIED | sampled, READ).unwrap();
    draw(&only_written, clear(), None).unwrap();
    draw(&only_written, clear(), Some(&only_read)).unwrap();
    refused(draw(&only_written, LoadOp::Load, None), &["`mine`", "loaded", "TRANSFER_SRC"]);
    refused(draw(&only_read, clear(), None), &["`mine`", "stored", "TRANSFER_DST"]);
    refused(draw(&only_written, clear(), Some(&unsampled)), &["sampled", "SAMPLED"]);
    refused(draw(&only_written, clear(), Some(&elsewhere)), &["layout", "TRANSFER_SRC_OPTIMAL"]);
    refused(only_written.download(0).map(|_| ()), &["`mine`", "TRANSFER_SRC"]);
    refused(only_read.upload(&[vec![0; BYTES]]), &["`mine`", "TRANSFER_DST"]);
    let mut classic = tilewright::classic::Renderer::new(gpu).unwrap();
    let mut pass = host_triangles(0.0);
    pass.colors = vec![ColorTarget::on_device(&elsewhere, clear())];
    refused(classic.prepare(&pass).map(|_| ()), &["`mine`", "COLOR_ATTACHMENT"]);
}

/// A frame in the caller's commands that fails leaves nothing behind but commands that are not submitted.
#[test]
fn a_recording_that_fails_can_be_followed_by_another() {
    let program = Program::new();
    let options = GpuOptions::default().cache(None);
    let opened = Opened::new(&program, vk::DeviceCreateInfo::default(), &options);
    let gpu = opened.gpu();
    let usage = COPIED | vk::ImageUsageFlags::COLOR_ATTACHMENT;
    let raw = opened.image(SIZE, vk::Format::R8G8B8A8_UNORM, usage);
    let whole = CallerImage::new(raw, EXTENT, Format::Rgba8Unorm, usage, READ);
    // SAFETY: the device is adopted, and `opened` keeps the image until the end.
    let image = unsafe { Image::adopt(gpu, &whole) }.unwrap();
    let mut renderer = compute::Renderer::new(gpu).unwrap();
    let mut pass = host_triangles(0.0);
    pass.colors = vec![ColorTarget::on_device(&image, LoadOp::clear([0.2, 0.4, 0.6, 1.0]))];
    for fails in [true, false, true, false] {
        let commands = opened.begin();
        opened.change(commands, (raw, COLOR), (UNDEFINED, READ));
        // SAFETY: the commands are being recorded, and are submitted only if nothing fails.
        let borrowed = unsafe { CallerCommands::new(gpu, commands) };
        let recorded = renderer.record(borrowed, |frame| {
            frame.encode(&pass)?;
            match fails {
                true => Err(Error::Usage("enough".into())),
                false => Ok(()),
            }
        });
        assert_eq!(recorded.is_err(), fails);
        // Commands that are broken stay as they are until their pool goes.
        if let Ok(recorded) = recorded {
            let (read, at) = opened.buffer(BYTES as u64, vk::BufferUsageFlags::TRANSFER_DST);
            opened.copy_to(commands, (raw, READ), SIZE, read);
            opened.end(commands);
            let fence = opened.submit(commands);
            opened.wait(fence);
            // SAFETY: the buffer has as many bytes, and the device is done with it.
            let bytes = unsafe { std::slice::from_raw_parts(at, BYTES) };
            assert!(bytes == expected([51, 102, 153, 255], 0.0)[0]);
            drop(recorded);
        }
    }
    // The device of one `Gpu` is not that of another.
    let other = crate::common::gpu();
    let commands = opened.begin();
    // SAFETY: nothing is recorded.
    let borrowed = unsafe { CallerCommands::new(gpu, commands) };
    let mut elsewhere = compute::Renderer::new(&other).unwrap();
    let refused = elsewhere.record(borrowed, |frame| frame.encode(&pass));
    assert!(matches!(refused, Err(Error::Usage(_))));
    opened.end(commands);
    // What the library started by itself, the caller can wait for.
    let frame = renderer.begin().unwrap();
    let (semaphore, value) = frame.submit().unwrap().vulkan();
    let (semaphores, values) = ([semaphore], [value]);
    let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
    // SAFETY: the semaphore belongs to the device.
    unsafe { opened.device.wait_semaphores(&info, 60_000_000_000) }.unwrap();
}

#[test]
fn the_example_draws_over_what_the_program_drew() {
    let program = Program::new();
    // SAFETY: the instance is alive.
    let picture = unsafe { ash_program::draw(&program.instance, Extent::new(160, 120)) }.unwrap();
    assert_eq!(picture.texel(2, 2), [89, 149, 188, 255], "the program's own colour");
    let corners = [(80, 16), (140, 105), (20, 105)].map(|(x, y)| picture.texel(x, y));
    for (main, corner) in corners.iter().enumerate() {
        assert!((0..3).all(|n| (corner[n] > 200) == (n == main)), "{corners:?}");
    }
}
