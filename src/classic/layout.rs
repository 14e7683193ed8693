//! Descriptor set layouts, merged from the reflection of both stages.

use crate::{
    error::{Error, Result},
    shader::{Resource, ResourceKind},
    vk::Gpu,
};
use ash::vk;

pub(super) const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::VERTEX.as_raw() | vk::ShaderStageFlags::FRAGMENT.as_raw(),
);

/// Set layouts and the pipeline layout.
pub(super) struct Layout {
    gpu: Gpu,
    /// By number of the set, without gaps.
    pub sets: Vec<vk::DescriptorSetLayout>,
    pub raw: vk::PipelineLayout,
    pub push_constant_bytes: u32,
}

impl Layout {
    /// The layout of `resources` (each with its final count) and a push-constant block.
    pub fn new(gpu: &Gpu, label: &str, resources: &[Resource], push_bytes: u32) -> Result<Self> {
        let device = &gpu.0.device;
        let limits = gpu.0.draw_limits;
        let sets = resources.iter().map(|r| r.set.saturating_add(1)).max().unwrap_or(0);
        let push_constant_bytes = push_bytes.next_multiple_of(4);
        let refuse = |what: String| {
            Err(Error::Device(format!(
                "pipeline `{label}` {what} of {}; the compute executor has no such limit",
                gpu.info().name
            )))
        };
        if sets > limits.sets {
            return refuse(format!("binds set {}, beyond the {} sets", sets - 1, limits.sets));
        }
        if push_constant_bytes > gpu.0.push_constant_bytes {
            let most = gpu.0.push_constant_bytes;
            return refuse(format!("pushes {push_constant_bytes} bytes, beyond the {most}"));
        }
        for (kinds, most, what) in [
            (&[ResourceKind::Uniform][..], limits.uniforms, "uniform blocks"),
            (&[ResourceKind::Storage], limits.storages, "storage blocks"),
            (&[ResourceKind::Sampled, ResourceKind::Texture], limits.images, "images"),
            (&[ResourceKind::Sampled, ResourceKind::Sampler], limits.samplers, "samplers"),
            (&[ResourceKind::StorageImage], limits.storage_images, "storage images"),
        ] {
            let bound = resources.iter().filter(|r| kinds.contains(&r.kind));
            let count: u64 = bound.map(|r| u64::from(r.count)).sum();
            if count > most.into() {
                return refuse(format!("binds {count} {what}, beyond the {most}"));
            }
        }
        let is_too_long =
            |r: &&Resource| r.kind == ResourceKind::Uniform && r.bytes > limits.uniform_bytes;
        if let Some(block) = resources.iter().find(is_too_long) {
            let (bytes, most) = (block.bytes, limits.uniform_bytes);
            return refuse(format!("has a uniform block of {bytes} bytes, beyond the {most}"));
        }
        // From here on what exists is destroyed if anything fails.
        let mut layout = Self {
            gpu: gpu.clone(),
            sets: Vec::new(),
            raw: vk::PipelineLayout::null(),
            push_constant_bytes,
        };
        let what = || format!("creating the layout of pipeline `{label}`");
        for set in 0..sets {
            let bindings: Vec<_> = resources
                .iter()
                .filter(|r| r.set == set)
                .map(|r| {
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(r.binding)
                        .descriptor_type(descriptor_type(r.kind))
                        .descriptor_count(r.count)
                        .stage_flags(STAGES)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            // SAFETY: the device is alive; counts are inside its limits.
            let created = unsafe { device.create_descriptor_set_layout(&info, None) };
            layout.sets.push(created.map_err(|e| gpu.failure(&what(), e))?);
        }
        let push = [vk::PushConstantRange::default().stage_flags(STAGES).size(push_constant_bytes)];
        let push = if push_constant_bytes > 0 { &push[..] } else { &[] };
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&layout.sets)
            .push_constant_ranges(push);
        // SAFETY: the set layouts are alive.
        layout.raw = unsafe { device.create_pipeline_layout(&info, None) }
            .map_err(|e| gpu.failure(&what(), e))?;
        Ok(layout)
    }
}

pub(super) fn descriptor_type(kind: ResourceKind) -> vk::DescriptorType {
    match kind {
        ResourceKind::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        ResourceKind::Storage => vk::DescriptorType::STORAGE_BUFFER,
        ResourceKind::Sampled => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        ResourceKind::Texture => vk::DescriptorType::SAMPLED_IMAGE,
        ResourceKind::Sampler => vk::DescriptorType::SAMPLER,
        ResourceKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
    }
}

impl Drop for Layout {
    fn drop(&mut self) {
        // SAFETY: pipelines and recordings that use it hold it.
        unsafe {
            self.gpu.0.device.destroy_pipeline_layout(self.raw, None);
            for set in self.sets.drain(..) {
                self.gpu.0.device.destroy_descriptor_set_layout(set, None);
            }
        }
    }
}
