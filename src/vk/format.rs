//! Formats as Vulkan names them, and what a device does with images of them.

use super::{gpu::Shared, image::Aspect};
use crate::{
    format::{Format, Numeric, Packing, VertexFormat},
    target::ClearColor,
};
use ash::vk::{self, FormatFeatureFlags};

pub(crate) fn vk_format(format: Format) -> vk::Format {
    type F = vk::Format;
    match format {
        Format::R8Unorm => F::R8_UNORM,
        Format::R8Snorm => F::R8_SNORM,
        Format::R8Uint => F::R8_UINT,
        Format::R8Sint => F::R8_SINT,
        Format::Rg8Unorm => F::R8G8_UNORM,
        Format::Rg8Snorm => F::R8G8_SNORM,
        Format::Rg8Uint => F::R8G8_UINT,
        Format::Rg8Sint => F::R8G8_SINT,
        Format::Rgba8Unorm => F::R8G8B8A8_UNORM,
        Format::Rgba8Srgb => F::R8G8B8A8_SRGB,
        Format::Rgba8Snorm => F::R8G8B8A8_SNORM,
        Format::Rgba8Uint => F::R8G8B8A8_UINT,
        Format::Rgba8Sint => F::R8G8B8A8_SINT,
        Format::R16Unorm => F::R16_UNORM,
        Format::R16Snorm => F::R16_SNORM,
        Format::R16Uint => F::R16_UINT,
        Format::R16Sint => F::R16_SINT,
        Format::R16Float => F::R16_SFLOAT,
        Format::Rg16Unorm => F::R16G16_UNORM,
        Format::Rg16Snorm => F::R16G16_SNORM,
        Format::Rg16Uint => F::R16G16_UINT,
        Format::Rg16Sint => F::R16G16_SINT,
        Format::Rg16Float => F::R16G16_SFLOAT,
        Format::Rgba16Unorm => F::R16G16B16A16_UNORM,
        Format::Rgba16Snorm => F::R16G16B16A16_SNORM,
        Format::Rgba16Uint => F::R16G16B16A16_UINT,
        Format::Rgba16Sint => F::R16G16B16A16_SINT,
        Format::Rgba16Float => F::R16G16B16A16_SFLOAT,
        Format::R32Uint => F::R32_UINT,
        Format::R32Sint => F::R32_SINT,
        Format::R32Float => F::R32_SFLOAT,
        Format::Rg32Uint => F::R32G32_UINT,
        Format::Rg32Sint => F::R32G32_SINT,
        Format::Rg32Float => F::R32G32_SFLOAT,
        Format::Rgba32Uint => F::R32G32B32A32_UINT,
        Format::Rgba32Sint => F::R32G32B32A32_SINT,
        Format::Rgba32Float => F::R32G32B32A32_SFLOAT,
        Format::Bgra8Unorm => F::B8G8R8A8_UNORM,
        Format::Bgra8Srgb => F::B8G8R8A8_SRGB,
        Format::Rgb10a2Unorm => F::A2B10G10R10_UNORM_PACK32,
        Format::Rgb10a2Uint => F::A2B10G10R10_UINT_PACK32,
        Format::Rg11b10Ufloat => F::B10G11R11_UFLOAT_PACK32,
        Format::R5g6b5Unorm => F::R5G6B5_UNORM_PACK16,
        Format::A1r5g5b5Unorm => F::A1R5G5B5_UNORM_PACK16,
        Format::D32Float => F::D32_SFLOAT,
        Format::D16Unorm => F::D16_UNORM,
        Format::X8D24Unorm => F::X8_D24_UNORM_PACK32,
        Format::S8Uint => F::S8_UINT,
        Format::D24UnormS8Uint => F::D24_UNORM_S8_UINT,
        Format::D32FloatS8Uint => F::D32_SFLOAT_S8_UINT,
    }
}

