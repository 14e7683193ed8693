//! A program that uses Vulkan by itself, as a caller of the library may: it opens a device and makes buffers, images and
//! commands. The validation layer watches it, hazards between commands included.

use ash::{ext, vk};
use std::{
    ffi::{CStr, c_void},
    sync::Mutex,
};
use tilewright::{
    Result,
    vk::{CallerDevice, Enable, Gpu, GpuOptions},
};

/// The instance of the program.
pub struct Program {
    pub instance: ash::Instance,
    messenger: (ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT),
    messages: Box<Mutex<Vec<String>>>,
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data; the program outlives its messenger.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map(CStr::to_string_lossy).unwrap_or_default();
        (text, &*(messages as *const Mutex<Vec<String>>))
    };
    // `src/vk/instance.rs` has the messages of an old layer about this extension, and why they are wrong.
    let derivatives =
        ["compute_shader_derivatives", "ComputeDerivativeGroupLinear", "(with derivatives)"];
    if !derivatives.iter().any(|part| text.contains(part)) {
        messages.lock().unwrap().push(text.into_owned());
    }
    vk::FALSE
}

impl Program {
    pub fn new() -> Self {
        let messages = Box::<Mutex<Vec<String>>>::default();
        let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
        let extensions = [ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()];
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let hazards = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&hazards);
        let info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions)
            .push_next(&mut features);
        type Severity = vk::DebugUtilsMessageSeverityFlagsEXT;
        let listener = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(Severity::WARNING | Severity::ERROR)
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(on_message))
            .user_data(&*messages as *const Mutex<Vec<String>> as *mut c_void);
        // SAFETY: everything in the infos is alive. The loader stays: drivers do not survive being unloaded.
        unsafe {
            let entry = std::mem::ManuallyDrop::new(ash::Entry::load().unwrap());
            let instance = entry.create_instance(&info, None).unwrap();
            let debug = ext::debug_utils::Instance::new(&entry, &instance);
            let messenger = debug.create_debug_utils_messenger(&listener, None).unwrap();
            Self { instance, messenger: (debug, messenger), messages }
        }
    }

    /// What the layer has said.
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap().clone()
    }

    /// The driver under test, and the family of its queues.
    pub fn physical(&self) -> (vk::PhysicalDevice, u32) {
        let uuid = super::device_under_test().uuid;
        // SAFETY: the instance is alive.
        let all = unsafe { self.instance.enumerate_physical_devices() }.unwrap();
        let is_it = |physical: &vk::PhysicalDevice| {
            let mut ids = vk::PhysicalDeviceVulkan11Properties::default();
            let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
            // SAFETY: as above.
            unsafe { self.instance.get_physical_device_properties2(*physical, &mut all) };
            ids.device_uuid.iter().map(|b| format!("{b:02x}")).collect::<String>() == uuid
        };
        (all.into_iter().find(is_it).unwrap(), 0)
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: all that came from the instance is gone.
        unsafe {
            self.messenger.0.destroy_debug_utils_messenger(self.messenger.1, None);
            self.instance.destroy_instance(None);
        }
        if !std::thread::panicking() {
            assert_eq!(self.messages(), [""; 0], "the validation layer is silent");
        }
    }
}

/// The device of the program. `gpu` is the library's view of it.
pub struct Opened<'p> {
    pub program: &'p Program,
    physical: vk::PhysicalDevice,
    pub device: ash::Device,
    queue: vk::Queue,
    pub gpu: Option<Gpu>,
    pool: vk::CommandPool,
    /// Buffers and images to be destroyed at the end.
    made: Mutex<Vec<(vk::Buffer, vk::Image, vk::DeviceMemory)>>,
}

/// A queue that does not go on, see [`Opened::hold`].
pub struct Held<'o> {
    device: &'o ash::Device,
    queue: vk::Queue,
    semaphore: vk::Semaphore,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        let info = vk::SemaphoreSignalInfo::default().semaphore(self.semaphore).value(1);
        // SAFETY: the queue waits for the semaphore alone, and is idle when it is destroyed.
        unsafe {
            self.device.signal_semaphore(&info).unwrap();
            self.device.queue_wait_idle(self.queue).unwrap();
            self.device.destroy_semaphore(self.semaphore, None);
        }
    }
}

