//! Textures and samplers.

mod sampler;

pub use sampler::{Border, Filter, Sampler, Wrap};

use crate::{
    format::Format,
    image::{Extent, Shape},
    vk,
};

/// A texture with its mip levels.
///
/// A texture of the host ([`Texture::new`]) never changes, and an executor uploads it once. A texture of a device
/// ([`Texture::on_device`]) is an image that lives there: what passes and uploads write to it, later passes sample.
#[derive(Clone, Debug)]
pub struct Texture {
    label: String,
    extent: Extent,
    shape: Shape,
    format: Format,
    texels: Texels,
}

#[derive(Clone, Debug)]
enum Texels {
    Host(Vec<Vec<u8>>),
    Device(vk::Image),
}

impl Texture {
    /// A two-dimensional texture of the host. `label` names it in messages and captures; `extent` is the size of level 0;
    /// `format` is that of colours. The `levels` go from the largest down: level `n` is `max(1, extent >> n)` texels, rows
    /// without padding.
    pub fn new(
        label: impl Into<String>,
        extent: Extent,
        format: Format,
        levels: Vec<Vec<u8>>,
    ) -> Self {
        Self::of_shape(label, Shape::D2, extent, format, levels)
    }

    /// As [`Texture::new`], with other dimensions. Each of the `levels` has all its layers or slices, one after the other.
    pub fn of_shape(
        label: impl Into<String>,
        shape: Shape,
        extent: Extent,
        format: Format,
        levels: Vec<Vec<u8>>,
    ) -> Self {
        Self { label: label.into(), extent, shape, format, texels: Texels::Host(levels) }
    }

    /// The texture that is `image`, made for [`vk::ImageUse::Attachment`] or [`vk::ImageUse::Storage`]. Only executors of its device take it. A pass
    /// cannot sample an image that it draws to. From an image of depths, shaders read the depth as red.
    pub fn on_device(image: &vk::Image) -> Self {
        Self {
            label: image.name().into(),
            extent: image.extent(),
            shape: image.shape(),
            format: image.format(),
            texels: Texels::Device(image.clone()),
        }
    }

    /// Its name in messages and captures.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Size of level 0.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Dimensions and layers.
    pub fn shape(&self) -> Shape {
        self.shape
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
