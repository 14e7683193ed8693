//! SPIR-V capabilities that a device may lack.
//!
//! Drivers take a module with a capability that they do not have and then do anything, so the check
//! is ours. It lists capabilities that users' shaders are known to use and some device is known to lack;
//! capabilities beyond the list are left to the driver and the validation layer.

use super::requirements::{COMPUTE_DERIVATIVES, Probe};
use ash::vk::{SubgroupFeatureFlags, TRUE};
use rspirv::spirv::{Capability, Op};

/// Instructions without effect, which may stand between any others.
const NO_EFFECT: [Op; 4] = [Op::Nop, Op::Line, Op::NoLine, Op::ModuleProcessed];

/// Whether the device offers the feature that a capability needs.
type Offers = fn(&Probe) -> bool;

/// A capability, what Vulkan calls the feature, and whether a device offers it.
const CAPABILITIES: &[(Capability, &str, Offers)] = &[
    (Capability::Geometry, "geometryShader", |p| p.features.core.geometry_shader == TRUE),
    (Capability::Tessellation, "tessellationShader", |p| {
        p.features.core.tessellation_shader == TRUE
    }),
    (Capability::Float64, "shaderFloat64", |p| p.features.core.shader_float64 == TRUE),
    (Capability::Int64, "shaderInt64", |p| p.features.core.shader_int64 == TRUE),
    (Capability::Int16, "shaderInt16", |p| p.features.core.shader_int16 == TRUE),
    (Capability::Float16, "shaderFloat16", |p| p.features.v12.shader_float16 == TRUE),
    (Capability::Int8, "shaderInt8", |p| p.features.v12.shader_int8 == TRUE),
    (Capability::Int64Atomics, "shaderBufferInt64Atomics", |p| {
        p.features.v12.shader_buffer_int64_atomics == TRUE
    }),
    (Capability::ImageGatherExtended, "shaderImageGatherExtended", |p| {
        p.features.core.shader_image_gather_extended == TRUE
    }),
    (Capability::ImageCubeArray, "imageCubeArray", |p| p.features.core.image_cube_array == TRUE),
    (Capability::SampledCubeArray, "imageCubeArray", |p| p.features.core.image_cube_array == TRUE),
    (Capability::SampleRateShading, "sampleRateShading", |p| {
        p.features.core.sample_rate_shading == TRUE
    }),
    (Capability::ClipDistance, "shaderClipDistance", |p| {
        p.features.core.shader_clip_distance == TRUE
    }),
    (Capability::CullDistance, "shaderCullDistance", |p| {
        p.features.core.shader_cull_distance == TRUE
    }),
    (Capability::DrawParameters, "shaderDrawParameters", |p| {
        p.features.v11.shader_draw_parameters == TRUE
    }),
    (Capability::MultiView, "multiview", |p| p.features.v11.multiview == TRUE),
    (Capability::StorageBuffer16BitAccess, "storageBuffer16BitAccess", |p| {
        p.features.v11.storage_buffer16_bit_access == TRUE
    }),
    (Capability::StorageBuffer8BitAccess, "storageBuffer8BitAccess", |p| {
        p.features.v12.storage_buffer8_bit_access == TRUE
    }),
    (Capability::PhysicalStorageBufferAddresses, "bufferDeviceAddress", |p| {
        p.features.v12.buffer_device_address == TRUE
    }),
    (Capability::VulkanMemoryModel, "vulkanMemoryModel", |p| {
        p.features.v12.vulkan_memory_model == TRUE
    }),
    (Capability::StorageImageReadWithoutFormat, "shaderStorageImageReadWithoutFormat", |p| {
        p.features.core.shader_storage_image_read_without_format == TRUE
    }),
    (Capability::StorageImageWriteWithoutFormat, "shaderStorageImageWriteWithoutFormat", |p| {
        p.features.core.shader_storage_image_write_without_format == TRUE
    }),
    (Capability::StorageImageExtendedFormats, "shaderStorageImageExtendedFormats", |p| {
        p.features.core.shader_storage_image_extended_formats == TRUE
    }),
    (Capability::StorageImageMultisample, "shaderStorageImageMultisample", |p| {
        p.features.core.shader_storage_image_multisample == TRUE
    }),
    (Capability::MinLod, "shaderResourceMinLod", |p| {
        p.features.core.shader_resource_min_lod == TRUE
    }),
    (Capability::InterpolationFunction, "sampleRateShading", |p| {
        p.features.core.sample_rate_shading == TRUE
    }),
    (Capability::DotProduct, "shaderIntegerDotProduct", |p| {
        p.features.v13.shader_integer_dot_product == TRUE
    }),
    (Capability::GroupNonUniformShuffleRelative, "relative shuffles of subgroups", |p| {
        subgroups(p, SubgroupFeatureFlags::SHUFFLE_RELATIVE)
    }),
    (Capability::GroupNonUniformClustered, "clustered subgroup operations", |p| {
        subgroups(p, SubgroupFeatureFlags::CLUSTERED)
    }),
    (Capability::ComputeDerivativeGroupLinearKHR, "VK_KHR_compute_shader_derivatives", |p| {
        COMPUTE_DERIVATIVES.is_on(&p.features)
    }),
];

