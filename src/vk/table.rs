//! The resource table, descriptor set 1: every resource of users' shaders, found by number.
//!
//! One run-time array per kind of descriptor. Each draw brings one index per resource of its shaders,
//! so that draws with different textures and constants run in one dispatch, and the engine needs two
//! descriptor sets whatever users declare (some drivers have only four). Uniform and push-constant
//! blocks are storage buffers here: drivers with 15 uniform buffers exist.
//!
//! A table is full of valid descriptors at all times: a driver may access the descriptor at a lane's index even
//! while the lane is switched off, and some drivers crash on a descriptor that was never written. Free slots
//! show a 1x1 image or a small buffer of zeros. Kernels never reach beyond the table, see [`super::table_bounds`].

use super::{
    buffer::{Buffer, Memory, RawBuffer},
    commands::Unfinished,
    error::capacity,
    gpu::{Gpu, Shared},
    image::{Image, ImageUse},
    owner::same_device,
    placeholder::Placeholders,
    sampler::Sampler,
};
use crate::{
    error::{Error, Result},
    image::Shape,
};
use ash::vk;
use bytemuck::Pod;
use std::{
    any::Any,
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError, RwLockWriteGuard},
};

/// The kinds of descriptor, in the order of their bindings.
const KINDS: [(vk::DescriptorType, &str); 5] = [
    (vk::DescriptorType::COMBINED_IMAGE_SAMPLER, "sampled images"),
    (vk::DescriptorType::SAMPLED_IMAGE, "textures"),
    (vk::DescriptorType::SAMPLER, "samplers"),
    (vk::DescriptorType::STORAGE_IMAGE, "storage images"),
    (vk::DescriptorType::STORAGE_BUFFER, "buffers"),
];

/// Descriptors written by one call when the table is filled.
const FILL_CHUNK: usize = 256;

