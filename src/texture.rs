//! Textures and samplers.

use crate::{format::Format, image::Extent, vk};

/// A two-dimensional texture with its mip levels.
///
/// A texture of the host ([`Texture::new`]) never changes, and an executor uploads it once. A texture of a device
/// ([`Texture::on_device`]) is an image that lives there: what passes and uploads write to it, later passes sample.
#[derive(Clone, Debug)]
pub struct Texture {
    label: String,
    extent: Extent,
    format: Format,
    texels: Texels,
}

#[derive(Clone, Debug)]
enum Texels {
    Host(Vec<Vec<u8>>),
    Device(vk::Image),
}

impl Texture {
    /// A texture of the host. `label` names it in messages and captures; `extent` is the size of level 0; `format` is
    /// that of colours. The `levels` go from the largest down: level `n` is `max(1, extent >> n)` texels, rows without
    /// padding.
    pub fn new(
        label: impl Into<String>,
        extent: Extent,
        format: Format,
        levels: Vec<Vec<u8>>,
    ) -> Self {
        Self { label: label.into(), extent, format, texels: Texels::Host(levels) }
    }

    /// The texture that is `image`, made for [`vk::ImageUse::Attachment`]. Only executors of its device take it. A pass
    /// cannot sample an image that it draws to. From an image of depths, shaders read the depth as red.
    pub fn on_device(image: &vk::Image) -> Self {
        let (label, extent, format) = (image.name().into(), image.extent(), image.format());
        Self { label, extent, format, texels: Texels::Device(image.clone()) }
    }

    /// Its name in messages and captures.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Size of level 0.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Layout of the texels.
    pub fn format(&self) -> Format {
        self.format
    }

    /// The levels of a texture of the host.
    pub fn levels(&self) -> Option<&[Vec<u8>]> {
        match &self.texels {
            Texels::Host(levels) => Some(levels),
            Texels::Device(_) => None,
        }
    }

    /// The image of a texture of a device.
    pub fn image(&self) -> Option<&vk::Image> {
        match &self.texels {
            Texels::Host(_) => None,
            Texels::Device(image) => Some(image),
        }
    }
}

/// How a sampler treats coordinates outside 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Repeat, every other copy mirrored.
    MirroredRepeat,
    /// The edge texel.
    ClampToEdge,
}

/// Nearest or linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The nearest texel or level.
    Nearest,
    /// A weighted mean of the neighbours.
    #[default]
    Linear,
}

/// A sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampler {
    /// Wrapping along u.
    pub wrap_u: Wrap,
    /// Wrapping along v.
    pub wrap_v: Wrap,
    /// Magnification.
    pub mag: Filter,
    /// Minification.
    pub min: Filter,
    /// Between mip levels; `None` samples level 0 only.
    pub mip: Option<Filter>,
}

impl Default for Sampler {
    fn default() -> Self {
        Self {
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            mag: Filter::Linear,
            min: Filter::Linear,
            mip: Some(Filter::Linear),
        }
    }
}
