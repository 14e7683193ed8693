//! The opened device: queue, memory, layouts and caches, shared by everything made from it.

use super::{
    cache, capability,
    device::{self, DeviceInfo, DeviceKind, Require},
    error::{capacity, describe},
    instance::Instance,
    limits::{DrawLimits, Limits, draw_limits, limits},
    placeholder::Placeholders,
    requirements::Probe,
    sampler::SamplerKey,
    table,
    table_sizes::TableSizes,
};
use crate::error::{Error, Result};
use ash::{ext, vk};
use gpu_allocator::{
    AllocationSizes, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc},
};
use rspirv::spirv::Capability;
use std::{
    collections::HashMap,
    path::PathBuf,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, RwLock, Weak,
        atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering},
    },
    time::Duration,
};

/// How to open a device.
#[derive(Clone, Debug)]
pub struct GpuOptions {
    /// Index, UUID or name pattern; `None` takes the variable `TILEWRIGHT_DEVICE`, or the best one.
    pub device: Option<String>,
    /// Which kind of device is acceptable.
    pub require: Require,
    /// Loads the validation layer. Also on if the variable `TILEWRIGHT_VALIDATION` is `1`. Its messages go to the crate
    /// `log` and to [`Gpu::validation_messages`], and not to standard error.
    pub validation: bool,
    /// How long one submission may take before the device counts as lost.
    pub timeout: Duration,
    /// Where compiled pipelines are kept; `None` keeps none.
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
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            device: None,
            require: Require::Any,
            validation: false,
            timeout: Self::TIMEOUT,
            cache: crate::cache::folder(),
            table: TableSizes::default(),
            by_address: true,
        }
    }
}

/// An opened device. Cheap to clone; the device is closed with the last clone and the last resource.
#[derive(Clone)]
pub struct Gpu(pub(crate) Arc<Shared>);

/// The state that all handles share. `drop` destroys the fields that need the device, in order.
pub(crate) struct Shared {
    pub device: ash::Device,
    /// Which of the devices that this program opened it is, from 1: one device may be opened twice.
    pub opened: u32,
    pub queue: Mutex<vk::Queue>,
    pub family: u32,
    pub info: DeviceInfo,
    pub limits: Limits,
    pub graphics: bool,
    /// Whether kernels reach blocks by address (`address.rs`).
    pub addresses: bool,
    pub derivatives: bool,
    /// Whether kernels may compute with 64-bit integers.
    pub int64: bool,
    pub int64_atomics: bool,
    pub unified_memory: bool,
    pub timestamps: Option<TimestampUnit>,
    pub timeout: Duration,
    pub push_constant_bytes: u32,
    pub draw_limits: DrawLimits,
    pub lacking: Vec<(Capability, &'static str)>,
    pub debug: Option<ext::debug_utils::Device>,
    pub validation: bool,
    pub pipeline_cache: vk::PipelineCache,
    pub table_layout: vk::DescriptorSetLayout,
    pub table_sizes: TableSizes,
    pub(super) samplers: Mutex<HashMap<SamplerKey, vk::Sampler>>,
    /// The contents of free slots of resource tables, as long as there is a table.
    pub(super) placeholders: Mutex<Weak<Placeholders>>,
    /// Set once the device was lost or did not answer: nothing is waited for any more.
    pub lost: AtomicBool,
    /// Counts submissions as they end.
    pub(super) timeline: vk::Semaphore,
    /// Submissions so far; changes while the queue is locked.
    pub(super) submitted: AtomicU64,
    /// Whose turn it is, see `access.rs`.
    pub(super) turn: RwLock<()>,
    /// The error that the next wait fails with, for tests.
    #[cfg(test)]
    pub(super) next_wait: Mutex<Option<vk::Result>>,
    allocator: Mutex<Option<Allocator>>,
    cache_file: Option<PathBuf>,
    physical: vk::PhysicalDevice,
    // Last: the instance outlives the device.
    instance: Instance,
}

/// Devices that this program has opened so far.
static OPENED: AtomicU32 = AtomicU32::new(0);

/// How timestamps become nanoseconds.
#[derive(Clone, Copy)]
pub(crate) struct TimestampUnit {
    pub ns_per_tick: f64,
    pub mask: u64,
}

impl Gpu {
    /// Opens the device that `options` asks for.
    ///
    /// # Errors
    /// [`Error::Device`] without a loader, a driver or a device that meets all [`super::REQUIREMENTS`];
    /// the message names the device and the missing feature, and says what to do.
    pub fn open(options: &GpuOptions) -> Result<Self> {
        let asked = std::env::var("TILEWRIGHT_VALIDATION").is_ok_and(|v| v == "1");
        let validation = options.validation || asked;
        let instance = Instance::new(validation)?;
        let device::Candidate { raw: physical, probe, info } =
            device::pick(&instance, options.device.as_deref(), options.require)?;
        let (family, graphics) = probe
            .family()
            .ok_or_else(|| Error::Device(format!("{} has no compute queue", info.name)))?;
        let graphics = graphics && probe.features13.dynamic_rendering == vk::TRUE;
        let device = create_device(&instance.raw, physical, &probe, family)
            .map_err(|e| describe(&info.name, "opening it", e))?;
        // SAFETY: one queue of `family` was created with the device.
        let queue = unsafe { device.get_device_queue(family, 0) };
        // Other drivers read storage blocks as well, and check bounds.
        let addresses = options.by_address
            && probe.features12.buffer_device_address == vk::TRUE
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
            derivatives: probe.derivatives_extension().is_some(),
            int64: probe.features.shader_int64 == vk::TRUE,
            int64_atomics: probe.features12.shader_buffer_int64_atomics
                & probe.features.shader_int64
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
            lacking: capability::lacking(&probe),
            debug,
            validation,
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
            info,
            device,
            instance,
        };
        // From here on `shared` is dropped, and with it the device, if anything fails.
        let allocator =
            allocator.map_err(|e| Error::Device(format!("{}: {e}", shared.info.name)))?;
        shared.allocator = Mutex::new(Some(allocator));
        shared.timeline = shared.new_timeline()?;
        shared.table_layout = table::layout(&shared)?;
        shared.pipeline_cache = cache::open(&shared, shared.cache_file.as_deref())?;
        log::info!("device: {}", shared.info);
        Ok(Self(Arc::new(shared)))
    }