/// Vulkan's name of the format; `None` if it has none.
pub(crate) fn vertex_format(format: VertexFormat) -> Option<vk::Format> {
    type F = vk::Format;
    use Numeric::*;
    let by_count = match (format.packing, format.numeric) {
        (Packing::Bits8, Unorm) => [F::R8_UNORM, F::R8G8_UNORM, F::R8G8B8_UNORM, F::R8G8B8A8_UNORM],
        (Packing::Bits8, Snorm) => [F::R8_SNORM, F::R8G8_SNORM, F::R8G8B8_SNORM, F::R8G8B8A8_SNORM],
        (Packing::Bits8, Uscaled) => {
            [F::R8_USCALED, F::R8G8_USCALED, F::R8G8B8_USCALED, F::R8G8B8A8_USCALED]
        }
        (Packing::Bits8, Sscaled) => {
            [F::R8_SSCALED, F::R8G8_SSCALED, F::R8G8B8_SSCALED, F::R8G8B8A8_SSCALED]
        }
        (Packing::Bits8, Uint) => [F::R8_UINT, F::R8G8_UINT, F::R8G8B8_UINT, F::R8G8B8A8_UINT],
        (Packing::Bits8, Sint) => [F::R8_SINT, F::R8G8_SINT, F::R8G8B8_SINT, F::R8G8B8A8_SINT],
        (Packing::Bits16, Unorm) => {
            [F::R16_UNORM, F::R16G16_UNORM, F::R16G16B16_UNORM, F::R16G16B16A16_UNORM]
        }
        (Packing::Bits16, Snorm) => {
            [F::R16_SNORM, F::R16G16_SNORM, F::R16G16B16_SNORM, F::R16G16B16A16_SNORM]
        }
        (Packing::Bits16, Uscaled) => {
            [F::R16_USCALED, F::R16G16_USCALED, F::R16G16B16_USCALED, F::R16G16B16A16_USCALED]
        }
        (Packing::Bits16, Sscaled) => {
            [F::R16_SSCALED, F::R16G16_SSCALED, F::R16G16B16_SSCALED, F::R16G16B16A16_SSCALED]
        }
        (Packing::Bits16, Uint) => {
            [F::R16_UINT, F::R16G16_UINT, F::R16G16B16_UINT, F::R16G16B16A16_UINT]
        }
        (Packing::Bits16, Sint) => {
            [F::R16_SINT, F::R16G16_SINT, F::R16G16B16_SINT, F::R16G16B16A16_SINT]
        }
        (Packing::Bits16, Float) => {
            [F::R16_SFLOAT, F::R16G16_SFLOAT, F::R16G16B16_SFLOAT, F::R16G16B16A16_SFLOAT]
        }
        (Packing::Bits32, Uint) => {
            [F::R32_UINT, F::R32G32_UINT, F::R32G32B32_UINT, F::R32G32B32A32_UINT]
        }
        (Packing::Bits32, Sint) => {
            [F::R32_SINT, F::R32G32_SINT, F::R32G32B32_SINT, F::R32G32B32A32_SINT]
        }
        (Packing::Bits32, Float) => {
            [F::R32_SFLOAT, F::R32G32_SFLOAT, F::R32G32B32_SFLOAT, F::R32G32B32A32_SFLOAT]
        }
        (packing, numeric) => {
            return Some(match (packing, numeric) {
                (Packing::Bgra8, Unorm) => F::B8G8R8A8_UNORM,
                (Packing::Bgra8, Snorm) => F::B8G8R8A8_SNORM,
                (Packing::Bgra8, Uscaled) => F::B8G8R8A8_USCALED,
                (Packing::Bgra8, Sscaled) => F::B8G8R8A8_SSCALED,
                (Packing::Bgra8, Uint) => F::B8G8R8A8_UINT,
                (Packing::Bgra8, Sint) => F::B8G8R8A8_SINT,
                (Packing::Rgb10a2, Unorm) => F::A2B10G10R10_UNORM_PACK32,
                (Packing::Rgb10a2, Snorm) => F::A2B10G10R10_SNORM_PACK32,
                (Packing::Rgb10a2, Uscaled) => F::A2B10G10R10_USCALED_PACK32,
                (Packing::Rgb10a2, Sscaled) => F::A2B10G10R10_SSCALED_PACK32,
                (Packing::Rgb10a2, Uint) => F::A2B10G10R10_UINT_PACK32,
                (Packing::Rgb10a2, Sint) => F::A2B10G10R10_SINT_PACK32,
                (Packing::Bgr10a2, Unorm) => F::A2R10G10B10_UNORM_PACK32,
                (Packing::Bgr10a2, Snorm) => F::A2R10G10B10_SNORM_PACK32,
                (Packing::Bgr10a2, Uscaled) => F::A2R10G10B10_USCALED_PACK32,
                (Packing::Bgr10a2, Sscaled) => F::A2R10G10B10_SSCALED_PACK32,
                (Packing::Bgr10a2, Uint) => F::A2R10G10B10_UINT_PACK32,
                (Packing::Bgr10a2, Sint) => F::A2R10G10B10_SINT_PACK32,
                (Packing::Rg11b10, Float) => F::B10G11R11_UFLOAT_PACK32,
                (Packing::R5g6b5, Unorm) => F::R5G6B5_UNORM_PACK16,
                (Packing::A1r5g5b5, Unorm) => F::A1R5G5B5_UNORM_PACK16,
                _ => return None,
            });
        }
    };
    by_count.get(usize::from(format.count).wrapping_sub(1)).copied()
}

