//! A command buffer while it is recorded, with all it needs.

use super::{
    arena::Arena, buffer::Buffer, gpu::Gpu, raw_image::RawImage, recorder::Lists,
    recording::Timings,
};
use crate::error::Result;
use ash::vk;
use std::{
    any::Any,
    ffi::CStr,
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

/// A command buffer, its descriptor pools and queries, and everything it refers to.
pub(crate) struct Commands {
    gpu: Gpu,
    pub label: String,
    pub raw: vk::CommandBuffer,
    /// Our own command buffer and its pool, once there was use for them. `raw` is another one if it is the caller's.
    own: Option<(vk::CommandPool, vk::CommandBuffer)>,
    pools: Vec<Pool>,
    /// Pools that are in use; sets and descriptors that are left in the last of them.
    pools_used: usize,
    left: (u32, u32),
    keep: Vec<Arc<dyn Any + Send + Sync>>,
    /// Pools of [`QUERIES`] timestamps; the first two are start and end of the whole.
    query_pools: Vec<vk::QueryPool>,
    queries: u32,
    pub time_stages: bool,
    stages: Vec<Stage>,
    constants: Arena,
    /// What dispatches lend to each other.
    pub(super) lists: Lists,
    /// Changes when the commands are finished, forgotten or dropped.
    state: Arc<AtomicU64>,
}

/// A descriptor pool, with the sets and the descriptors of each kind that it has room for.
struct Pool {
    raw: vk::DescriptorPool,
    sets: u32,
    descriptors: u32,
}

/// Stands for commands while they are recorded, and so do not run.
#[derive(Clone)]
pub(crate) struct Unfinished {
    state: Arc<AtomicU64>,
    value: u64,
}

impl Unfinished {
    /// Whether they are still recorded.
    pub fn is_now(&self) -> bool {
        self.state.load(Ordering::Relaxed) == self.value
    }

    /// Whether it stands for the same commands.
    pub fn is(&self, other: &Unfinished) -> bool {
        Arc::ptr_eq(&self.state, &other.state) && self.value == other.value
    }
}

/// A dispatch that is timed.
struct Stage {
    label: String,
    /// First of its two queries.
    query: u32,
}

/// Sets of the first descriptor pool, and descriptors of each kind.
const POOL_SETS: u32 = 128;
const POOL_DESCRIPTORS: u32 = 1024;
/// Bytes of a label, with the zero at its end.
const LABEL_BYTES: usize = 64;
/// Timestamps of one query pool.
const QUERIES: u32 = 256;

impl Commands {
    /// Commands that are recorded into `borrowed`, or into a command buffer of their own.
    pub fn new(gpu: &Gpu, label: &str, borrowed: Option<vk::CommandBuffer>) -> Result<Self> {
        let mut commands = Self {
            gpu: gpu.clone(),
            label: label.to_string(),
            raw: vk::CommandBuffer::null(),
            own: None,
            pools: Vec::new(),
            pools_used: 0,
            left: (0, 0),
            keep: Vec::new(),
            query_pools: Vec::new(),
            queries: 0,
            time_stages: false,
            stages: Vec::new(),
            constants: Arena::new(gpu),
            lists: Lists::default(),
            state: Arc::default(),
        };
        commands.begin(borrowed)?;
        Ok(commands)
    }

    /// Our own command buffer, which is made if there is none yet.
    fn own_buffer(&mut self) -> Result<vk::CommandBuffer> {
        if let Some((_, raw)) = self.own {
            return Ok(raw);
        }
        let device = &self.gpu.0.device;
        let failure = |e| self.gpu.failure(&format!("preparing to record `{}`", self.label), e);
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(self.gpu.0.family);
        // SAFETY: the device is alive; `Commands` owns the pool from here on.
        let pool = unsafe { device.create_command_pool(&info, None) }.map_err(failure)?;
        let info =
            vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is new and used by this thread only.
        match unsafe { device.allocate_command_buffers(&info) } {
            Ok(buffers) => {
                self.own = Some((pool, buffers[0]));
                Ok(buffers[0])
            }
            Err(e) => {
                // SAFETY: nothing came from the pool.
                unsafe { device.destroy_command_pool(pool, None) };
                Err(failure(e))
            }
        }
    }

    /// Forgets all commands, and begins anew with the same pools, as [`Commands::new`] does. Nothing of it is running.
    pub(super) fn restart(
        &mut self,
        label: &str,
        borrowed: Option<vk::CommandBuffer>,
    ) -> Result<()> {
        if self.label != label {
            self.label = label.to_string();
        }
        let device = &self.gpu.0.device;
        // SAFETY: nothing that came from the pools is running, and nobody else has it.
        unsafe {
            if let Some((pool, _)) = self.own {
                device
                    .reset_command_pool(pool, vk::CommandPoolResetFlags::empty())
                    .map_err(|e| self.gpu.failure(&self.what(), e))?;
            }
            for pool in &self.pools[..self.pools_used] {
                device
                    .reset_descriptor_pool(pool.raw, vk::DescriptorPoolResetFlags::empty())
                    .map_err(|e| self.gpu.failure(&self.what(), e))?;
            }
        }
        (self.pools_used, self.left) = (0, (0, 0));
        self.keep.clear();
        self.stages.clear();
        self.time_stages = false;
        self.constants.reset();
        self.begin(borrowed)
    }

    fn begin(&mut self, borrowed: Option<vk::CommandBuffer>) -> Result<()> {
        if let Some(raw) = borrowed {
            (self.raw, self.queries) = (raw, 0);
            return Ok(());
        }
        self.raw = self.own_buffer()?;
        let info = vk::CommandBufferBeginInfo::default();
        // SAFETY: the command buffer is new or was reset.
        unsafe { self.gpu.0.device.begin_command_buffer(self.raw, &info) }
            .map_err(|e| self.gpu.failure(&self.what(), e))?;
        self.queries = 0;
        for &pool in &self.query_pools {
            // SAFETY: the command buffer is being recorded.
            unsafe { self.gpu.0.device.cmd_reset_query_pool(self.raw, pool, 0, QUERIES) };
        }
        if self.gpu.0.timestamps.is_some() {
            let start = self.two_queries()?;
            self.timestamp(start);
        }
        Ok(())
    }

    /// Whether they are in our own command buffer.
    pub(super) fn is_own(&self) -> bool {
        self.own.is_some_and(|(_, own)| own == self.raw)
    }

    /// What it does, for messages.
    pub(super) fn what(&self) -> String {
        format!("running `{}`", self.label)
    }

    /// Stands for the commands until they are finished.
    pub fn unfinished(&self) -> Unfinished {
        Unfinished { state: self.state.clone(), value: self.state.load(Ordering::Relaxed) }
    }

    /// A slice of memory of the recording that holds `words` and may be bound as a uniform block.
    pub fn constants(&mut self, words: &[u64]) -> Result<Buffer<u64>> {
        let slice = self.constants.push(words)?;
        self.keep(slice.raw().clone());
        Ok(slice)
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
        self.transition_levels(image, 0..image.levels, from, to);
    }

    /// As [`Commands::transition`], of some levels.
    pub fn transition_levels(
        &mut self,
        image: &Arc<RawImage>,
        levels: Range<u32>,
        from: vk::ImageLayout,
        to: vk::ImageLayout,
    ) {
        let range =
            image.range().base_mip_level(levels.start).level_count(levels.end - levels.start);
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
            .subresource_range(range)];
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
        if let Some(debug) = &self.gpu.0.debug {
            // A longer label is cut: a copy of any length would take memory in each frame.
            let mut end = label.len().min(LABEL_BYTES - 1);
            while !label.is_char_boundary(end) {
                end -= 1;
            }
            let mut name = [0; LABEL_BYTES];
            name[..end].copy_from_slice(&label.as_bytes()[..end]);
            let label = CStr::from_bytes_until_nul(&name).unwrap_or_default();
            let info = vk::DebugUtilsLabelEXT::default().label_name(label);
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
        if self.left.0 == 0 || self.left.1 < descriptors {
            self.next_pool(descriptors)?;
        }
        let pool = self.pools[self.pools_used - 1].raw;
        let layouts = [layout];
        let info =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        let (device, mut set) = (&self.gpu.0.device, vk::DescriptorSet::null());
        // SAFETY: `left` says that the pool has room; there is one layout, and room for one set.
        let allocated = unsafe {
            (device.fp_v1_0().allocate_descriptor_sets)(device.handle(), &info, &mut set)
        };
        allocated.result().map_err(|e| {
            self.gpu.failure(&format!("allocating descriptors of `{}`", self.label), e)
        })?;
        self.left = (self.left.0 - 1, self.left.1 - descriptors);
        Ok(set)
    }

    /// Goes on to the next descriptor pool, which has room for a set of `descriptors`.
    fn next_pool(&mut self, descriptors: u32) -> Result<()> {
        while let Some(&Pool { sets, descriptors: room, .. }) = self.pools.get(self.pools_used) {
            self.pools_used += 1;
            if room >= descriptors {
                self.left = (sets, room);
                return Ok(());
            }
        }
        // Each pool is twice the one before, so that thousands of draws need a dozen.
        let scale = 1 << self.pools.len().min(8);
        let (sets, descriptors) = (POOL_SETS * scale, (POOL_DESCRIPTORS * scale).max(descriptors));
        let sizes = [
            vk::DescriptorType::STORAGE_BUFFER,
            vk::DescriptorType::UNIFORM_BUFFER,
            vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            vk::DescriptorType::SAMPLED_IMAGE,
            vk::DescriptorType::SAMPLER,
            vk::DescriptorType::STORAGE_IMAGE,
        ]
        .map(|kind| vk::DescriptorPoolSize::default().ty(kind).descriptor_count(descriptors));
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(sets).pool_sizes(&sizes);
        // SAFETY: the device is alive; `Commands` owns the pool from here on.
        let raw = unsafe { self.gpu.0.device.create_descriptor_pool(&info, None) }
            .map_err(|e| self.gpu.failure(&self.what(), e))?;
        self.pools.push(Pool { raw, sets, descriptors });
        self.pools_used = self.pools.len();
        self.left = (sets, descriptors);
        Ok(())
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

    /// Makes everything visible to what follows and to the host. Ends the command buffer, unless it is the caller's.
    pub(super) fn end(&self) -> Result<()> {
        self.state.fetch_add(1, Ordering::Relaxed);
        self.barrier();
        let is_own = self.is_own();
        if is_own && self.gpu.0.timestamps.is_some() {
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
            match is_own {
                true => self.gpu.0.device.end_command_buffer(self.raw),
                false => Ok(()),
            }
        }
        .map_err(|e| self.gpu.failure(&format!("recording `{}`", self.label), e))
    }

    pub(super) fn timings(&self) -> Result<Timings> {
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
        self.state.fetch_add(1, Ordering::Relaxed);
        let device = &self.gpu.0.device;
        // SAFETY: the last submission was waited for, or there was none; a recording
        // whose device does not answer is leaked instead of dropped.
        unsafe {
            for pool in self.pools.drain(..) {
                device.destroy_descriptor_pool(pool.raw, None);
            }
            for pool in self.query_pools.drain(..) {
                device.destroy_query_pool(pool, None);
            }
            if let Some((pool, _)) = self.own {
                device.destroy_command_pool(pool, None);
            }
        }
    }
}
