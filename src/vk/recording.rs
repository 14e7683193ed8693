//! Command buffers with all they need, from the first command to the fence.

use super::{
    access::may_be_in_flight,
    buffer::{Buffer, Memory},
    gpu::Gpu,
    image::RawImage,
};
use crate::error::{Error, Result};
use ash::vk;
use std::{any::Any, ffi::CString, sync::Arc, sync::atomic::Ordering};

/// A command buffer, its descriptor pools and queries, and everything it refers to.
pub(crate) struct Commands {
    gpu: Gpu,
    pub label: String,
    pub raw: vk::CommandBuffer,
    pool: vk::CommandPool,
    descriptor_pools: Vec<vk::DescriptorPool>,
    /// Sets and descriptors that are left in the last pool.
    left: (u32, u32),
    keep: Vec<Arc<dyn Any + Send + Sync>>,
    /// Pools of [`QUERIES`] timestamps; the first two are start and end of the whole.
    query_pools: Vec<vk::QueryPool>,
    queries: u32,
    pub time_stages: bool,
    stages: Vec<Stage>,
    /// The buffer of constants that is being filled, and how far.
    constants: Option<(Buffer<u64>, usize)>,
}

/// A dispatch that is timed.
struct Stage {
    label: String,
    /// First of its two queries.
    query: u32,
}

/// A finished recording: it can run, more than once, and keeps alive all it refers to.
pub struct Recording {
    gpu: Gpu,
    /// `None` once it was leaked, because the device may not be done with it.
    commands: Option<Commands>,
    fence: vk::Fence,
}

/// How long the device took.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// The whole recording, 0 if the device has no timestamps.
    pub total_ns: u64,
    /// Each dispatch in order, by label; empty unless [`super::Recorder::time_stages`] was called.
    pub stages: Vec<(String, u64)>,
}

/// Sets of the first descriptor pool, and descriptors of each kind.
const POOL_SETS: u32 = 128;
const POOL_DESCRIPTORS: u32 = 1024;
/// Timestamps of one query pool.
const QUERIES: u32 = 256;
/// Words of one buffer of constants, and the largest alignment that a device asks for.
const CONSTANTS: usize = 4096;
const CONSTANTS_ALIGNMENT: usize = 256 / 8;

