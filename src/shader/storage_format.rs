//! The formats that shaders declare for storage images.

use crate::format::Format;
use rspirv::spirv::ImageFormat;

/// The format that a shader means. `None` if images have no such format here, and also if it names none.
pub(super) fn storage_format(declared: ImageFormat) -> Option<Format> {
    type F = ImageFormat;
    Some(match declared {
        F::R8 => Format::R8Unorm,
        F::R8Snorm => Format::R8Snorm,
        F::R8ui => Format::R8Uint,
        F::R8i => Format::R8Sint,
        F::Rg8 => Format::Rg8Unorm,
        F::Rg8Snorm => Format::Rg8Snorm,
        F::Rg8ui => Format::Rg8Uint,
        F::Rg8i => Format::Rg8Sint,
        F::Rgba8 => Format::Rgba8Unorm,
        F::Rgba8Snorm => Format::Rgba8Snorm,
        F::Rgba8ui => Format::Rgba8Uint,
        F::Rgba8i => Format::Rgba8Sint,
        F::R16 => Format::R16Unorm,
        F::R16Snorm => Format::R16Snorm,
        F::R16ui => Format::R16Uint,
        F::R16i => Format::R16Sint,
        F::R16f => Format::R16Float,
        F::Rg16 => Format::Rg16Unorm,
        F::Rg16Snorm => Format::Rg16Snorm,
        F::Rg16ui => Format::Rg16Uint,
        F::Rg16i => Format::Rg16Sint,
        F::Rg16f => Format::Rg16Float,
        F::Rgba16 => Format::Rgba16Unorm,
        F::Rgba16Snorm => Format::Rgba16Snorm,
        F::Rgba16ui => Format::Rgba16Uint,
        F::Rgba16i => Format::Rgba16Sint,
        F::Rgba16f => Format::Rgba16Float,
        F::R32ui => Format::R32Uint,
        F::R32i => Format::R32Sint,
        F::R32f => Format::R32Float,
        F::Rg32ui => Format::Rg32Uint,
        F::Rg32i => Format::Rg32Sint,
        F::Rg32f => Format::Rg32Float,
        F::Rgba32ui => Format::Rgba32Uint,
        F::Rgba32i => Format::Rgba32Sint,
        F::Rgba32f => Format::Rgba32Float,
        F::Rgb10A2 => Format::Rgb10a2Unorm,
        F::Rgb10a2ui => Format::Rgb10a2Uint,
        F::R11fG11fB10f => Format::Rg11b10Ufloat,
        F::Unknown | F::R64ui | F::R64i => return None,
    })
}
