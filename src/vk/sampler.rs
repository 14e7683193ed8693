//! Samplers: one Vulkan object per distinct state, kept with the device.

use super::{gpu::Gpu, requirements::Probe};
use crate::{
    error::{Error, Result},
    state::Compare,
    texture::{self, Border, Filter, Wrap},
};
use ash::vk;
use std::sync::PoisonError;

/// The state of a sampler: what is a choice, and the bits of what is a number.
pub(super) type SamplerKey =
    ([Wrap; 3], [Filter; 2], Option<Filter>, [u32; 4], Option<Compare>, Border, bool);

/// What samplers of a device can do.
#[derive(Clone, Copy)]
pub(crate) struct SamplerLimits {
    /// Greatest distance of a bias from 0.
    pub lod_bias: f32,
    /// Greatest anisotropy, 1 if there is none.
    pub anisotropy: f32,
    /// [`Wrap::MirrorClampToEdge`].
    pub mirror_clamp: bool,
    /// Samplers that there may be.
    pub count: u32,
}

impl SamplerLimits {
    pub(super) fn new(probe: &Probe) -> Self {
        let limits = &probe.properties.limits;
        Self {
            lod_bias: limits.max_sampler_lod_bias,
            anisotropy: match probe.features.core.sampler_anisotropy {
                vk::TRUE => limits.max_sampler_anisotropy,
                _ => 1.0,
            },
            mirror_clamp: probe.features.v12.sampler_mirror_clamp_to_edge == vk::TRUE,
            count: limits.max_sampler_allocation_count,
        }
    }
}

/// A sampler of the device.
#[derive(Clone)]
pub struct Sampler {
    pub(crate) handle: vk::Sampler,
    /// Whether it neither compares nor counts texels.
    pub(super) plain: bool,
    /// Keeps the device, which owns the handle.
    pub(super) gpu: Gpu,
}

impl Sampler {
    /// The sampler for this state; the same state gives the same Vulkan object.
    ///
    /// # Errors
    /// [`Error::Usage`] for a state that Vulkan does not allow; [`Error::Device`] for one that the device does not have;
    /// [`Error::Full`] if the device has no room for another sampler.
    pub fn new(gpu: &Gpu, state: &texture::Sampler) -> Result<Self> {
        let numbers = [state.lod_bias, state.min_lod, state.max_lod, state.anisotropy];
        let key = (
            [state.wrap_u, state.wrap_v, state.wrap_w],
            [state.mag, state.min],
            state.mip,
            numbers.map(f32::to_bits),
            state.compare,
            state.border,
            state.unnormalized,
        );
        let plain = state.compare.is_none() && !state.unnormalized;
        let mut samplers = gpu.0.samplers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&handle) = samplers.get(&key) {
            return Ok(Self { handle, plain, gpu: gpu.clone() });
        }
        state.check().map_err(|fault| Error::Usage(format!("sampler: {fault}")))?;
        check_offered(gpu, state)?;
        if samplers.len() >= gpu.0.sampler_limits.count as usize {
            return Err(Error::Full(format!(
                "{} allows {} samplers of different states at most, and all of them were made: they stay until the \
                 device is closed",
                gpu.name(),
                samplers.len()
            )));
        }
        // The specification's recipe for "no mipmapping" keeps magnification and minification apart: anything below 0.5
        // rounds to level 0. Coordinates that are not normalized have no levels at all.
        let (min_lod, max_lod) = match (state.mip, state.unnormalized) {
            (_, true) => (0.0, 0.0),
            (None, false) => (0.0, 0.25),
            (Some(_), false) => (state.min_lod, state.max_lod),
        };
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(filter(state.mag))
            .min_filter(filter(state.min))
            .mipmap_mode(match state.mip {
                Some(Filter::Linear) => vk::SamplerMipmapMode::LINEAR,
                _ => vk::SamplerMipmapMode::NEAREST,
            })
            .address_mode_u(wrap(state.wrap_u))
            .address_mode_v(wrap(state.wrap_v))
            .address_mode_w(wrap(state.wrap_w))
            .mip_lod_bias(state.lod_bias)
            .min_lod(min_lod)
            .max_lod(max_lod)
            .anisotropy_enable(state.anisotropy > 1.0)
            .max_anisotropy(state.anisotropy)
            .compare_enable(state.compare.is_some())
            .compare_op(state.compare.map_or(vk::CompareOp::NEVER, compare_op))
            .border_color(match state.border {
                Border::TransparentBlack => vk::BorderColor::FLOAT_TRANSPARENT_BLACK,
                Border::OpaqueBlack => vk::BorderColor::FLOAT_OPAQUE_BLACK,
                Border::OpaqueWhite => vk::BorderColor::FLOAT_OPAQUE_WHITE,
            })
            .unnormalized_coordinates(state.unnormalized);
        // SAFETY: the device is alive, and has what the state asks for.
        let handle = unsafe { gpu.0.device.create_sampler(&info, None) }
            .map_err(|e| gpu.failure("creating a sampler", e))?;
        samplers.insert(key, handle);
        Ok(Self { handle, plain, gpu: gpu.clone() })
    }
}

/// Refuses what the device does not have.
fn check_offered(gpu: &Gpu, state: &texture::Sampler) -> Result<()> {
    let SamplerLimits { lod_bias, anisotropy, mirror_clamp, .. } = gpu.0.sampler_limits;
    let fault = |text: String| Err(Error::Device(format!("sampler: {} {text}", gpu.name())));
    if state.lod_bias.abs() > lod_bias {
        return fault(format!("allows a bias of {lod_bias} at most, not {}", state.lod_bias));
    }
    if state.anisotropy > anisotropy {
        return match anisotropy {
            1.0 => fault(
                "has no anisotropy, or was opened without the feature samplerAnisotropy".into(),
            ),
            most => {
                fault(format!("allows an anisotropy of {most} at most, not {}", state.anisotropy))
            }
        };
    }
    let mirrors = [state.wrap_u, state.wrap_v, state.wrap_w].contains(&Wrap::MirrorClampToEdge);
    if mirrors && !mirror_clamp {
        return fault("has no `Wrap::MirrorClampToEdge`, or was opened without the feature samplerMirrorClampToEdge".into());
    }
    Ok(())
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
        Wrap::ClampToBorder => vk::SamplerAddressMode::CLAMP_TO_BORDER,
        Wrap::MirrorClampToEdge => vk::SamplerAddressMode::MIRROR_CLAMP_TO_EDGE,
    }
}

/// Vulkan's name of a comparison.
pub(crate) fn compare_op(compare: Compare) -> vk::CompareOp {
    match compare {
        Compare::Never => vk::CompareOp::NEVER,
        Compare::Less => vk::CompareOp::LESS,
        Compare::Equal => vk::CompareOp::EQUAL,
        Compare::LessOrEqual => vk::CompareOp::LESS_OR_EQUAL,
        Compare::Greater => vk::CompareOp::GREATER,
        Compare::NotEqual => vk::CompareOp::NOT_EQUAL,
        Compare::GreaterOrEqual => vk::CompareOp::GREATER_OR_EQUAL,
        Compare::Always => vk::CompareOp::ALWAYS,
    }
}