    /// The device, as [`super::devices`] lists it. Its `Display` is what every run prints.
    pub fn info(&self) -> &DeviceInfo {
        &self.0.info
    }

    /// The limits that callers plan by.
    pub fn limits(&self) -> Limits {
        self.0.limits
    }

    /// Whether the device can draw by itself, so that `classic` works on it.
    pub fn has_graphics(&self) -> bool {
        self.0.graphics
    }

    /// Whether the host sees the device's memory, so that it needs no copies.
    pub fn has_unified_memory(&self) -> bool {
        self.0.unified_memory
    }

    /// Whether fragment shaders of the device's own pipeline may read `gl_PrimitiveID`, which is part
    /// of the feature `geometryShader`. Compute has it everywhere.
    pub fn has_primitive_ids(&self) -> bool {
        self.0.lacking.iter().all(|(lacking, _)| *lacking != Capability::Geometry)
    }

    /// Whether kernels reach buffers by address, which drivers for CPUs read faster than descriptors.
    pub fn reads_by_address(&self) -> bool {
        self.0.addresses
    }

    /// Whether compute kernels may use derivative instructions (`VK_KHR_compute_shader_derivatives`).
    pub fn has_compute_derivatives(&self) -> bool {
        self.0.derivatives
    }

    /// Whether kernels may use 64-bit atomics on storage buffers.
    pub fn has_int64_atomics(&self) -> bool {
        self.0.int64_atomics
    }

    /// The messages of the validation layer so far, in order; empty without the layer. They stay for later calls.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.instance.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes compiled pipelines to the cache now, rather than when the device is closed.
    pub fn save_pipeline_cache(&self) {
        cache::save(&self.0, self.0.cache_file.as_deref());
    }

    pub(crate) fn name(&self) -> &str {
        &self.0.info.name
    }

    /// The error for a call that failed while doing `what`; remembers a lost device.
    pub(crate) fn failure(&self, what: &str, result: vk::Result) -> Error {
        self.0.failure(what, result)
    }
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Gpu").field(&self.0.info.name).finish()
    }
}

impl Shared {
    pub fn failure(&self, what: &str, result: vk::Result) -> Error {
        if result == vk::Result::ERROR_DEVICE_LOST {
            self.lost.store(true, Ordering::Relaxed);
        }
        describe(&self.info.name, what, result)
    }

    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    pub fn lock_queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn new_timeline(&self) -> Result<vk::Semaphore> {
        let mut kind =
            vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive; `Shared` owns the semaphore.
        let timeline = unsafe { self.device.create_semaphore(&info, None) };
        timeline.map_err(|e| self.failure("creating a timeline semaphore", e))
    }

