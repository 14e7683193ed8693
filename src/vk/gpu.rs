//! The opened device: queue, memory, layouts and caches, shared by everything made from it.

use super::{
    cache,
    device::DeviceInfo,
    error::{capacity, describe},
    instance::Instance,
    limits::{DrawLimits, Limits},
    placeholder::Placeholders,
    sampler::{SamplerKey, SamplerLimits},
    table_sizes::TableSizes,
};
use crate::error::{Error, Result};
use ash::{ext, vk};
use gpu_allocator::{
    MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator},
};
use rspirv::spirv::Capability;
use std::{
    collections::HashMap,
    path::PathBuf,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, RwLock, Weak,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

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
    pub sampler_limits: SamplerLimits,
    pub lacking: Vec<(Capability, &'static str)>,
    pub debug: Option<ext::debug_utils::Device>,
    /// Whether objects get names.
    pub names: bool,
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
    pub(super) allocator: Mutex<Option<Allocator>>,
    pub(super) cache_file: Option<PathBuf>,
    pub(super) physical: vk::PhysicalDevice,
    /// Whether the device is the caller's, and stays open.
    pub(super) adopted: bool,
    // Last: the instance outlives the device.
    pub(super) instance: Instance,
}

/// How timestamps become nanoseconds.
#[derive(Clone, Copy)]
pub(crate) struct TimestampUnit {
    pub ns_per_tick: f64,
    pub mask: u64,
}

impl Gpu {
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

    /// The messages of the validation layer so far, in order; empty without the layer. They stay for later calls. On a device
    /// of the caller, messages go to the caller's messenger, and this list is empty.
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

    pub(super) fn new_timeline(&self) -> Result<vk::Semaphore> {
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

    /// Names a Vulkan object for the validation layer's messages and for captures.
    pub fn set_name<H: vk::Handle>(&self, handle: H, name: &str) {
        let Some(debug) = self.debug.as_ref().filter(|_| self.names) else { return };
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
            let started = *self.submitted.get_mut();
            match (self.is_lost(), self.adopted) {
                (true, _) => {}
                (false, false) => drop(self.device.device_wait_idle()),
                // Others may use queues of the device meanwhile, so that only what was started here is waited for.
                (false, true) if started > 0 => drop(self.wait_for(started)),
                (false, true) => {}
            }
            let samplers = self.samplers.get_mut().unwrap_or_else(PoisonError::into_inner);
            for (_, sampler) in samplers.drain() {
                self.device.destroy_sampler(sampler, None);
            }
            self.device.destroy_semaphore(self.timeline, None);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_descriptor_set_layout(self.table_layout, None);
            drop(self.allocator.get_mut().unwrap_or_else(PoisonError::into_inner).take());
            if !self.adopted {
                self.device.destroy_device(None);
            }
        }
    }
}
