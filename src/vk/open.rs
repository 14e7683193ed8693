//! Opens devices, and adopts those that the caller opened.

use super::{
    adopt::CallerDevice,
    cache, capability,
    device::{self, DeviceInfo, DeviceKind, Require},
    enable,
    error::describe,
    extension::{EXTENSIONS, Structure},
    gpu::{Gpu, Shared, TimestampUnit},
    instance::Instance,
    limits::{draw_limits, limits},
    requirements::{COMPUTE_DERIVATIVES, Probe},
    sampler::SamplerLimits,
    table,
    table_sizes::TableSizes,
};
use crate::error::{Error, Result};
use ash::{ext, vk};
use gpu_allocator::{
    AllocationSizes,
    vulkan::{Allocator, AllocatorCreateDesc},
};
use std::{
    ffi::CStr,
    path::PathBuf,
    sync::{
        Arc, Mutex, RwLock,
        atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering},
    },
    time::Duration,
};

/// How to open a device. [`Gpu::adopt`] takes only the last four fields: the rest is the caller's.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GpuOptions {
    /// Index, UUID or name pattern; `None` takes the best one.
    pub device: Option<String>,
    /// Which kind of device is acceptable.
    pub require: Require,
    /// Loads the validation layer, with synchronization validation. Its messages go to the crate `log` and to
    /// [`Gpu::validation_messages`], and not to standard error.
    pub validation: bool,
    /// How long one submission may take before the device counts as lost.
    pub timeout: Duration,
    /// A folder, such as [`crate::cache_folder`], where compiled pipelines are kept from run to run; `None` keeps none. For
    /// compiled GLSL see [`crate::shader::keep_compiled`].
    pub cache: Option<PathBuf>,
    /// Size of the resource table.
    pub table: TableSizes,
    /// Lets kernels reach buffers by address if that is faster on this driver. The validation layer does not
    /// see accesses by address when it looks for missing barriers.
    pub by_address: bool,
}

impl GpuOptions {
    /// How long a submission may take by default. A CPU driver compiles kernels at their first
    /// dispatch, on a busy machine in tens of seconds.
    pub const TIMEOUT: Duration = Duration::from_secs(120);

    /// The options that the environment asks for: the device of the variable `TILEWRIGHT_DEVICE`, the
    /// validation layer if `TILEWRIGHT_VALIDATION` is `1`, and compiled pipelines in [`crate::cache_folder`].
    pub fn from_env() -> Self {
        let variable = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
        Self {
            device: variable(device::DEVICE_VARIABLE),
            validation: variable("TILEWRIGHT_VALIDATION").is_some_and(|value| value == "1"),
            cache: crate::cache_folder(),
            ..Self::default()
        }
    }

    setters! {
        require: Require,
        validation: bool,
        timeout: Duration,
        table: TableSizes,
        by_address: bool,
        ;
        into
        device: Option<String>,
        cache: Option<PathBuf>,
    }
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            device: None,
            require: Require::Any,
            validation: false,
            timeout: Self::TIMEOUT,
            cache: None,
            table: TableSizes::default(),
            by_address: true,
        }
    }
}

/// Devices that this program has opened so far.
static OPENED: AtomicU32 = AtomicU32::new(0);

/// A device that was opened, by us or by the caller.
struct Opened {
    physical: vk::PhysicalDevice,
    /// With what is enabled.
    probe: Probe,
    info: DeviceInfo,
    device: ash::Device,
    queue: vk::Queue,
    family: u32,
    adopted: bool,
}

