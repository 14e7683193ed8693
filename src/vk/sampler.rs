//! Samplers: one Vulkan object per distinct state, kept with the device.

use super::gpu::Gpu;
use crate::{
    error::Result,
    texture::{self, Filter, Wrap},
};
use ash::vk;
use std::sync::PoisonError;

/// The state of a sampler.
pub(super) type SamplerKey = (Wrap, Wrap, Filter, Filter, Option<Filter>);

/// A sampler of the device.
#[derive(Clone)]
pub struct Sampler {
    pub(crate) handle: vk::Sampler,
    /// Keeps the device, which owns the handle.
    pub(super) gpu: Gpu,
}

impl Sampler {
    /// The sampler for this state; the same state gives the same Vulkan object.
    ///
    /// # Errors
    /// [`crate::Error::Full`] if the device has no room for another sampler.
    pub fn new(gpu: &Gpu, state: &texture::Sampler) -> Result<Self> {
        let key = (state.wrap_u, state.wrap_v, state.mag, state.min, state.mip);
        let mut samplers = gpu.0.samplers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&handle) = samplers.get(&key) {
            return Ok(Self { handle, gpu: gpu.clone() });
        }
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(filter(state.mag))
            .min_filter(filter(state.min))
            .mipmap_mode(match state.mip {
                Some(Filter::Linear) => vk::SamplerMipmapMode::LINEAR,
                _ => vk::SamplerMipmapMode::NEAREST,
            })
            .address_mode_u(wrap(state.wrap_u))
            .address_mode_v(wrap(state.wrap_v))
            .address_mode_w(vk::SamplerAddressMode::REPEAT)
            .min_lod(0.0)
            // The specification's recipe for "no mipmapping" keeps magnification and minification
            // apart: anything below 0.5 rounds to level 0.
            .max_lod(if state.mip.is_some() { vk::LOD_CLAMP_NONE } else { 0.25 });
        // SAFETY: the device is alive.
        let handle = unsafe { gpu.0.device.create_sampler(&info, None) }
            .map_err(|e| gpu.failure("creating a sampler", e))?;
        samplers.insert(key, handle);
        Ok(Self { handle, gpu: gpu.clone() })
    }
}

fn filter(filter: Filter) -> vk::Filter {
    match filter {
        Filter::Nearest => vk::Filter::NEAREST,
        Filter::Linear => vk::Filter::LINEAR,
    }
}

fn wrap(wrap: Wrap) -> vk::SamplerAddressMode {
    match wrap {
        Wrap::Repeat => vk::SamplerAddressMode::REPEAT,
        Wrap::MirroredRepeat => vk::SamplerAddressMode::MIRRORED_REPEAT,
        Wrap::ClampToEdge => vk::SamplerAddressMode::CLAMP_TO_EDGE,
    }
}