impl Commands {
    pub fn new(gpu: &Gpu, label: &str) -> Result<Self> {
        let device = &gpu.0.device;
        let what = format!("preparing to record `{label}`");
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.0.family);
        // SAFETY: the device is alive; `Commands` owns the pool from here on.
        let pool = unsafe { device.create_command_pool(&info, None) }
            .map_err(|e| gpu.failure(&what, e))?;
        let mut commands = Self {
            gpu: gpu.clone(),
            label: label.to_string(),
            raw: vk::CommandBuffer::null(),
            pool,
            descriptor_pools: Vec::new(),
            left: (0, 0),
            keep: Vec::new(),
            query_pools: Vec::new(),
            queries: 0,
            time_stages: false,
            stages: Vec::new(),
            constants: None,
        };
        let info =
            vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is new and used by this thread only.
        unsafe {
            commands.raw =
                device.allocate_command_buffers(&info).map_err(|e| gpu.failure(&what, e))?[0];
            device
                .begin_command_buffer(commands.raw, &vk::CommandBufferBeginInfo::default())
                .map_err(|e| gpu.failure(&what, e))?;
        }
        if gpu.0.timestamps.is_some() {
            let start = commands.two_queries()?;
            commands.timestamp(start);
        }
        Ok(commands)
    }

    /// A slice of a buffer of the recording that holds `words` and may be bound as a uniform block.
    pub fn constants(&mut self, words: &[u64]) -> Result<Buffer<u64>> {
        let (buffer, used) = match self.constants.take() {
            Some((buffer, used)) if used + words.len() <= buffer.len() => (buffer, used),
            _ => {
                let buffer = Buffer::new(&self.gpu, "constants", CONSTANTS, Memory::Upload)?;
                self.keep(buffer.raw().clone());
                (buffer, 0)
            }
        };
        // SAFETY: these words were not handed out yet, so that nobody else knows them.
        unsafe { buffer.write_out_of_turn(used, words)? };
        let slice = buffer.slice(used..used + words.len());
        self.constants = Some((buffer, used + words.len().next_multiple_of(CONSTANTS_ALIGNMENT)));
        slice
    }

    /// Holds `what` until the recording is dropped.
    pub fn keep(&mut self, what: Arc<dyn Any + Send + Sync>) {
        self.keep.push(what);
    }

    /// A global memory barrier: all writes so far, before all that follows.
    pub fn barrier(&self) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.raw, &info) };
    }

    /// A layout transition of all levels; also a barrier for this image.
    pub fn transition(
        &mut self,
        image: &Arc<RawImage>,
        from: vk::ImageLayout,
        to: vk::ImageLayout,
    ) {
        let barrier = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .old_layout(from)
            .new_layout(to)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image.handle)
            .subresource_range(image.range())];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded; the image is kept.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.raw, &info) };
        self.keep(image.clone());
    }

    /// Opens a debug label and, if stages are timed, takes the first timestamp.
    pub fn begin_stage(&mut self, label: &str) -> Result<()> {
        if self.time_stages && self.gpu.0.timestamps.is_some() {
            let query = self.two_queries()?;
            self.stages.push(Stage { label: label.to_string(), query });
            self.timestamp(query);
            // Without it, a driver that runs timestamps and dispatches on different threads takes
            // the time of the wrong one.
            self.barrier();
        }
        if let (Some(debug), Ok(label)) = (&self.gpu.0.debug, CString::new(label)) {
            let info = vk::DebugUtilsLabelEXT::default().label_name(&label);
            // SAFETY: the command buffer is being recorded.
            unsafe { debug.cmd_begin_debug_utils_label(self.raw, &info) };
        }
        Ok(())
    }

    /// Closes what [`Commands::begin_stage`] opened.
    pub fn end_stage(&mut self) {
        if let Some(debug) = &self.gpu.0.debug {
            // SAFETY: a label is open.
            unsafe { debug.cmd_end_debug_utils_label(self.raw) };
        }
        if self.time_stages
            && let Some(query) = self.stages.last().map(|s| s.query + 1)
        {
            self.barrier();
            self.timestamp(query);
        }
    }

    /// A set of `layout` with `descriptors` descriptors, from this recording's own pools.
    pub fn descriptor_set(
        &mut self,
        layout: vk::DescriptorSetLayout,
        descriptors: u32,
    ) -> Result<vk::DescriptorSet> {
        let what = || format!("allocating descriptors of `{}`", self.label);
        if self.left.0 == 0 || self.left.1 < descriptors {
            // Each pool is twice the one before, so that thousands of draws need a dozen.
            let scale = 1 << self.descriptor_pools.len().min(8);
            let room = (POOL_DESCRIPTORS * scale).max(descriptors);
            let sizes = [
                vk::DescriptorType::STORAGE_BUFFER,
                vk::DescriptorType::UNIFORM_BUFFER,
                vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
                vk::DescriptorType::SAMPLED_IMAGE,
                vk::DescriptorType::SAMPLER,
                vk::DescriptorType::STORAGE_IMAGE,
            ]
            .map(|kind| vk::DescriptorPoolSize::default().ty(kind).descriptor_count(room));
            let info = vk::DescriptorPoolCreateInfo::default()
                .max_sets(POOL_SETS * scale)
                .pool_sizes(&sizes);
            // SAFETY: the device is alive; `Commands` owns the pool from here on.
            let pool = unsafe { self.gpu.0.device.create_descriptor_pool(&info, None) }
                .map_err(|e| self.gpu.failure(&what(), e))?;
            self.descriptor_pools.push(pool);
            self.left = (POOL_SETS * scale, room);
        }
        let pool = self.descriptor_pools.last().copied().unwrap_or_default();
        let layouts = [layout];
        let info =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: `left` says that the pool has room.
        let sets = unsafe { self.gpu.0.device.allocate_descriptor_sets(&info) }
            .map_err(|e| self.gpu.failure(&what(), e))?;
        self.left = (self.left.0 - 1, self.left.1 - descriptors);
        Ok(sets[0])
    }

    /// The number of the first of two new queries.
    fn two_queries(&mut self) -> Result<u32> {
        if self.queries == self.query_pools.len() as u32 * QUERIES {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(QUERIES);
            let device = &self.gpu.0.device;
            // SAFETY: the device is alive; the pool is reset before its first use, in this very
            // command buffer, so that the recording can run again.
            let pool = unsafe { device.create_query_pool(&info, None) }
                .map_err(|e| self.gpu.failure("creating timestamps", e))?;
            unsafe { device.cmd_reset_query_pool(self.raw, pool, 0, QUERIES) };
            self.query_pools.push(pool);
        }
        self.queries += 2;
        Ok(self.queries - 2)
    }

    fn timestamp(&self, query: u32) {
        let pool = self.query_pools[(query / QUERIES) as usize];
        // SAFETY: the query is in the pool, which was reset in this command buffer.
        unsafe {
            self.gpu.0.device.cmd_write_timestamp2(
                self.raw,
                vk::PipelineStageFlags2::ALL_COMMANDS,
                pool,
                query % QUERIES,
            );
        }
    }

    /// Makes everything visible to the host and ends the command buffer.
    fn end(&self) -> Result<()> {
        self.barrier();
        if self.gpu.0.timestamps.is_some() {
            self.timestamp(1);
        }
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded.
        unsafe {
            self.gpu.0.device.cmd_pipeline_barrier2(self.raw, &info);
            self.gpu.0.device.end_command_buffer(self.raw)
        }
        .map_err(|e| self.gpu.failure(&format!("recording `{}`", self.label), e))
    }

    fn timings(&self) -> Result<Timings> {
        let Some(unit) = self.gpu.0.timestamps else { return Ok(Timings::default()) };
        let mut ticks = vec![0u64; self.queries as usize];
        for (pool, chunk) in self.query_pools.iter().zip(ticks.chunks_mut(QUERIES as usize)) {
            let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
            // SAFETY: all queries of the chunk were written by the submission that has ended.
            unsafe { self.gpu.0.device.get_query_pool_results(*pool, 0, chunk, flags) }
                .map_err(|e| self.gpu.failure("reading timestamps", e))?;
        }
        let between = |first: u32| {
            let (start, end) = (ticks[first as usize], ticks[first as usize + 1]);
            let ticks = end.wrapping_sub(start) & unit.mask;
            (ticks as f64 * unit.ns_per_tick) as u64
        };
        let stages = self.stages.iter().map(|s| (s.label.clone(), between(s.query))).collect();
        Ok(Timings { total_ns: between(0), stages })
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        let device = &self.gpu.0.device;
        // SAFETY: the fence of the last submission was waited for, or there was none; a recording
        // whose device does not answer is leaked instead of dropped.
        unsafe {
            for pool in self.descriptor_pools.drain(..) {
                device.destroy_descriptor_pool(pool, None);
            }
            for pool in self.query_pools.drain(..) {
                device.destroy_query_pool(pool, None);
            }
            device.destroy_command_pool(self.pool, None);
        }
    }
}

