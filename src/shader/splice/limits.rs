//! Lists of the declarations that a user's module may have. Everything that is not on a list is refused.
//!
//! SPIR-V grows by capabilities, and each may change the meaning of known instructions. So an unknown
//! capability is an error that names it; the same holds for extensions, execution modes and decorations. A
//! declaration on a list is kept for the compute kernel, replaced, or dropped because the splicer has lowered
//! the feature that it stands for.

use crate::shader::module::Outcome;
use rspirv::spirv::{Capability, Decoration, ExecutionMode, StorageClass};

/// How a declared capability is handled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// The kernel declares it too. The device is checked for it when the kernel is made.
    Keep,
    /// The kernel declares another one.
    Replace(Capability),
    /// It means nothing in a kernel: the feature is lowered, or refused where it is used.
    Drop,
    /// Out of reach.
    Refuse,
}

/// How `capability` is handled.
pub(super) fn capability(capability: Capability) -> Fate {
    use Capability as C;
    use Fate::{Drop, Keep, Refuse, Replace};
    match capability {
        C::Matrix
        | C::Shader
        | C::Sampled1D
        | C::Image1D
        | C::SampledCubeArray
        | C::ImageCubeArray
        | C::ImageQuery
        | C::ImageGatherExtended
        | C::MinLod
        | C::DerivativeControl
        | C::StorageImageExtendedFormats
        | C::StorageImageReadWithoutFormat
        | C::StorageImageWriteWithoutFormat
        | C::StorageImageMultisample
        | C::ImageMSArray
        | C::GroupNonUniform
        | C::GroupNonUniformVote
        | C::GroupNonUniformArithmetic
        | C::GroupNonUniformBallot
        | C::GroupNonUniformShuffle
        | C::GroupNonUniformShuffleRelative
        | C::GroupNonUniformClustered
        | C::GroupNonUniformQuad
        | C::Float64
        | C::Float16
        | C::Int64
        | C::Int16
        | C::Int8
        | C::Int64Atomics
        | C::StorageBuffer16BitAccess
        | C::StorageBuffer8BitAccess
        | C::PhysicalStorageBufferAddresses
        | C::DotProduct
        | C::DotProductInputAll
        | C::DotProductInput4x8Bit
        | C::DotProductInput4x8BitPacked
        // The table's own.
        | C::ShaderNonUniform
        | C::RuntimeDescriptorArray
        | C::SampledImageArrayDynamicIndexing
        | C::SampledImageArrayNonUniformIndexing
        | C::StorageBufferArrayDynamicIndexing
        | C::StorageBufferArrayNonUniformIndexing
        | C::StorageImageArrayDynamicIndexing
        | C::StorageImageArrayNonUniformIndexing => Keep,
        // Uniform and push-constant blocks are storage buffers in a kernel.
        C::UniformBufferArrayDynamicIndexing => Replace(C::StorageBufferArrayDynamicIndexing),
        C::UniformBufferArrayNonUniformIndexing => Replace(C::StorageBufferArrayNonUniformIndexing),
        C::UniformAndStorageBuffer16BitAccess | C::StoragePushConstant16 => {
            Replace(C::StorageBuffer16BitAccess)
        }
        C::UniformAndStorageBuffer8BitAccess | C::StoragePushConstant8 => {
            Replace(C::StorageBuffer8BitAccess)
        }
        C::DemoteToHelperInvocation
        | C::SampledBuffer
        | C::ImageBuffer
        | C::InputAttachment
        | C::StorageInputOutput16
        | C::Geometry
        | C::Tessellation
        | C::MultiViewport
        | C::ClipDistance
        | C::CullDistance
        | C::SampleRateShading
        | C::InterpolationFunction
        | C::DrawParameters
        | C::MultiView
        | C::ShaderViewportIndexLayerEXT
        | C::ShaderLayer
        | C::ShaderViewportIndex
        | C::StencilExportEXT
        | C::FragmentShadingRateKHR
        | C::FragmentBarycentricKHR => Drop,
        _ => Refuse,
    }
}

