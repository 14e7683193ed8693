//! Descriptor sets from binding sets, one for each (binding set, layout) of a pass.

use super::{layout::descriptor_type, pipeline::Compiled};
use crate::{
    error::Result,
    pass::{self, Binding, BindingSet},
    shader::Resource,
    vk::{Buffer, Commands, Copies, Gpu, Resources},
};
use ash::vk;
use std::{collections::HashMap, sync::Arc};

/// The descriptor sets of one recording.
pub(super) struct Bindings {
    /// By binding set, pipeline and number of the set. The layout is no key: the descriptors depend on the
    /// pipeline's shaders too, and a driver may give equal layouts one handle.
    sets: HashMap<(*const BindingSet, *const Compiled, usize), vk::DescriptorSet>,
    copies: Copies,
}

/// The content of one descriptor.
enum Written {
    Buffer(vk::DescriptorBufferInfo),
    Image(vk::DescriptorImageInfo),
}

impl Bindings {
    /// None yet.
    pub fn new(copies: Copies) -> Self {
        Self { sets: HashMap::new(), copies }
    }

    /// The sets of one draw, by number.
    pub fn sets(
        &mut self,
        gpu: &Gpu,
        resources: &mut Resources,
        commands: &mut Commands,
        draw: &pass::Draw,
        compiled: &Compiled,
    ) -> Result<Vec<vk::DescriptorSet>> {
        let empty = Arc::new(BindingSet::default());
        let mut sets = Vec::with_capacity(compiled.layout.sets.len());
        for (n, &layout) in compiled.layout.sets.iter().enumerate() {
            let set = draw.sets.get(n).unwrap_or(&empty);
            let key = (Arc::as_ptr(set), std::ptr::from_ref(compiled), n);
            let found = match self.sets.get(&key) {
                Some(&found) => found,
                None => {
                    let wanted: Vec<_> =
                        compiled.resources.iter().filter(|r| r.set as usize == n).collect();
                    let made = self.make(gpu, resources, commands, set, layout, &wanted)?;
                    // The one for a gap between sets goes with this call, and its address with it.
                    if !Arc::ptr_eq(set, &empty) {
                        self.sets.insert(key, made);
                    }
                    made
                }
            };
            sets.push(found);
        }
        Ok(sets)
    }

    fn make(
        &self,
        gpu: &Gpu,
        resources: &mut Resources,
        commands: &mut Commands,
        set: &BindingSet,
        layout: vk::DescriptorSetLayout,
        wanted: &[&Resource],
    ) -> Result<vk::DescriptorSet> {
        let count = wanted.iter().map(|r| r.count).sum();
        let raw = commands.descriptor_set(layout, count)?;
        for resource in wanted {
            let entries = set.entries.iter().filter(|e| e.binding == resource.binding);
            let Some(entry) = entries.into_iter().next() else { continue };
            let (mut buffers, mut images) = (Vec::new(), Vec::new());
            // A run-time array is as long as the longest: its end repeats the last element, so that
            // no descriptor is left unwritten.
            let last = entry.resources.last();
            let padded = entry.resources.iter().chain(std::iter::repeat_with(|| last).flatten());
            for binding in padded.take(resource.count as usize) {
                match self.write(gpu, resources, commands, binding, resource)? {
                    Written::Buffer(info) => buffers.push(info),
                    Written::Image(info) => images.push(info),
                }
            }
            let write = vk::WriteDescriptorSet::default()
                .dst_set(raw)
                .dst_binding(resource.binding)
                .descriptor_type(descriptor_type(resource.kind));
            let write = match images.is_empty() {
                true => write.buffer_info(&buffers),
                false => write.image_info(&images),
            };
            // SAFETY: the set is new; the recording keeps the resources that are written to it.
            unsafe { gpu.0.device.update_descriptor_sets(&[write], &[]) };
        }
        Ok(raw)
    }

    fn write(
        &self,
        gpu: &Gpu,
        resources: &mut Resources,
        commands: &mut Commands,
        binding: &Binding,
        resource: &Resource,
    ) -> Result<Written> {
        let image_info = vk::DescriptorImageInfo::default();
        Ok(match binding {
            Binding::Uniform(range) => {
                // A pass may bind more than the block has, or less. Ranges of uniforms are limited; within
                // that, all is bound, since a specialization constant may make the block longer.
                let bytes = resource.bytes.max(1);
                let block = resources.block(range, bytes as usize)?;
                commands.keep(block.raw().clone());
                let limit = gpu.0.draw_limits.uniform_bytes as usize;
                let bound = range.bytes.min(limit).max(bytes as usize);
                buffer_info(&block, block.offset(), bound as u64)
            }
            Binding::Storage(range) => {
                let buffer = self.copies.storage(resources, &range.buffer)?;
                commands.keep(buffer.raw().clone());
                let (bytes, limit) = (range.bytes as u64, gpu.limits().storage_range_bytes);
                if bytes > limit {
                    return Err(crate::Error::Capacity {
                        what: format!("storage block in buffer `{}`", range.buffer.label()),
                        wanted: bytes,
                        limit_of: format!("one binding on {}", gpu.info().name),
                        limit,
                        advice: "bind a smaller range".into(),
                    });
                }
                buffer_info(&buffer, buffer.offset() + range.offset as u64, bytes)
            }
            Binding::Sampled(texture, state) => {
                let (image, sampler) = resources.sampled(texture, state)?;
                commands.keep(image.0.clone());
                Written::Image(
                    image_info
                        .image_view(image.0.view)
                        .image_layout(image.0.shader_layout())
                        .sampler(sampler.handle),
                )
            }
            Binding::Texture(texture) | Binding::StorageImage(texture) => {
                let image = resources.texture(texture)?;
                commands.keep(image.0.clone());
                Written::Image(
                    image_info.image_view(image.0.view).image_layout(image.0.shader_layout()),
                )
            }
            Binding::Sampler(state) => {
                Written::Image(image_info.sampler(resources.sampler(state)?.handle))
            }
        })
    }
}

fn buffer_info(buffer: &Buffer<u8>, offset: u64, bytes: u64) -> Written {
    let info = vk::DescriptorBufferInfo::default().buffer(buffer.raw().handle);
    Written::Buffer(info.offset(offset).range(bytes))
}