/// The layout of set 1, the same for all kernels of a device.
pub(super) fn layout(gpu: &Shared) -> Result<vk::DescriptorSetLayout> {
    let flags = [vk::DescriptorBindingFlags::PARTIALLY_BOUND
        | vk::DescriptorBindingFlags::UPDATE_AFTER_BIND; KINDS.len()];
    let bindings: Vec<_> = KINDS
        .iter()
        .zip(gpu.table_sizes.by_binding())
        .enumerate()
        .map(|(i, ((kind, _), count))| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(i as u32)
                .descriptor_type(*kind)
                .descriptor_count(count)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let mut flags = vk::DescriptorSetLayoutBindingFlagsCreateInfo::default().binding_flags(&flags);
    let info = vk::DescriptorSetLayoutCreateInfo::default()
        .flags(vk::DescriptorSetLayoutCreateFlags::UPDATE_AFTER_BIND_POOL)
        .bindings(&bindings)
        .push_next(&mut flags);
    // SAFETY: the device is alive and offers update-after-bind for these kinds.
    unsafe { gpu.device.create_descriptor_set_layout(&info, None) }
        .map_err(|e| gpu.failure("creating the layout of the resource table", e))
}

/// Images, samplers and buffers that kernels of yours find by number: descriptor set 1. [`super::Dispatch::table`] binds it,
/// and the number of a slot goes into the push constants or a buffer. A kernel declares what it uses of the set:
///
/// ```glsl
/// #extension GL_EXT_nonuniform_qualifier : require
/// layout(set = 1, binding = 0) uniform sampler2D sampled[];              // insert_sampled
/// layout(set = 1, binding = 1) uniform texture2D textures[];             // insert_texture
/// layout(set = 1, binding = 2) uniform sampler samplers[];               // insert_sampler
/// layout(set = 1, binding = 3, rgba8) uniform image2D images[];          // insert_storage_image
/// layout(set = 1, binding = 4) buffer Words { uint words[]; } buffers[]; // insert_buffer
/// ```
///
/// A number beyond the last slot stands for the last slot, or for the last element of an array that is declared shorter.
/// What a slot shows stays as long as a recording has the table bound, also if the table is dropped. To insert into a table
/// that a recording has bound waits for what was started on the device.
pub struct ResourceTable {
    raw: Arc<RawTable>,
    /// Slot by (binding, handles, offset, bytes): the same resource is stored once.
    slots: HashMap<Key, u32>,
    /// Whether every resource takes a slot of its own, see [`ResourceTable::take_fresh_slots`].
    fresh: bool,
    /// Whether it takes images of all shapes and samplers of all states, since whoever fills it knows what kernels declare.
    any: bool,
    /// The commands that alone may have the table bound, as long as they are recorded.
    open: Option<Unfinished>,
    used: [u32; KINDS.len()],
}

/// Identity of a resource in the table.
type Key = (u32, u64, u64, u64, u64);

/// What recordings hold on to.
pub(super) struct RawTable {
    pub set: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    /// Where the buffers are, by slot, if kernels read them by address.
    pub addresses: Option<Buffer<u64>>,
    /// Everything that a taken slot may show, and what free ones do.
    keep: Mutex<Vec<Arc<dyn Any + Send + Sync>>>,
    placeholders: Arc<Placeholders>,
    pub(super) gpu: Gpu,
}

impl ResourceTable {
    /// An empty table.
    ///
    /// # Errors
    /// [`Error::Full`] if the device has no room for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let sizes: Vec<_> = KINDS
            .iter()
            .zip(gpu.0.table_sizes.by_binding())
            .map(|((kind, _), count)| {
                vk::DescriptorPoolSize::default().ty(*kind).descriptor_count(count)
            })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default()
            .flags(vk::DescriptorPoolCreateFlags::UPDATE_AFTER_BIND)
            .max_sets(1)
            .pool_sizes(&sizes);
        let placeholders = Placeholders::of(gpu)?;
        // SAFETY: the device is alive; `RawTable` owns the pool from here on.
        let pool = unsafe { gpu.0.device.create_descriptor_pool(&info, None) }
            .map_err(|e| gpu.failure("creating the resource table", e))?;
        let mut raw = RawTable {
            set: vk::DescriptorSet::null(),
            pool,
            addresses: None,
            keep: Mutex::default(),
            placeholders,
            gpu: gpu.clone(),
        };
        let layouts = [gpu.0.table_layout];
        let info =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for exactly this set.
        raw.set = unsafe { gpu.0.device.allocate_descriptor_sets(&info) }
            .map_err(|e| gpu.failure("allocating the resource table", e))?[0];

        if gpu.0.addresses {
            let count = gpu.0.table_sizes.buffers as usize;
            raw.addresses = Some(Buffer::new(gpu, "buffer addresses", count, Memory::Mapped)?);
        }

        let table = Self {
            raw: Arc::new(raw),
            slots: HashMap::new(),
            fresh: false,
            any: false,
            open: None,
            used: [0; KINDS.len()],
        };
        for (binding, count) in gpu.0.table_sizes.by_binding().into_iter().enumerate() {
            table.fill(binding as u32, 0, count)?;
        }
        Ok(table)
    }

    /// An empty table for passes, whose resources fit what shaders declare.
    pub(crate) fn for_passes(gpu: &Gpu) -> Result<Self> {
        Ok(Self { any: true, ..Self::new(gpu)? })
    }

    /// Refuses what kernels cannot be checked against, which find their resources by number.
    fn check_plain(&self, image: Option<&Image>, sampler: Option<&Sampler>) -> Result<()> {
        if self.any {
            return Ok(());
        }
        if let Some(image) = image.filter(|image| image.shape() != Shape::D2) {
            return Err(Error::Usage(format!(
                "image `{}` is `Shape::{:?}`; resource tables of kernels take images of two dimensions without layers",
                image.name(),
                image.shape()
            )));
        }
        if let Some(image) = image.filter(|image| image.format().is_integer()) {
            let (name, format) = (image.name(), image.format());
            let fault = format!("image `{name}` is {format:?}: tables of kernels take no integers");
            return Err(Error::Usage(fault));
        }
        match sampler {
            Some(sampler) if !sampler.plain => Err(Error::Usage(
                "resource tables of kernels take samplers that neither compare nor count texels"
                    .into(),
            )),
            _ => Ok(()),
        }
    }

    /// Frees all slots. If a recording has the table bound, waits for all that was started on the device.
    ///
    /// # Errors
    /// [`Error::Lost`] if the device was lost, which may still be reading.
    pub fn clear(&mut self) -> Result<()> {
        let gpu = self.raw.gpu.clone();
        let _turn = self.turn(&gpu)?;
        for (binding, used) in std::mem::take(&mut self.used).into_iter().enumerate() {
            self.fill(binding as u32, 0, used)?;
        }
        self.slots.clear();
        self.raw.keep.lock().unwrap_or_else(PoisonError::into_inner).clear();
        Ok(())
    }

    /// Opens the table for `commands`: until they are finished, nobody else may bind it, and it can be changed without
    /// waiting for anybody.
    ///
    /// # Errors
    /// [`Error::Usage`] if a recording has it bound already.
    pub(crate) fn open_for(&mut self, commands: &Unfinished) -> Result<()> {
        if self.is_bound() {
            return Err(Error::Usage("a recording has the resource table bound".into()));
        }
        self.open = Some(commands.clone());
        Ok(())
    }

    /// Refuses to bind a table that is open for other commands.
    pub(super) fn check_open(&self, commands: &Unfinished) -> Result<()> {
        match &self.open {
            Some(open) if open.is_now() && !open.is(commands) => {
                Err(Error::Usage("the resource table belongs to a frame that is recorded".into()))
            }
            _ => Ok(()),
        }
    }

    /// Whether a recording has the table bound.
    pub fn is_bound(&self) -> bool {
        Arc::strong_count(&self.raw) > 1
    }

    /// Whether each resource that is inserted from now on takes the next free slot, even if it has one
    /// already: the elements of an array need slots that follow each other.
    pub fn take_fresh_slots(&mut self, fresh: bool) {
        self.fresh = fresh;
    }

    /// Slots that are taken, by binding.
    pub fn used(&self) -> [u32; 5] {
        self.used
    }

    /// Whether some kind of slot is used up.
    pub fn is_full(&self) -> bool {
        let sizes = self.raw.gpu.0.table_sizes.by_binding();
        self.used.iter().zip(sizes).any(|(used, size)| *used == size)
    }

    /// The index of `image` with `sampler`.
    ///
    /// # Errors
    /// [`Error::Full`] if the table is full, as for all functions that insert.
    pub fn insert_sampled(&mut self, image: &Image, sampler: &Sampler) -> Result<u32> {
        use vk::Handle;
        same_device(self, sampler)?;
        self.check_plain(None, Some(sampler))?;
        let key = (0, image.0.view.as_raw(), sampler.handle.as_raw(), 0, 0);
        let info = image_info(image, sampler.handle);
        self.insert_image(key, info, image)
    }

    /// The index of `image` without a sampler.
    ///
    /// # Errors
    /// As [`ResourceTable::insert_sampled`].
    pub fn insert_texture(&mut self, image: &Image) -> Result<u32> {
        use vk::Handle;
        let key = (1, image.0.view.as_raw(), 0, 0, 0);
        self.insert_image(key, image_info(image, vk::Sampler::null()), image)
    }

    /// The index of `sampler`.
    ///
    /// # Errors
    /// As [`ResourceTable::insert_sampled`].
    pub fn insert_sampler(&mut self, sampler: &Sampler) -> Result<u32> {
        use vk::Handle;
        same_device(self, sampler)?;
        self.check_plain(None, Some(sampler))?;
        let key = (2, sampler.handle.as_raw(), 0, 0, 0);
        if let Some(slot) = self.known(&key) {
            return Ok(slot);
        }
        let gpu = self.raw.gpu.clone();
        let _turn = self.turn(&gpu)?;
        let slot = self.take(key)?;
        let info = [vk::DescriptorImageInfo::default().sampler(sampler.handle)];
        self.write(2, slot, &info, &[]);
        Ok(slot)
    }

    /// The index of `image` as a storage image.
    ///
    /// # Errors
    /// As [`ResourceTable::insert_sampled`].
    pub fn insert_storage_image(&mut self, image: &Image) -> Result<u32> {
        use vk::Handle;
        let key = (3, image.0.view.as_raw(), 0, 0, 0);
        self.insert_image(key, image_info(image, vk::Sampler::null()), image)
    }

    /// The index of `buffer` (or of a slice of it) as a storage buffer.
    ///
    /// # Errors
    /// As [`ResourceTable::insert_sampled`], [`Error::Capacity`] if it is longer than a binding
    /// reaches, and [`Error::Usage`] if its first byte is not aligned.
    pub fn insert_buffer<T: Pod>(&mut self, buffer: &Buffer<T>) -> Result<u32> {
        use vk::Handle;
        same_device(self, buffer)?;
        let (offset, bytes) = check_binding(&self.raw.gpu, buffer)?;
        let key = (4, buffer.raw().handle.as_raw(), 0, offset, bytes);
        if let Some(slot) = self.known(&key) {
            return Ok(slot);
        }
        let gpu = self.raw.gpu.clone();
        let _turn = self.turn(&gpu)?;
        let slot = self.take(key)?;
        self.keep(buffer.raw().clone());
        let info = [buffer_info(buffer.raw(), offset, bytes)];
        self.write(4, slot, &[], &info);
        if let Some(addresses) = &self.raw.addresses {
            // SAFETY: only the table has this buffer, and recordings that have the table do not run.
            unsafe {
                addresses.write_out_of_turn(slot as usize, &[buffer.raw().address + offset])?;
            }
        }
        Ok(slot)
    }

    pub(super) fn raw(&self) -> &Arc<RawTable> {
        &self.raw
    }

    fn insert_image(
        &mut self,
        key: Key,
        info: vk::DescriptorImageInfo,
        image: &Image,
    ) -> Result<u32> {
        same_device(self, image)?;
        self.check_plain(Some(image), None)?;
        if let Some(slot) = self.known(&key) {
            return Ok(slot);
        }
        let (usage, storage) = (image.usage(), key.0 == 3);
        if storage && usage != ImageUse::Storage {
            return Err(Error::Usage(format!(
                "image `{}`, made with `ImageUse::{usage:?}`, cannot be one of the table's {}",
                image.name(),
                KINDS[key.0 as usize].1
            )));
        }
        if !storage {
            image.0.check_sampled()?;
        }
        let gpu = self.raw.gpu.clone();
        let _turn = self.turn(&gpu)?;
        let slot = self.take(key)?;
        self.keep(image.0.clone());
        self.write(key.0, slot, &[info], &[]);
        Ok(slot)
    }

    /// The turn of the host, where a recording may have the table.
    fn turn<'g>(&mut self, gpu: &'g Gpu) -> Result<Option<RwLockWriteGuard<'g, ()>>> {
        let open = self.open.as_ref().is_some_and(Unfinished::is_now);
        let shared = !open && Arc::get_mut(&mut self.raw).is_none();
        shared.then(|| gpu.0.host_turn()).transpose()
    }

    /// The slot that the resource has and may share.
    fn known(&self, key: &Key) -> Option<u32> {
        self.slots.get(key).filter(|_| !self.fresh).copied()
    }

    /// The next free slot of the key's binding.
    fn take(&mut self, key: Key) -> Result<u32> {
        let binding = key.0 as usize;
        let size = self.raw.gpu.0.table_sizes.by_binding()[binding];
        let slot = self.used[binding];
        if slot == size {
            return Err(Error::Full(format!(
                "the resource table on {} has {size} {}, all taken: bind less at a time, or open the \
                 device with a larger `GpuOptions::table`",
                self.raw.gpu.name(),
                KINDS[binding].1
            )));
        }
        self.used[binding] += 1;
        if !self.fresh {
            self.slots.insert(key, slot);
        }
        Ok(slot)
    }

    fn keep(&self, what: Arc<dyn Any + Send + Sync>) {
        self.raw.keep.lock().unwrap_or_else(PoisonError::into_inner).push(what);
    }

    /// Makes `count` slots from `first` on show what free slots show.
    fn fill(&self, binding: u32, first: u32, count: u32) -> Result<()> {
        let Placeholders { buffer, sampled, storage, sampler } = &*self.raw.placeholders;
        let sampler = sampler.handle;
        let image = match binding {
            0 => image_info(sampled, sampler),
            2 => vk::DescriptorImageInfo::default().sampler(sampler),
            3 => image_info(storage, vk::Sampler::null()),
            _ => image_info(sampled, vk::Sampler::null()),
        };
        let raw = buffer.raw();
        let buffer = buffer_info(raw, 0, raw.size);
        let mut at = first;
        while at < first + count {
            let n = FILL_CHUNK.min((first + count - at) as usize);
            match binding {
                4 => self.write(binding, at, &[], &[buffer; FILL_CHUNK][..n]),
                _ => self.write(binding, at, &[image; FILL_CHUNK][..n], &[]),
            }
            if let Some(addresses) = self.raw.addresses.as_ref().filter(|_| binding == 4) {
                // SAFETY: only the table has this buffer, and recordings that have the table do not run.
                unsafe {
                    addresses.write_out_of_turn(at as usize, &[raw.address; FILL_CHUNK][..n])?;
                }
            }
            at += n as u32;
        }
        Ok(())
    }

    fn write(
        &self,
        binding: u32,
        slot: u32,
        images: &[vk::DescriptorImageInfo],
        buffers: &[vk::DescriptorBufferInfo],
    ) {
        let mut write = vk::WriteDescriptorSet::default()
            .dst_set(self.raw.set)
            .dst_binding(binding)
            .dst_array_element(slot)
            .descriptor_type(KINDS[binding as usize].0);
        write = match images {
            [] => write.buffer_info(buffers),
            images => write.image_info(images),
        };
        // SAFETY: slots are inside the layout's counts, everything written is kept alive by
        // `keep`, and the bindings may be updated after they were bound.
        unsafe { self.raw.gpu.0.device.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for RawTable {
    fn drop(&mut self) {
        // SAFETY: recordings that use the table hold it until they have ended.
        unsafe { self.gpu.0.device.destroy_descriptor_pool(self.pool, None) };
    }
}

fn image_info(image: &Image, sampler: vk::Sampler) -> vk::DescriptorImageInfo {
    vk::DescriptorImageInfo::default()
        .image_view(image.0.view)
        .image_layout(image.0.shader_layout())
        .sampler(sampler)
}

fn buffer_info(buffer: &RawBuffer, offset: u64, bytes: u64) -> vk::DescriptorBufferInfo {
    vk::DescriptorBufferInfo::default().buffer(buffer.handle).offset(offset).range(bytes)
}

/// Offset and bytes of a storage-buffer binding, if the device allows it.
pub(super) fn check_binding<T: Pod>(gpu: &Gpu, buffer: &Buffer<T>) -> Result<(u64, u64)> {
    let limits = gpu.limits();
    let (offset, bytes) = (buffer.offset(), buffer.descriptor_bytes());
    if bytes > limits.storage_range_bytes {
        let limit_of = format!("one storage-buffer binding on {}", gpu.name());
        let what = format!("buffer `{}`", buffer.name());
        return Err(capacity(&what, bytes, limit_of, limits.storage_range_bytes));
    }
    if offset % limits.storage_offset_bytes != 0 {
        return Err(Error::Usage(format!(
            "buffer `{}` is bound from byte {offset} on; {} asks for multiples of {}",
            buffer.name(),
            gpu.name(),
            limits.storage_offset_bytes
        )));
    }
    Ok((offset, bytes))
}