/// Whether an extension is kept (`Some(true)`), dropped (`Some(false)`) or refused.
pub(super) fn extension(name: &str) -> Option<bool> {
    match name {
        "SPV_KHR_storage_buffer_storage_class"
        | "SPV_EXT_descriptor_indexing"
        | "SPV_KHR_16bit_storage"
        | "SPV_KHR_8bit_storage"
        | "SPV_KHR_physical_storage_buffer"
        | "SPV_EXT_physical_storage_buffer"
        | "SPV_KHR_integer_dot_product"
        | "SPV_KHR_no_integer_wrap_decoration" => Some(true),
        "SPV_EXT_demote_to_helper_invocation"
        | "SPV_KHR_terminate_invocation"
        | "SPV_KHR_relaxed_extended_instruction"
        | "SPV_EXT_shader_stencil_export"
        | "SPV_KHR_multiview"
        | "SPV_KHR_shader_draw_parameters"
        | "SPV_EXT_shader_viewport_index_layer"
        | "SPV_KHR_fragment_shading_rate"
        | "SPV_KHR_fragment_shader_barycentric"
        | "SPV_GOOGLE_decorate_string"
        | "SPV_GOOGLE_hlsl_functionality1"
        | "SPV_GOOGLE_user_type" => Some(false),
        _ => None,
    }
}

/// Whether the engine supports an execution mode. Reflection reports early tests and written depth; the
/// promises about written depth need no support.
pub(super) fn execution_mode(mode: ExecutionMode) -> bool {
    matches!(
        mode,
        ExecutionMode::OriginUpperLeft
            | ExecutionMode::EarlyFragmentTests
            | ExecutionMode::DepthReplacing
            | ExecutionMode::StencilRefReplacingEXT
            | ExecutionMode::DepthGreater
            | ExecutionMode::DepthLess
            | ExecutionMode::DepthUnchanged
    )
}

/// Whether a decoration is kept (`Some(true)`), dropped (`Some(false)`) or refused.
pub(super) fn decoration(decoration: Decoration) -> Option<bool> {
    use Decoration as D;
    match decoration {
        D::SpecId
        | D::Block
        | D::RowMajor
        | D::ColMajor
        | D::ArrayStride
        | D::MatrixStride
        | D::Offset
        | D::NoContraction
        | D::NonUniform
        | D::Restrict
        | D::Aliased
        | D::Volatile
        | D::Coherent
        | D::NonWritable
        | D::NonReadable
        | D::RestrictPointer
        | D::AliasedPointer
        | D::NoSignedWrap
        | D::NoUnsignedWrap => Some(true),
        // Handled elsewhere: the interface, the table, `BufferBlock` becomes `Block`. Reduced
        // precision may always be ignored; one sample has its centroid at the pixel's centre; and
        // the engine's arithmetic is invariant.
        D::BuiltIn
        | D::Location
        | D::Component
        | D::Index
        | D::Flat
        | D::NoPerspective
        | D::Centroid
        | D::Sample
        | D::Invariant
        | D::Binding
        | D::DescriptorSet
        | D::InputAttachmentIndex
        | D::BufferBlock
        | D::RelaxedPrecision
        | D::UserSemantic
        | D::UserTypeGOOGLE => Some(false),
        _ => None,
    }
}

/// The kernel's storage class for one of the user's.
pub(super) fn storage_class(class: StorageClass) -> Outcome<StorageClass> {
    match class {
        StorageClass::Input | StorageClass::Output | StorageClass::Private => {
            Ok(StorageClass::Private)
        }
        StorageClass::Uniform | StorageClass::StorageBuffer | StorageClass::PushConstant => {
            Ok(StorageClass::StorageBuffer)
        }
        StorageClass::Function
        | StorageClass::UniformConstant
        | StorageClass::Image
        | StorageClass::PhysicalStorageBuffer => Ok(class),
        other => Err(format!("the storage class {other:?}")),
    }
}