impl<'p> Opened<'p> {
    /// Opens the driver under test with what `info` asks for and what the library needs.
    pub fn new(program: &'p Program, info: vk::DeviceCreateInfo<'_>, options: &GpuOptions) -> Self {
        let (physical, _) = program.physical();
        // SAFETY: the instance is alive; the chains are those of tests, which nobody else has.
        unsafe {
            let mut enable = Enable::on(&program.instance, physical).unwrap();
            Self::with(program, enable.add_to(info), options).unwrap()
        }
    }

    /// Opens the driver under test with what `info` asks for, queues excepted.
    ///
    /// # Safety
    /// The info is valid.
    pub unsafe fn with(
        program: &'p Program,
        info: vk::DeviceCreateInfo<'_>,
        options: &GpuOptions,
    ) -> Result<Self> {
        let (physical, family) = program.physical();
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(family)
            .queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo {
            p_queue_create_infos: queues.as_ptr(),
            queue_create_info_count: 1,
            ..info
        };
        // SAFETY: the instance is alive and the info is valid.
        unsafe {
            let device = program.instance.create_device(physical, &info, None).unwrap();
            let queue = device.get_device_queue(family, 0);
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&pool, None).unwrap();
            let made = Mutex::default();
            let mut opened = Self { program, physical, device, queue, gpu: None, pool, made };
            let whole = CallerDevice {
                instance: &program.instance,
                physical,
                device: &opened.device,
                create_info: &info,
                queue,
                family,
                debug_utils: true,
            };
            opened.gpu = Some(Gpu::adopt(&whole, options)?);
            Ok(opened)
        }
    }

    pub fn gpu(&self) -> &Gpu {
        self.gpu.as_ref().unwrap()
    }

    fn allocate(
        &self,
        needs: vk::MemoryRequirements,
        flags: vk::MemoryPropertyFlags,
        addressed: bool,
    ) -> vk::DeviceMemory {
        // SAFETY: instance and device are alive.
        unsafe {
            let kinds = self.program.instance.get_physical_device_memory_properties(self.physical);
            let fits = |n: &u32| {
                let kind = kinds.memory_types[*n as usize];
                needs.memory_type_bits & 1 << n != 0 && kind.property_flags.contains(flags)
            };
            let kind = (0..kinds.memory_type_count).find(fits).unwrap();
            let mut address = vk::MemoryAllocateFlagsInfo::default()
                .flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
            let mut info = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(kind);
            if addressed {
                info = info.push_next(&mut address);
            }
            self.device.allocate_memory(&info, None).unwrap()
        }
    }

    /// A buffer that host and device see, with zeros in it, and the address of its first byte.
    pub fn buffer(&self, size: u64, usage: vk::BufferUsageFlags) -> (vk::Buffer, *mut u8) {
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        let coherent =
            vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        // SAFETY: the device is alive.
        unsafe {
            let buffer = self.device.create_buffer(&info, None).unwrap();
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let addressed = usage.contains(vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS);
            let memory = self.allocate(needs, coherent, addressed);
            self.device.bind_buffer_memory(buffer, memory, 0).unwrap();
            let whole = vk::MemoryMapFlags::empty();
            let at = self.device.map_memory(memory, 0, vk::WHOLE_SIZE, whole).unwrap();
            std::ptr::write_bytes(at.cast::<u8>(), 0, size as usize);
            self.made.lock().unwrap().push((buffer, vk::Image::null(), memory));
            (buffer, at.cast())
        }
    }

    /// An image of one level.
    pub fn image(
        &self,
        (width, height): (u32, u32),
        format: vk::Format,
        usage: vk::ImageUsageFlags,
    ) -> vk::Image {
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        // SAFETY: the device is alive.
        unsafe {
            let image = self.device.create_image(&info, None).unwrap();
            let needs = self.device.get_image_memory_requirements(image);
            let memory = self.allocate(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL, false);
            self.device.bind_image_memory(image, memory, 0).unwrap();
            self.made.lock().unwrap().push((vk::Buffer::null(), image, memory));
            image
        }
    }

    /// A command buffer that is being recorded.
    pub fn begin(&self) -> vk::CommandBuffer {
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        // SAFETY: the device is alive, and one thread uses the pool.
        unsafe {
            let commands = self.device.allocate_command_buffers(&info).unwrap()[0];
            let info = vk::CommandBufferBeginInfo::default();
            self.device.begin_command_buffer(commands, &info).unwrap();
            commands
        }
    }

    pub fn end(&self, commands: vk::CommandBuffer) {
        // SAFETY: the commands are being recorded.
        unsafe { self.device.end_command_buffer(commands) }.unwrap();
    }

    /// Submits the commands. The fence tells when they have ended.
    pub fn submit(&self, commands: vk::CommandBuffer) -> vk::Fence {
        let all = [commands];
        // SAFETY: the commands are complete, and this thread alone uses the queue.
        unsafe {
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            let submit = [vk::SubmitInfo::default().command_buffers(&all)];
            self.device.queue_submit(self.queue, &submit, fence).unwrap();
            fence
        }
    }

    /// Keeps the queue from going on until what is returned is dropped.
    pub fn hold(&self) -> Held<'_> {
        let mut timeline = vk::SemaphoreTypeCreateInfo::default()
            .semaphore_type(vk::SemaphoreType::TIMELINE)
            .initial_value(0);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut timeline);
        // SAFETY: this thread alone uses the queue, and the semaphore stays until the end of the test.
        unsafe {
            let semaphore = self.device.create_semaphore(&info, None).unwrap();
            let (semaphores, values) = ([semaphore], [1]);
            let mut values =
                vk::TimelineSemaphoreSubmitInfo::default().wait_semaphore_values(&values);
            let submit = vk::SubmitInfo::default()
                .wait_semaphores(&semaphores)
                .wait_dst_stage_mask(&[vk::PipelineStageFlags::ALL_COMMANDS])
                .push_next(&mut values);
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null()).unwrap();
            Held { device: &self.device, queue: self.queue, semaphore }
        }
    }

    pub fn wait(&self, fence: vk::Fence) {
        // SAFETY: the fence was submitted.
        unsafe {
            self.device.wait_for_fences(&[fence], true, 120_000_000_000).unwrap();
            self.device.destroy_fence(fence, None);
        }
    }

    /// A change of the layout of an image, after and before everything else.
    pub fn change(
        &self,
        commands: vk::CommandBuffer,
        (image, aspect): (vk::Image, vk::ImageAspectFlags),
        (from, to): (vk::ImageLayout, vk::ImageLayout),
    ) {
        let range = vk::ImageSubresourceRange::default().level_count(1).layer_count(1);
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .old_layout(from)
            .new_layout(to)
            .image(image)
            .subresource_range(range.aspect_mask(aspect))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the commands are being recorded.
        unsafe { self.device.cmd_pipeline_barrier2(commands, &info) };
    }

    /// A copy of a colour image, which is in `layout`, to the start of `buffer`.
    pub fn copy_to(
        &self,
        commands: vk::CommandBuffer,
        (image, layout): (vk::Image, vk::ImageLayout),
        (width, height): (u32, u32),
        buffer: vk::Buffer,
    ) {
        let color = vk::ImageAspectFlags::COLOR;
        let region = [vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default().aspect_mask(color).layer_count(1),
            )
            .image_extent(vk::Extent3D { width, height, depth: 1 })];
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the commands are being recorded, and the buffer is large enough.
        unsafe {
            self.device.cmd_copy_image_to_buffer(commands, image, layout, buffer, &region);
            self.device.cmd_pipeline_barrier2(commands, &info);
        }
    }
}

impl Drop for Opened<'_> {
    fn drop(&mut self) {
        self.gpu = None;
        // SAFETY: the tests have waited for all that they submitted.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            for (buffer, image, memory) in self.made.get_mut().unwrap().drain(..) {
                self.device.destroy_buffer(buffer, None);
                self.device.destroy_image(image, None);
                self.device.free_memory(memory, None);
            }
            self.device.destroy_device(None);
        }
    }
}
