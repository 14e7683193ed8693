//! The program's own Vulkan: a device that can show pictures in a window, and a swapchain.

use std::error::Error;
use tilewright::compute::Recorded;
use tilewright::vk::ash::{self, khr, vk};
use tilewright::vk::{CallerCommands, CallerDevice, Enable};
use tilewright::{Extent, Gpu, GpuOptions, Image};
use winit::{
    raw_window_handle::{HasDisplayHandle, HasWindowHandle},
    window::Window,
};

/// A device and the images of a window. Each frame waits for the one before it.
pub struct Screen {
    _entry: ash::Entry,
    instance: ash::Instance,
    surfaces: khr::surface::Instance,
    surface: vk::SurfaceKHR,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    swapchains: khr::swapchain::Device,
    swapchain: vk::SwapchainKHR,
    extent: Extent,
    /// The images, each with the semaphore that says that its picture is there.
    images: Vec<(vk::Image, vk::Semaphore)>,
    /// Says that an image is free.
    acquired: vk::Semaphore,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    /// Says that the last frame has ended.
    ended: vk::Fence,
    /// What the last frame uses.
    recorded: Option<Recorded>,
    /// Whether the window no longer fits the images.
    outdated: bool,
}

impl Screen {
    /// A device that shows pictures in `window`, and tilewright's view of it. The window outlives the device, and the device
    /// all that is made from the view.
    pub fn new(window: &Window, options: &GpuOptions) -> Result<(Self, Gpu), Box<dyn Error>> {
        let (display, handle) =
            (window.display_handle()?.as_raw(), window.window_handle()?.as_raw());
        // SAFETY: everything that is made here lives until `drop`, in which the device is idle; the window outlives it.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let info = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_extension_names(ash_window::enumerate_required_extensions(display)?);
            let instance = entry.create_instance(&info, None)?;
            let surfaces = khr::surface::Instance::new(&entry, &instance);
            let surface = ash_window::create_surface(&entry, &instance, display, handle, None)?;

            // The first device that has what tilewright needs, with a queue that draws, computes and shows.
            let mut fits = Vec::new();
            for physical in instance.enumerate_physical_devices()? {
                let families = instance.get_physical_device_queue_family_properties(physical);
                for (family, properties) in (0..).zip(families) {
                    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
                    if properties.queue_flags.contains(both)
                        && Enable::on(&instance, physical).is_ok()
                        && surfaces
                            .get_physical_device_surface_support(physical, family, surface)?
                    {
                        fits.push((physical, family));
                    }
                }
            }
            let &(physical, family) =
                fits.first().ok_or("no device shows pictures in this window")?;
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&[1.0])];
            let extensions = [khr::swapchain::NAME.as_ptr()];
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions);
            let mut enable = Enable::on(&instance, physical)?;
            let create_info = enable.add_to(info);
            let device = instance.create_device(physical, &create_info, None)?;
            let queue = device.get_device_queue(family, 0);
            let view = CallerDevice {
                instance: &instance,
                physical,
                device: &device,
                create_info: &create_info,
                queue,
                family,
                debug_utils: false,
            };
            let gpu = Gpu::adopt(&view, options)?;

            let info = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            let pool = device.create_command_pool(&info, None)?;
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info)?[0];
            let signalled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
            let mut screen = Self {
                queue,
                swapchains: khr::swapchain::Device::new(&instance, &device),
                swapchain: vk::SwapchainKHR::null(),
                extent: Extent::new(0, 0),
                images: Vec::new(),
                acquired: device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None)?,
                ended: device.create_fence(&signalled, None)?,
                recorded: None,
                outdated: false,
                _entry: entry,
                instance,
                surfaces,
                surface,
                physical,
                device,
                pool,
                commands,
            };
            let size = window.inner_size();
            screen.resize(Extent::new(size.width, size.height))?;
            Ok((screen, gpu))
        }
    }

    /// Size of the images.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Whether the images are right for a window of this size.
    pub fn fits(&self, window: Extent) -> bool {
        !self.outdated && window == self.extent
    }

    /// Makes images for a window of this size.
    pub fn resize(&mut self, window: Extent) -> Result<(), Box<dyn Error>> {
        let (physical, surface) = (self.physical, self.surface);
        // SAFETY: the handles are alive; the device is idle when images go.
        unsafe {
            self.device.device_wait_idle()?;
            self.recorded = None;
            let can = self.surfaces.get_physical_device_surface_capabilities(physical, surface)?;
            let formats = self.surfaces.get_physical_device_surface_formats(physical, surface)?;
            let srgb = [vk::Format::B8G8R8A8_SRGB, vk::Format::R8G8B8A8_SRGB];
            let format = formats.iter().find(|format| srgb.contains(&format.format));
            let format = format.ok_or("the window shows no sRGB colours")?;
            let (least, most) = (can.min_image_extent, can.max_image_extent);
            let (width, height) = match can.current_extent.width {
                u32::MAX => (
                    window.width.clamp(least.width, most.width),
                    window.height.clamp(least.height, most.height),
                ),
                _ => (can.current_extent.width, can.current_extent.height),
            };
            let most = if can.max_image_count == 0 { u32::MAX } else { can.max_image_count };
            let info = vk::SwapchainCreateInfoKHR::default()
                .surface(surface)
                .min_image_count((can.min_image_count + 1).min(most))
                .image_format(format.format)
                .image_color_space(format.color_space)
                .image_extent(vk::Extent2D { width, height })
                .image_array_layers(1)
                .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
                .pre_transform(can.current_transform)
                .composite_alpha(vk::CompositeAlphaFlagsKHR::OPAQUE)
                .present_mode(vk::PresentModeKHR::FIFO)
                .clipped(true)
                .old_swapchain(self.swapchain);
            let swapchain = self.swapchains.create_swapchain(&info, None)?;
            self.forget_images();
            self.swapchain = swapchain;
            for image in self.swapchains.get_swapchain_images(swapchain)? {
                let info = vk::SemaphoreCreateInfo::default();
                self.images.push((image, self.device.create_semaphore(&info, None)?));
            }
            self.extent = Extent::new(width, height);
        }
        self.outdated = false;
        Ok(())
    }

    /// Records a frame that draws to `picture`, and shows the picture when it is drawn. The picture is an image of tilewright
    /// and as large as the window.
    pub fn show(
        &mut self,
        gpu: &Gpu,
        picture: &Image,
        frame: impl FnOnce(CallerCommands) -> tilewright::Result<Recorded>,
    ) -> Result<(), Box<dyn Error>> {
        let (device, commands) = (self.device.clone(), self.commands);
        // SAFETY: the fence says that the device is done with the commands and with what they use. The queue is used by this
        // thread alone, and the semaphores are waited for before they are signalled again.
        unsafe {
            device.wait_for_fences(&[self.ended], true, u64::MAX)?;
            self.recorded = None;
            let acquired = self.swapchains.acquire_next_image(
                self.swapchain,
                u64::MAX,
                self.acquired,
                vk::Fence::null(),
            );
            let number = match acquired {
                Ok((number, suboptimal)) => {
                    self.outdated |= suboptimal;
                    number
                }
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                    self.outdated = true;
                    return Ok(());
                }
                Err(error) => return Err(error.into()),
            };
            let (image, shown) = self.images[number as usize];

            let once = vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT;
            device.begin_command_buffer(
                commands,
                &vk::CommandBufferBeginInfo::default().flags(once),
            )?;
            self.recorded = Some(frame(CallerCommands::new(gpu, commands))?);
            use vk::ImageLayout as Layout;
            let rest = Layout::SHADER_READ_ONLY_OPTIMAL; // of images of tilewright
            let from = picture.vulkan();
            self.change(&[
                (from, rest, Layout::TRANSFER_SRC_OPTIMAL),
                (image, Layout::UNDEFINED, Layout::TRANSFER_DST_OPTIMAL),
            ]);
            // A copy that converts: the window's image may have blue before red.
            let layers = vk::ImageSubresourceLayers::default()
                .aspect_mask(vk::ImageAspectFlags::COLOR)
                .layer_count(1);
            let (width, height) = (self.extent.width as i32, self.extent.height as i32);
            let corners = [vk::Offset3D::default(), vk::Offset3D { x: width, y: height, z: 1 }];
            let region = [vk::ImageBlit::default()
                .src_subresource(layers)
                .src_offsets(corners)
                .dst_subresource(layers)
                .dst_offsets(corners)];
            device.cmd_blit_image(
                commands,
                from,
                Layout::TRANSFER_SRC_OPTIMAL,
                image,
                Layout::TRANSFER_DST_OPTIMAL,
                &region,
                vk::Filter::NEAREST,
            );
            self.change(&[
                (from, Layout::TRANSFER_SRC_OPTIMAL, rest),
                (image, Layout::TRANSFER_DST_OPTIMAL, Layout::PRESENT_SRC_KHR),
            ]);
            device.end_command_buffer(commands)?;

            let (waits, signals, all) = ([self.acquired], [shown], [commands]);
            let submit = vk::SubmitInfo::default()
                .wait_semaphores(&waits)
                .wait_dst_stage_mask(&[vk::PipelineStageFlags::ALL_COMMANDS])
                .command_buffers(&all)
                .signal_semaphores(&signals);
            device.reset_fences(&[self.ended])?;
            device.queue_submit(self.queue, &[submit], self.ended)?;
            let (swapchains, numbers) = ([self.swapchain], [number]);
            let present = vk::PresentInfoKHR::default()
                .wait_semaphores(&signals)
                .swapchains(&swapchains)
                .image_indices(&numbers);
            match self.swapchains.queue_present(self.queue, &present) {
                Ok(suboptimal) => self.outdated |= suboptimal,
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.outdated = true,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Changes the layouts of images, after and before everything else.
    unsafe fn change(&self, images: &[(vk::Image, vk::ImageLayout, vk::ImageLayout)]) {
        let range = vk::ImageSubresourceRange::default()
            .aspect_mask(vk::ImageAspectFlags::COLOR)
            .level_count(1)
            .layer_count(1);
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let access = vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE;
        let barrier = |&(image, from, to)| {
            vk::ImageMemoryBarrier2::default()
                .src_stage_mask(all)
                .src_access_mask(access)
                .dst_stage_mask(all)
                .dst_access_mask(access)
                .old_layout(from)
                .new_layout(to)
                .image(image)
                .subresource_range(range)
        };
        let barriers: Vec<_> = images.iter().map(barrier).collect();
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the commands are being recorded, and the images are in these layouts.
        unsafe { self.device.cmd_pipeline_barrier2(self.commands, &info) };
    }

    /// Lets go of the images. The device is idle.
    unsafe fn forget_images(&mut self) {
        for (_, semaphore) in self.images.drain(..) {
            // SAFETY: nobody uses it.
            unsafe { self.device.destroy_semaphore(semaphore, None) };
        }
        // SAFETY: as above.
        unsafe { self.swapchains.destroy_swapchain(self.swapchain, None) };
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // SAFETY: nothing that was made from the device is left, and it is idle.
        unsafe {
            let _ = self.device.device_wait_idle();
            self.recorded = None;
            self.forget_images();
            self.device.destroy_semaphore(self.acquired, None);
            self.device.destroy_fence(self.ended, None);
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.surfaces.destroy_surface(self.surface, None);
            self.instance.destroy_instance(None);
        }
    }
}