fn subgroups(probe: &Probe, operations: SubgroupFeatureFlags) -> bool {
    probe.vulkan11.subgroup_supported_operations.contains(operations)
}

/// The capabilities of the list that the device lacks.
pub(super) fn lacking(probe: &Probe) -> Vec<(Capability, &'static str)> {
    let lacks = |(c, name, offers): &(Capability, &'static str, Offers)| {
        (!offers(probe)).then_some((*c, *name))
    };
    CAPABILITIES.iter().filter_map(lacks).collect()
}

/// The feature that the module asks for and that is among those `lacking`.
pub(crate) fn missing_feature(
    lacking: &[(Capability, &'static str)],
    words: &[u32],
) -> Option<&'static str> {
    declared(words).find_map(|capability| {
        lacking.iter().find(|(c, _)| *c as u32 == capability).map(|(_, name)| *name)
    })
}

/// Whether the module takes derivatives by instructions of compute shaders.
pub(super) fn has_compute_derivatives(words: &[u32]) -> bool {
    declares(words, Capability::ComputeDerivativeGroupLinearKHR)
}

/// Whether the module declares `capability`.
pub(super) fn declares(words: &[u32], capability: Capability) -> bool {
    declared(words).any(|declared| declared == capability as u32)
}

/// The capabilities that the module declares. Nothing but instructions without effect may stand before
/// and between them.
fn declared(words: &[u32]) -> impl Iterator<Item = u32> {
    const HEADER_WORDS: usize = 5;
    let mut rest = words.get(HEADER_WORDS..).unwrap_or_default();
    std::iter::from_fn(move || {
        loop {
            let (&first, operands) = rest.split_first()?;
            // A length of 0 is nonsense and must not be an endless loop.
            rest = rest.get((first >> 16).max(1) as usize..).unwrap_or_default();
            match first & 0xffff {
                op if op == Op::Capability as u32 => return operands.first().copied(),
                op if NO_EFFECT.iter().any(|known| *known as u32 == op) => {}
                _ => return None,
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capability_that_is_lacking_is_named() {
        let lacking = lacking(&Probe::default());
        assert_eq!(lacking.len(), CAPABILITIES.len());
        let op = |c: Capability| [2 << 16 | Op::Capability as u32, c as u32];
        let mut words = vec![0x0723_0203, 0x1_0500, 0, 9, 0];
        words.extend(op(Capability::Shader));
        assert_eq!(missing_feature(&lacking, &words), None);
        words.extend(op(Capability::Geometry));
        assert_eq!(missing_feature(&lacking, &words), Some("geometryShader"));
        assert_eq!(missing_feature(&[], &words), None);
        assert_eq!(missing_feature(&lacking, &words[..3]), None);
        assert!(!has_compute_derivatives(&words));
        words.extend(op(Capability::ComputeDerivativeGroupLinearKHR));
        assert!(has_compute_derivatives(&words));
        let mut hidden = words.clone();
        hidden.splice(5..5, [1 << 16 | Op::Nop as u32]);
        assert_eq!(missing_feature(&lacking, &hidden), Some("geometryShader"));
        assert!(has_compute_derivatives(&hidden));
        words[5] = Op::Capability as u32;
        assert_eq!(missing_feature(&lacking, &words), None);
    }
}
