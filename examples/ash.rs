//! A program that has opened a device of its own records a pass into its own command buffer. The pass draws into the
//! program's own image, over what the program put there.
//!
//! `cargo run --release --example ash --features glsl` writes `ash.png`.

use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::vk::ash::{self, vk};
use tilewright::vk::{CallerCommands, CallerDevice, CallerImage, Enable};
use tilewright::{
    ColorTarget, Draw, Extent, Format, Gpu, GpuOptions, Image, LoadOp, Pass, Picture, Pipeline,
    Renderer, Shader, Stage,
};

/// Draws a triangle on a device that `instance` has, which was created for Vulkan 1.3.
///
/// # Safety
/// The instance is alive.
pub unsafe fn draw(instance: &ash::Instance, extent: Extent) -> Result<Picture, Box<dyn Error>> {
    unsafe {
        // The program's device. `Enable` adds what tilewright needs to what the program wants.
        let physical = instance.enumerate_physical_devices()?[0];
        let families = instance.get_physical_device_queue_family_properties(physical);
        let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let family = families.iter().position(|family| family.queue_flags.contains(both));
        let family = family.ok_or("no queue that draws and computes")? as u32;
        let mut enable = Enable::on(instance, physical)?;
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(family)
            .queue_priorities(&[1.0])];
        let create_info =
            enable.add_to(vk::DeviceCreateInfo::default().queue_create_infos(&queues));
        let device = instance.create_device(physical, &create_info, None)?;
        let queue = device.get_device_queue(family, 0);

        // The program's image, and a buffer that the host reads.
        let usage = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R8G8B8A8_SRGB)
            .extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        let image = device.create_image(&info, None)?;
        let bytes = extent.pixels() * 4;
        let info = vk::BufferCreateInfo::default()
            .size(bytes as u64)
            .usage(vk::BufferUsageFlags::TRANSFER_DST);
        let read = device.create_buffer(&info, None)?;
        let kinds = instance.get_physical_device_memory_properties(physical);
        let allocate = |needs: vk::MemoryRequirements, flags| {
            let fits = |n: &u32| {
                let kind = kinds.memory_types[*n as usize];
                needs.memory_type_bits & 1 << n != 0 && kind.property_flags.contains(flags)
            };
            let kind = (0..kinds.memory_type_count).find(fits).unwrap_or_default();
            let info = vk::MemoryAllocateInfo::default();
            device.allocate_memory(&info.allocation_size(needs.size).memory_type_index(kind), None)
        };
        let needs = device.get_image_memory_requirements(image);
        let image_memory = allocate(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
        device.bind_image_memory(image, image_memory, 0)?;
        let coherent =
            vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let read_memory = allocate(device.get_buffer_memory_requirements(read), coherent)?;
        device.bind_buffer_memory(read, read_memory, 0)?;

        // What tilewright has to know of them.
        let whole = CallerDevice {
            instance,
            physical,
            device: &device,
            create_info: &create_info,
            queue,
            family,
            debug_utils: false,
        };
        let gpu = Gpu::adopt(&whole, &GpuOptions::default())?;
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        let format = Format::Rgba8Srgb;
        let target = CallerImage::new(image, extent, format, usage, layout);
        let target = Image::adopt(&gpu, &target)?;
        let vertex = Shader::from_glsl(Stage::Vertex, "hello", include_str!("hello.vert"))?;
        let fragment = Shader::from_glsl(Stage::Fragment, "hello", include_str!("hello.frag"))?;
        let pass = Pass::new("triangle", extent)
            .colors([ColorTarget::on_device(&target, LoadOp::Load)])
            .pipelines([Pipeline::new("hello", vertex, fragment)])
            .draws([Draw::new(0, 3)]);
        let mut renderer = Renderer::new(&gpu)?;

        // The program's commands: clear the image, let tilewright draw, copy the image to the buffer.
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        let pool = device.create_command_pool(&info, None)?;
        let info =
            vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&info)?[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())?;
        let range = vk::ImageSubresourceRange::default()
            .aspect_mask(vk::ImageAspectFlags::COLOR)
            .level_count(1)
            .layer_count(1);
        let written = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let change = |from, to| {
            let barriers = [vk::ImageMemoryBarrier2::default()
                .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
                .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
                .dst_access_mask(vk::AccessFlags2::TRANSFER_READ | vk::AccessFlags2::TRANSFER_WRITE)
                .old_layout(from)
                .new_layout(to)
                .image(image)
                .subresource_range(range)];
            let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
            device.cmd_pipeline_barrier2(commands, &info);
        };
        change(vk::ImageLayout::UNDEFINED, written);
        let sky = vk::ClearColorValue { float32: [0.1, 0.3, 0.5, 1.0] };
        device.cmd_clear_color_image(commands, image, written, &sky, &[range]);
        change(written, layout);
        let recorded =
            renderer.record(CallerCommands::new(&gpu, commands), |frame| frame.encode(&pass))?;
        let region = [vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default()
                    .aspect_mask(vk::ImageAspectFlags::COLOR)
                    .layer_count(1),
            )
            .image_extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 })];
        device.cmd_copy_image_to_buffer(commands, image, layout, read, &region);
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        device.cmd_pipeline_barrier2(commands, &info);
        device.end_command_buffer(commands)?;
        let fence = device.create_fence(&vk::FenceCreateInfo::default(), None)?;
        let all = [commands];
        device.queue_submit(queue, &[vk::SubmitInfo::default().command_buffers(&all)], fence)?;
        device.wait_for_fences(&[fence], true, 60_000_000_000)?;
        drop(recorded);

        let mapped =
            device.map_memory(read_memory, 0, bytes as u64, vk::MemoryMapFlags::empty())?;
        let bytes = std::slice::from_raw_parts(mapped.cast::<u8>(), bytes).to_vec();

        // First all that tilewright made, then what the program made.
        drop((renderer, pass, target, gpu));
        device.destroy_fence(fence, None);
        device.destroy_command_pool(pool, None);
        device.destroy_buffer(read, None);
        device.destroy_image(image, None);
        device.free_memory(read_memory, None);
        device.free_memory(image_memory, None);
        device.destroy_device(None);
        Ok(Picture { extent, format: Format::Rgba8Srgb, bytes })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // SAFETY: the instance lives until the picture is there.
    unsafe {
        let entry = ash::Entry::load()?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        let instance = entry.create_instance(&info, None)?;
        let picture = draw(&instance, Extent::new(640, 480))?;
        png::write_png(&picture, &[], File::create("ash.png")?)?;
        instance.destroy_instance(None);
    }
    Ok(())
}
