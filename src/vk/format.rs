//! Formats as Vulkan names them, and what a device does with images of them.

use super::gpu::Shared;
use crate::{
    format::{Format, Numeric},
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
    }
}

/// What the texels of an image of `format` are to commands.
pub(super) fn aspect(format: Format) -> vk::ImageAspectFlags {
    match format.is_depth() {
        true => vk::ImageAspectFlags::DEPTH,
        false => vk::ImageAspectFlags::COLOR,
    }
}

/// The usage of an image that the device draws to itself.
pub(super) fn attachment_flag(format: Format) -> vk::ImageUsageFlags {
    match format.is_depth() {
        true => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
        false => vk::ImageUsageFlags::COLOR_ATTACHMENT,
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
                Numeric::Depth => FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT,
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