impl Gpu {
    /// Opens the device that `options` asks for.
    ///
    /// # Errors
    /// [`Error::Device`] without a loader, a driver or a device that meets all [`super::REQUIREMENTS`];
    /// the message names the device and the missing feature, and says what to do.
    pub fn open(options: &GpuOptions) -> Result<Self> {
        let instance = Instance::new(options.validation)?;
        let device::Candidate { raw: physical, probe, info } =
            device::pick(&instance, options.device.as_deref(), options.require)?;
        let family = probe.family();
        let family =
            family.ok_or_else(|| Error::Device(format!("{} has no compute queue", info.name)))?;
        let device = create_device(&instance.raw, physical, &probe, family)
            .map_err(|e| describe(&info.name, "opening it", e))?;
        // SAFETY: one queue of `family` was created with the device.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let opened = Opened { physical, probe, info, device, queue, family, adopted: false };
        Self::with(instance, opened, options)
    }

    /// Takes a device that the caller opened, with all that [`super::Enable`] asks for. `options` says how: of its fields,
    /// `timeout`, `cache`, `table` and `by_address` count. Nobody closes the device but the caller.
    ///
    /// # Errors
    /// [`Error::Device`] if something is not enabled that is required ([`super::REQUIREMENTS`]), or if the queues of the
    /// family do not compute; the message names the feature.
    ///
    /// # Safety
    /// * All members of `device` belong together. The instance was created for Vulkan 1.3 or later. `create_info` is what the
    ///   device was created with, its chain included. The queue belongs to the family, and the family was named in
    ///   `create_info`.
    /// * Instance and device live until the last handle is gone that was made from this [`Gpu`]: its clones, buffers, images,
    ///   renderers, recordings and whatever else.
    /// * Vulkan lets one thread at a time use a queue. While a function of this library runs that was given something of this
    ///   device, nobody else uses the queue. A queue of its own for this library meets the condition by itself. One queue
    ///   is adopted once: two adoptions do not know of each other.
    pub unsafe fn adopt(device: &CallerDevice<'_>, options: &GpuOptions) -> Result<Self> {
        let CallerDevice { instance, physical, create_info, family, queue, debug_utils, .. } =
            *device;
        // SAFETY: the caller's promise.
        let (mut probe, index) = unsafe {
            let all = instance.enumerate_physical_devices().unwrap_or_default();
            let index = all.iter().position(|one| *one == physical).unwrap_or_default();
            (Probe::read(instance, physical), index)
        };
        // SAFETY: the caller's promise: the info and its chain are those of a device.
        unsafe { enable::keep_enabled(&mut probe, create_info) };
        let info = device::describe(index, &probe);
        device::check(&info, true)?;
        let flags = probe.queues.get(family as usize).map(|family| family.queue_flags);
        if !flags.is_some_and(|flags| flags.contains(vk::QueueFlags::COMPUTE)) {
            return Err(Error::Device(format!(
                "queue family {family} of {} does not compute: take one with VK_QUEUE_COMPUTE_BIT",
                info.name
            )));
        }
        let device = device.device.clone();
        let opened = Opened { physical, probe, info, device, queue, family, adopted: true };
        Self::with(Instance::adopted(instance.clone(), debug_utils), opened, options)
    }