impl Recording {
    pub(super) fn new(gpu: Gpu, commands: Commands) -> Result<Self> {
        commands.end()?;
        // SAFETY: the device is alive; `Recording` owns the fence.
        let fence = unsafe { gpu.0.device.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|e| gpu.failure("creating a fence", e))?;
        Ok(Self { gpu, commands: Some(commands), fence })
    }

    /// Runs it and waits, at most as long as [`super::GpuOptions::timeout`].
    ///
    /// # Errors
    /// [`Error::Lost`] if the device was lost or did not answer in time. Nothing can be run on the
    /// device afterwards, as after any other error of waiting.
    pub fn run(&mut self) -> Result<Timings> {
        let shared = self.gpu.0.clone();
        let _turn = shared.device_turn();
        let device = &shared.device;
        let Some(commands) = self.commands.as_ref().filter(|_| !shared.is_lost()) else {
            return Err(shared.lost_before());
        };
        let what = format!("running `{}`", commands.label);
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands.raw)];
        let submit = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
        // SAFETY: the recording is complete and not pending: every run waits for the fence, and
        // `&mut self` keeps a second one away. All it refers to is kept in `commands`.
        let submitted = unsafe {
            device.reset_fences(&[self.fence]).map_err(|e| shared.failure(&what, e))?;
            let queue = shared.lock_queue();
            device.queue_submit2(*queue, &submit, self.fence)
        };
        match submitted {
            Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST) => {}
            // Vulkan promises that nothing has begun.
            Err(
                e @ (vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY),
            ) => return Err(shared.failure(&what, e)),
            Err(e) => return Err(self.abandon(&what, e)),
        }
        let waited = shared.wait_for(self.fence);
        if may_be_in_flight(waited) {
            return Err(self.abandon(&what, waited.err().unwrap_or_default()));
        }
        submitted.and(waited).map_err(|e| shared.failure(&what, e))?;
        commands.timings()
    }

    /// The error for a submission that may not have ended. The device may still read everything that the
    /// submission refers to, so nothing of it may be freed, and nothing else may run.
    fn abandon(&mut self, what: &str, e: vk::Result) -> Error {
        self.gpu.0.lost.store(true, Ordering::Relaxed);
        std::mem::forget(self.commands.take());
        if e != vk::Result::TIMEOUT {
            return self.gpu.failure(what, e);
        }
        Error::Lost(format!(
            "{} did not finish {what} within {} seconds; use a smaller size or scene, or allow more time \
             (--timeout, TILEWRIGHT_TIMEOUT, GpuOptions::timeout)",
            self.gpu.name(),
            self.gpu.0.timeout.as_secs_f32()
        ))
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        if self.commands.is_some() {
            // SAFETY: no submission is pending. A leaked recording leaks its fence as well.
            unsafe { self.gpu.0.device.destroy_fence(self.fence, None) };
        }
    }
}