    fn memory_limit_name(&self) -> String {
        format!("device memory of {}", self.info.name)
    }

    /// Memory for one buffer or image called `what`.
    pub fn allocate(
        &self,
        what: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        let full = || {
            capacity(what, requirements.size, self.memory_limit_name(), self.limits.memory_bytes)
        };
        if requirements.size > self.limits.allocation_bytes {
            let limit_of = format!("one allocation on {}", self.info.name);
            return Err(capacity(what, requirements.size, limit_of, self.limits.allocation_bytes));
        }
        if requirements.size > self.limits.memory_bytes {
            return Err(full());
        }
        let mut guard = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(allocator) = guard.as_mut() else { return Err(full()) };
        allocator
            .allocate(&AllocationCreateDesc {
                name: what,
                requirements,
                location,
                linear,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .map_err(|e| {
                log::error!("{what}: {e}");
                full()
            })
    }

    pub fn free(&self, allocation: Allocation) {
        let mut guard = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Err(e)) = guard.as_mut().map(|allocator| allocator.free(allocation)) {
            log::error!("device memory was not freed: {e}");
        }
    }

    /// Whether graphics pipelines read vertex attributes of this format.
    pub fn reads_vertices_as(&self, format: vk::Format) -> bool {
        let raw = &self.instance.raw;
        // SAFETY: the physical device belongs to the instance.
        let found = unsafe { raw.get_physical_device_format_properties(self.physical, format) };
        found.buffer_features.contains(vk::FormatFeatureFlags::VERTEX_BUFFER)
    }

    /// Whether samplers may filter images of this format linearly.
    pub fn filters(&self, format: vk::Format) -> bool {
        let raw = &self.instance.raw;
        // SAFETY: the physical device belongs to the instance.
        let found = unsafe { raw.get_physical_device_format_properties(self.physical, format) };
        let filter = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        found.optimal_tiling_features.contains(filter)
    }

    /// Names a Vulkan object for the validation layer's messages and for captures.
    pub fn set_name<H: vk::Handle>(&self, handle: H, name: &str) {
        let Some(debug) = self.debug.as_ref().filter(|_| self.validation) else { return };
        let Ok(name) = std::ffi::CString::new(name) else { return };
        let info =
            vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the handle belongs to this device and the name outlives the call. A failure
        // costs a name and nothing else.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        if !self.is_lost() {
            cache::save(self, self.cache_file.as_deref());
        }
        // SAFETY: every handle that was made from this device held it, so none is left; a device
        // that is lost is not waited for.
        unsafe {
            if !self.is_lost() {
                let _ = self.device.device_wait_idle();
            }
            let samplers = self.samplers.get_mut().unwrap_or_else(PoisonError::into_inner);
            for (_, sampler) in samplers.drain() {
                self.device.destroy_sampler(sampler, None);
            }
            self.device.destroy_semaphore(self.timeline, None);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_descriptor_set_layout(self.table_layout, None);
            drop(self.allocator.get_mut().unwrap_or_else(PoisonError::into_inner).take());
            self.device.destroy_device(None);
        }
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
    let features = probe.features;
    let (mut features11, mut features12, mut features13) =
        (probe.features11, probe.features12, probe.features13);
    features11.protected_memory = vk::FALSE;
    features12.buffer_device_address_capture_replay = vk::FALSE;
    features12.buffer_device_address_multi_device = vk::FALSE;
    // ash knows the structure under its older name; the structure type is the same.
    let mut derivatives = vk::PhysicalDeviceComputeShaderDerivativesFeaturesNV::default()
        .compute_derivative_group_linear(true);
    let mut extensions = Vec::new();
    let mut all = vk::PhysicalDeviceFeatures2::default()
        .features(features)
        .push_next(&mut features11)
        .push_next(&mut features12)
        .push_next(&mut features13);
    if let Some(name) = probe.derivatives_extension() {
        extensions.push(name.as_ptr());
        all = all.push_next(&mut derivatives);
    }
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut all);
    // SAFETY: every feature that is on was reported by this device; all pointers outlive the call.
    unsafe { instance.create_device(physical, &info, None) }
}
