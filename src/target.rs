//! Render targets of a pass: where they live, what they begin with, and what is kept of them.

use crate::{
    error::Result,
    format::Format,
    image::{self, Extent},
    vk,
};
use std::sync::Arc;

/// What a target holds when its pass begins.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadOp<T> {
    /// This value in every pixel.
    Clear(T),
    /// What its image holds, which lives on a device.
    Load,
    /// This picture of the host, which has the extent of the pass and the format of the target.
    Upload(Arc<image::Image>),
}

impl<T: Copy> LoadOp<T> {
    /// The value of all pixels, if there is one.
    pub fn clear_value(&self) -> Option<T> {
        match self {
            LoadOp::Clear(value) => Some(*value),
            LoadOp::Load | LoadOp::Upload(_) => None,
        }
    }
}

/// What is kept of a target when its pass ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum StoreOp {
    /// Everything.
    #[default]
    Store,
    /// Nothing: it was needed during the pass only. Its image, if it has one, may hold anything afterwards.
    Discard,
}

/// A colour target.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ColorTarget {
    /// The image that is drawn to, with the extent of the pass. `None`: each executor makes one, and
    /// [`super::pass::Frame::colors`] has its content.
    pub image: Option<vk::Image>,
    /// [`Format::Rgba8Unorm`], [`Format::Rgba8Srgb`] or [`Format::Rgba16Float`]; that of the image, if there is one.
    pub format: Format,
    /// What it begins with. A clear colour is linear RGBA.
    pub load: LoadOp<[f32; 4]>,
    /// What is kept.
    pub store: StoreOp,
}

impl ColorTarget {
    /// A target that each executor makes, cleared to `color` (linear RGBA).
    pub fn cleared(format: Format, color: [f32; 4]) -> Self {
        Self { image: None, format, load: LoadOp::Clear(color), store: StoreOp::Store }
    }

    /// A target that is `image`, made for [`vk::ImageUse::Attachment`].
    pub fn on_device(image: &vk::Image, load: LoadOp<[f32; 4]>) -> Self {
        let (image, format) = (Some(image.clone()), image.format());
        Self { image, format, load, store: StoreOp::Store }
    }
}

/// A depth target ([`Format::D32Float`]).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DepthTarget {
    /// As [`ColorTarget::image`]; [`super::pass::Frame::depth`] has its content.
    pub image: Option<vk::Image>,
    /// What it begins with: depths in 0..=1.
    pub load: LoadOp<f32>,
    /// What is kept.
    pub store: StoreOp,
}

impl DepthTarget {
    /// A target that each executor makes, cleared to `depth`.
    pub fn cleared(depth: f32) -> Self {
        Self { image: None, load: LoadOp::Clear(depth), store: StoreOp::Store }
    }

    /// As [`DepthTarget::cleared`], for depth that nobody needs after the pass.
    pub fn transient(depth: f32) -> Self {
        Self { store: StoreOp::Discard, ..Self::cleared(depth) }
    }

    /// A target that is `image`, made for [`vk::ImageUse::Attachment`].
    pub fn on_device(image: &vk::Image, load: LoadOp<f32>) -> Self {
        Self { image: Some(image.clone()), load, store: StoreOp::Store }
    }
}

impl ColorTarget {
    /// The same target as each executor makes it. If it loads, it begins with what the image holds at this moment.
    ///
    /// # Errors
    /// As [`vk::Image::download`].
    pub(crate) fn snapshot(&self) -> Result<Self> {
        let load = self.load.snapshot(self.image.as_ref())?;
        Ok(Self { image: None, load, ..self.clone() })
    }
}

impl DepthTarget {
    /// As [`ColorTarget::snapshot`].
    ///
    /// # Errors
    /// As [`vk::Image::download`].
    pub(crate) fn snapshot(&self) -> Result<Self> {
        let load = self.load.snapshot(self.image.as_ref())?;
        Ok(Self { image: None, load, ..self.clone() })
    }
}

impl<T: Clone> LoadOp<T> {
    fn snapshot(&self, image: Option<&vk::Image>) -> Result<Self> {
        match (self, image) {
            (LoadOp::Load, Some(image)) => Ok(LoadOp::Upload(Arc::new(image.download(0)?))),
            (load, _) => Ok(load.clone()),
        }
    }
}

/// A fault of a target, without saying where.
type Fault = std::result::Result<(), String>;

impl ColorTarget {
    /// Whether a pass of `extent` can draw to it.
    pub(crate) fn check(&self, extent: Extent) -> Fault {
        let format = self.format;
        if !matches!(format, Format::Rgba8Unorm | Format::Rgba8Srgb | Format::Rgba16Float) {
            return Err(format!("{format:?} is no format of a colour target"));
        }
        check(self.image.as_ref(), &self.load, format, extent)
    }
}

impl DepthTarget {
    /// Whether a pass of `extent` can draw to it.
    pub(crate) fn check(&self, extent: Extent) -> Fault {
        let inside = |depth: &f32| (0.0..=1.0).contains(depth);
        match &self.load {
            LoadOp::Clear(depth) if !inside(depth) => {
                return Err(format!("depth is cleared to {depth}, outside 0..=1"));
            }
            LoadOp::Clear(_) | LoadOp::Load | LoadOp::Upload(_) => {}
        }
        check(self.image.as_ref(), &self.load, Format::D32Float, extent)?;
        if let LoadOp::Upload(picture) = &self.load
            && let Some(depth) = picture.depths().iter().find(|depth| !inside(depth))
        {
            return Err(format!("a depth of {depth} is uploaded, outside 0..=1"));
        }
        Ok(())
    }
}

fn check<T>(image: Option<&vk::Image>, load: &LoadOp<T>, format: Format, extent: Extent) -> Fault {
    if let Some(image) = image {
        let name = image.name();
        if image.usage() != vk::ImageUse::Attachment {
            return Err(format!(
                "image `{name}` is no target: those are made with `ImageUse::Attachment`"
            ));
        }
        if (image.extent(), image.format()) != (extent, format) {
            let (has, of) = (image.extent(), image.format());
            return Err(format!(
                "image `{name}` is {has} {of:?}; the pass draws to {extent} {format:?}"
            ));
        }
    }
    match load {
        LoadOp::Load if image.is_none() => {
            Err("a target without an image has nothing to load: clear it, or upload a picture"
                .into())
        }
        LoadOp::Upload(picture) => {
            let (has, of, bytes) = (picture.extent, picture.format, picture.bytes.len());
            if (has, of) != (extent, format) {
                return Err(format!(
                    "the picture to begin with is {has} {of:?}; the target is {extent} {format:?}"
                ));
            }
            let wanted = extent.pixels() * format.texel_bytes();
            if bytes != wanted {
                return Err(format!("the picture to begin with has {bytes} bytes, not {wanted}"));
            }
            Ok(())
        }
        LoadOp::Load | LoadOp::Clear(_) => Ok(()),
    }
}