/// What the texels of an image of `format` are to commands.
pub(super) fn aspects(format: Format) -> vk::ImageAspectFlags {
    let flag = |is, flag| if is { flag } else { vk::ImageAspectFlags::empty() };
    flag(format.is_color(), vk::ImageAspectFlags::COLOR)
        | flag(format.is_depth(), vk::ImageAspectFlags::DEPTH)
        | flag(format.is_stencil(), vk::ImageAspectFlags::STENCIL)
}

/// That of them which one command copies, and which shaders see.
pub(super) fn aspect(format: Format, aspect: Aspect) -> vk::ImageAspectFlags {
    match aspect {
        Aspect::Main if format.is_depth() => vk::ImageAspectFlags::DEPTH,
        Aspect::Main => aspects(format),
        Aspect::Stencil => vk::ImageAspectFlags::STENCIL,
    }
}

/// The usage of an image that the device draws to itself.
pub(super) fn attachment_flag(format: Format) -> vk::ImageUsageFlags {
    match format.is_color() {
        true => vk::ImageUsageFlags::COLOR_ATTACHMENT,
        false => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
    }
}

/// The value of Vulkan that clears a target of `format`. Vulkan does not say what becomes of integers that are too large.
pub(crate) fn clear_color(format: Format, color: ClearColor) -> vk::ClearColorValue {
    match crate::image::texel::limited_integers(format, color) {
        ClearColor::Float(float32) => vk::ClearColorValue { float32 },
        ClearColor::Uint(uint32) => vk::ClearColorValue { uint32 },
        ClearColor::Sint(int32) => vk::ClearColorValue { int32 },
    }
}

impl Shared {
    /// Whether graphics pipelines read vertex attributes of this format.
    pub fn reads_vertices_as(&self, format: vk::Format) -> bool {
        self.properties(format).buffer_features.contains(FormatFeatureFlags::VERTEX_BUFFER)
    }

    /// Whether samplers may filter images of this format linearly.
    pub fn filters(&self, format: Format) -> bool {
        self.offers(format, FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
    }

    /// Whether graphics pipelines draw to images of this format.
    pub fn draws_to(&self, format: Format) -> bool {
        self.offers(
            format,
            match format.numeric() {
                Numeric::Depth | Numeric::Stencil => FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT,
                _ => FormatFeatureFlags::COLOR_ATTACHMENT,
            },
        )
    }

    /// Whether graphics pipelines blend in images of this format.
    pub fn blends_in(&self, format: Format) -> bool {
        self.offers(format, FormatFeatureFlags::COLOR_ATTACHMENT_BLEND)
    }

    /// Whether mip levels of this format are made by linear filtering.
    pub(super) fn makes_levels_of(&self, format: Format) -> bool {
        let blit = FormatFeatureFlags::BLIT_SRC | FormatFeatureFlags::BLIT_DST;
        self.offers(format, blit) && self.filters(format)
    }

    fn offers(&self, format: Format, features: FormatFeatureFlags) -> bool {
        self.properties(vk_format(format)).optimal_tiling_features.contains(features)
    }

    fn properties(&self, format: vk::Format) -> vk::FormatProperties {
        // SAFETY: the physical device belongs to the instance.
        unsafe { self.instance.raw.get_physical_device_format_properties(self.physical, format) }
    }
}
