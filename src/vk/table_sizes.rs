//! How many slots a resource table has.

use super::requirements::Probe;

/// Slots of each kind. If a device offers fewer of a kind, their number is cut down when it is opened.
///
/// CPU drivers spend memory and time on every slot, used or not: lavapipe a seventh of a microsecond.
/// The default is enough for ten thousand draws with blocks of their own; a pass that binds more has
/// several tables. (Tried: a variable descriptor count that grows with the pass. Lavapipe allocates for
/// the most that the layout allows, whatever the count.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TableSizes {
    /// Binding 0: images with their samplers.
    pub sampled: u32,
    /// Binding 1: images.
    pub textures: u32,
    /// Binding 2: samplers.
    pub samplers: u32,
    /// Binding 3: storage images.
    pub storage_images: u32,
    /// Binding 4: storage, uniform and push-constant blocks.
    pub buffers: u32,
}

impl Default for TableSizes {
    fn default() -> Self {
        Self { sampled: 2048, textures: 512, samplers: 128, storage_images: 32, buffers: 32768 }
    }
}

/// Storage buffers that a kernel's own set may have beside the table.
const KERNEL_BUFFERS: u32 = 32;

impl TableSizes {
    /// Slots by binding.
    pub fn by_binding(self) -> [u32; 5] {
        [self.sampled, self.textures, self.samplers, self.storage_images, self.buffers]
    }

    /// The sizes that the device has room for.
    pub(super) fn capped(self, probe: &Probe) -> Self {
        let l = &probe.vulkan12;
        let of = |stage: u32, set: u32| stage.min(set);
        let samplers = of(
            l.max_per_stage_descriptor_update_after_bind_samplers,
            l.max_descriptor_set_update_after_bind_samplers,
        );
        let images = of(
            l.max_per_stage_descriptor_update_after_bind_sampled_images,
            l.max_descriptor_set_update_after_bind_sampled_images,
        );
        let storage_images = of(
            l.max_per_stage_descriptor_update_after_bind_storage_images,
            l.max_descriptor_set_update_after_bind_storage_images,
        );
        let buffers = of(
            l.max_per_stage_descriptor_update_after_bind_storage_buffers,
            l.max_descriptor_set_update_after_bind_storage_buffers,
        );
        // A sampled image counts as a sampler and as an image. Half of what is left over all kinds
        // is the fair share of the largest one.
        let all = l.max_per_stage_update_after_bind_resources;
        Self {
            sampled: self.sampled.min(samplers / 2).min(images / 2).min(all / 8).max(1),
            textures: self.textures.min(images / 2).min(all / 8).max(1),
            samplers: self.samplers.min(samplers / 2).min(all / 8).max(1),
            storage_images: self.storage_images.min(storage_images).min(all / 8).max(1),
            buffers: self.buffers.min(buffers.saturating_sub(KERNEL_BUFFERS)).min(all / 4).max(1),
        }
    }
}