    fn with(instance: Instance, opened: Opened, options: &GpuOptions) -> Result<Self> {
        let Opened { physical, probe, info, device, queue, family, adopted } = opened;
        let draws = probe.queues[family as usize].queue_flags.contains(vk::QueueFlags::GRAPHICS);
        let graphics = draws && probe.features.v13.dynamic_rendering == vk::TRUE;
        // Other drivers read storage blocks as well, and check bounds.
        let addresses = options.by_address
            && probe.features.v12.buffer_device_address == vk::TRUE
            && probe.vulkan12.driver_id == vk::DriverId::MESA_LLVMPIPE;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: addresses,
            // Small blocks: CPU drivers commit memory that is merely reserved.
            allocation_sizes: AllocationSizes::new(32 << 20, 16 << 20),
        });
        let debug =
            instance.debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device));
        let table_sizes = options.table.capped(&probe);
        let cache_file = options.cache.as_deref().map(|folder| cache::file(folder, &probe));
        let bits = probe.queues[family as usize].timestamp_valid_bits;
        let heaps = probe.memory.memory_types_as_slice();
        let all_local =
            vk::MemoryPropertyFlags::DEVICE_LOCAL | vk::MemoryPropertyFlags::HOST_VISIBLE;
        let mut shared = Shared {
            opened: OPENED.fetch_add(1, Ordering::Relaxed) + 1,
            queue: Mutex::new(queue),
            family,
            limits: limits(&probe, &info),
            graphics,
            derivatives: COMPUTE_DERIVATIVES.is_on(&probe.features),
            int64: probe.features.core.shader_int64 == vk::TRUE,
            int64_atomics: probe.features.v12.shader_buffer_int64_atomics
                & probe.features.core.shader_int64
                == vk::TRUE,
            unified_memory: info.kind == DeviceKind::Cpu
                || heaps.iter().all(|t| t.property_flags.contains(all_local)),
            timestamps: (bits > 0).then(|| TimestampUnit {
                ns_per_tick: f64::from(probe.properties.limits.timestamp_period),
                mask: u64::MAX >> (64 - bits.min(64)),
            }),
            addresses,
            timeout: options.timeout,
            push_constant_bytes: probe.properties.limits.max_push_constants_size,
            draw_limits: draw_limits(&probe),
            sampler_limits: SamplerLimits::new(&probe),
            lacking: capability::lacking(&probe),
            debug,
            names: instance.names,
            pipeline_cache: vk::PipelineCache::null(),
            table_layout: vk::DescriptorSetLayout::null(),
            table_sizes,
            samplers: Mutex::default(),
            placeholders: Mutex::default(),
            lost: AtomicBool::new(false),
            timeline: vk::Semaphore::null(),
            submitted: AtomicU64::new(0),
            turn: RwLock::new(()),
            #[cfg(test)]
            next_wait: Mutex::default(),
            allocator: Mutex::new(None),
            cache_file,
            physical,
            adopted,
            info,
            device,
            instance,
        };
        // From here on `shared` is dropped, and with it the device if it is ours, if anything fails.
        let allocator =
            allocator.map_err(|e| Error::Device(format!("{}: {e}", shared.info.name)))?;
        shared.allocator = Mutex::new(Some(allocator));
        shared.timeline = shared.new_timeline()?;
        shared.table_layout = table::layout(&shared)?;
        shared.pipeline_cache = cache::open(&shared, shared.cache_file.as_deref())?;
        log::info!("device: {}", shared.info);
        Ok(Self(Arc::new(shared)))
    }
}

/// Opens the device with everything on that it offers, since users' shaders may need any of it. Robust
/// access is part of that: shaders may index their resources at will, and must not reach other memory.
fn create_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    probe: &Probe,
    family: u32,
) -> std::result::Result<ash::Device, vk::Result> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(family)
        .queue_priorities(&priorities)];
    let mut features = probe.features.clone();
    features.v11.protected_memory = vk::FALSE;
    features.v12.buffer_device_address_capture_replay = vk::FALSE;
    features.v12.buffer_device_address_multi_device = vk::FALSE;
    let mut structures = EXTENSIONS.each_ref().map(|extension| Structure::new(extension.kind));
    let mut extensions = Vec::new();
    let mut all = vk::PhysicalDeviceFeatures2::default()
        .features(features.core)
        .push_next(&mut features.v11)
        .push_next(&mut features.v12)
        .push_next(&mut features.v13);
    for number in probe.features.extended() {
        let structure = &mut structures[number];
        structure.booleans = probe.features.extended[number];
        structure.next = all.p_next.cast();
        all.p_next = (&raw mut *structure).cast();
        extensions.extend(EXTENSIONS[number].offered(&probe.extensions).map(CStr::as_ptr));
    }
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut all);
    // SAFETY: every feature that is on was reported by this device; all pointers outlive the call.
    unsafe { instance.create_device(physical, &info, None) }
}
