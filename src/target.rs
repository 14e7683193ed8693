//! Render targets of a pass: where they live, what they begin with, and what is kept of them.

use crate::{
    error::Result,
    format::{Format, Numeric},
    image::{self, Extent},
    pass::Pass,
    samples::Samples,
    state::ResolveMode,
    vk::{self, Aspect, Subresource},
};
use std::sync::Arc;

/// What a target holds when its pass begins.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LoadOp<T> {
    /// This value in every pixel.
    Clear(T),
    /// What its image holds, which lives on a device.
    Load,
    /// This picture of the host, which has the extent of the pass and the format of the target.
    Picture(Arc<image::Picture>),
}

impl LoadOp<ClearColor> {
    /// Clears to `color`: `[f32; 4]`, `[u32; 4]` or `[i32; 4]`, as the format asks for.
    pub fn clear(color: impl Into<ClearColor>) -> Self {
        Self::Clear(color.into())
    }
}

impl<T: Copy> LoadOp<T> {
    /// The value of all pixels, if there is one.
    pub fn clear_value(&self) -> Option<T> {
        match self {
            LoadOp::Clear(value) => Some(*value),
            LoadOp::Load | LoadOp::Picture(_) => None,
        }
    }
}

/// What is kept of a target when its pass ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum StoreOp {
    /// Everything.
    #[default]
    Store,
    /// Nothing: it was needed during the pass only. Its image, if it has one, may hold anything afterwards.
    Discard,
}

/// The colour that a target is cleared to, of the kind that its format holds. Values that the format does not hold become
/// the nearest one that it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClearColor {
    /// Linear RGBA.
    Float([f32; 4]),
    /// For formats of unsigned integers.
    Uint([u32; 4]),
    /// For formats of signed integers.
    Sint([i32; 4]),
}

impl From<[f32; 4]> for ClearColor {
    fn from(rgba: [f32; 4]) -> Self {
        Self::Float(rgba)
    }
}

impl From<[u32; 4]> for ClearColor {
    fn from(rgba: [u32; 4]) -> Self {
        Self::Uint(rgba)
    }
}

impl From<[i32; 4]> for ClearColor {
    fn from(rgba: [i32; 4]) -> Self {
        Self::Sint(rgba)
    }
}

impl ClearColor {
    /// The same values in the kind that `format` holds, as near as it comes.
    pub(crate) fn converted(self, format: Format) -> Self {
        let wide = match self {
            _ if self.fits(format) => return self,
            Self::Float(c) => c.map(f64::from),
            Self::Uint(c) => c.map(f64::from),
            Self::Sint(c) => c.map(f64::from),
        };
        match format.numeric() {
            Numeric::Uint | Numeric::Stencil => Self::Uint(wide.map(|c| c as u32)),
            Numeric::Sint => Self::Sint(wide.map(|c| c as i32)),
            _ => Self::Float(wide.map(|c| c as f32)),
        }
    }

    /// Whether targets of `format` are cleared to such a color.
    fn fits(self, format: Format) -> bool {
        match self {
            Self::Float(_) => !format.is_integer(),
            Self::Uint(_) => matches!(format.numeric(), Numeric::Uint | Numeric::Stencil),
            Self::Sint(_) => format.numeric() == Numeric::Sint,
        }
    }
}

/// A colour target.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ColorTarget {
    /// The image that is drawn to. `None`: each executor makes one, and [`super::pass::Frame::colors`] has its content.
    pub image: Option<vk::Image>,
    /// The mip level that is drawn to, which has the extent of the pass.
    pub level: u32,
    /// The layer that is drawn to: of a cube a face in the order of [`image::Shape::Cube`], of an image of three dimensions a
    /// slice.
    pub layer: u32,
    /// Any format of colours; that of the image, if there is one. It says what the shader writes: floats, or integers of its
    /// kind.
    pub format: Format,
    /// What it begins with.
    pub load: LoadOp<ClearColor>,
    /// What is kept.
    pub store: StoreOp,
}

impl ColorTarget {
    /// A target that each executor makes, cleared to `color`: linear RGBA (`[f32; 4]`), or `[u32; 4]` or `[i32; 4]` if the
    /// format holds such integers.
    pub fn cleared(format: Format, color: impl Into<ClearColor>) -> Self {
        let (load, store) = (LoadOp::clear(color), StoreOp::Store);
        Self { image: None, level: 0, layer: 0, format, load, store }
    }

    /// A target that is `image`, made for [`vk::ImageUse::Attachment`] or [`vk::ImageUse::Storage`]: level 0 of layer 0, unless set otherwise.
    pub fn on_device(image: &vk::Image, load: LoadOp<ClearColor>) -> Self {
        let (image, format) = (Some(image.clone()), image.format());
        Self { image, level: 0, layer: 0, format, load, store: StoreOp::Store }
    }

    setters! {
        level: u32,
        layer: u32,
        store: StoreOp,
    }

    /// The level and the layer that are drawn to.
    pub(crate) fn subresource(&self) -> Subresource {
        Subresource { aspect: Aspect::Main, level: self.level, layer: self.layer }
    }

    /// What is kept of several samples of a pixel: integers have no average.
    pub(crate) fn resolve(&self) -> ResolveMode {
        match self.format.is_integer() {
            true => ResolveMode::SampleZero,
            false => ResolveMode::Average,
        }
    }
}

/// A depth target.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DepthTarget {
    /// As [`ColorTarget::image`]; [`super::pass::Frame::depth`] has its content.
    pub image: Option<vk::Image>,
    /// As [`ColorTarget::level`].
    pub level: u32,
    /// As [`ColorTarget::layer`].
    pub layer: u32,
    /// [`Format::D32Float`], [`Format::D16Unorm`] or [`Format::X8D24Unorm`]; that of the depths in the image, if there is one,
    /// which may hold stencil values as well. Depths are tested as the target keeps them.
    pub format: Format,
    /// What it begins with: depths in 0..=1.
    pub load: LoadOp<f32>,
    /// What is kept.
    pub store: StoreOp,
    /// What is kept of several samples of a pixel ([`crate::Pass::samples`]): sample 0, unless set.
    pub resolve: ResolveMode,
}

impl DepthTarget {
    /// A target of [`Format::D32Float`] that each executor makes, cleared to `depth`.
    pub fn cleared(depth: f32) -> Self {
        let (load, store) = (LoadOp::Clear(depth), StoreOp::Store);
        let (format, resolve) = (Format::D32Float, ResolveMode::SampleZero);
        Self { image: None, level: 0, layer: 0, format, load, store, resolve }
    }

    /// As [`DepthTarget::cleared`], for depth that nobody needs after the pass.
    pub fn transient(depth: f32) -> Self {
        Self { store: StoreOp::Discard, ..Self::cleared(depth) }
    }

    /// As [`ColorTarget::on_device`].
    pub fn on_device(image: &vk::Image, load: LoadOp<f32>) -> Self {
        let (image, format) = (Some(image.clone()), image.format().without_stencil());
        let (store, resolve) = (StoreOp::Store, ResolveMode::SampleZero);
        Self { image, level: 0, layer: 0, format, load, store, resolve }
    }

    setters! {
        format: Format,
        level: u32,
        layer: u32,
        store: StoreOp,
        resolve: ResolveMode,
    }

    /// The level and the layer that are drawn to.
    pub(crate) fn subresource(&self) -> Subresource {
        Subresource { aspect: Aspect::Main, level: self.level, layer: self.layer }
    }
}

/// A stencil target: a number of eight bits for each pixel.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StencilTarget {
    /// As [`ColorTarget::image`]; [`super::pass::Frame::stencil`] has its content. An image of [`Format::S8Uint`], or one of depths
    /// and stencil values: that of the depth target, or another one, which `classic` refuses.
    pub image: Option<vk::Image>,
    /// As [`ColorTarget::level`].
    pub level: u32,
    /// As [`ColorTarget::layer`].
    pub layer: u32,
    /// What it begins with. A picture has [`Format::S8Uint`].
    pub load: LoadOp<u8>,
    /// What is kept.
    pub store: StoreOp,
    /// As [`DepthTarget::resolve`]. Stencil values have no average.
    pub resolve: ResolveMode,
}

impl StencilTarget {
    /// A target that each executor makes, cleared to `value`.
    pub fn cleared(value: u8) -> Self {
        let (load, store) = (LoadOp::Clear(value), StoreOp::Store);
        let resolve = ResolveMode::SampleZero;
        Self { image: None, level: 0, layer: 0, load, store, resolve }
    }

    /// As [`StencilTarget::cleared`], for values that nobody needs after the pass.
    pub fn transient(value: u8) -> Self {
        Self { store: StoreOp::Discard, ..Self::cleared(value) }
    }

    /// As [`ColorTarget::on_device`].
    pub fn on_device(image: &vk::Image, load: LoadOp<u8>) -> Self {
        Self { image: Some(image.clone()), load, ..Self::cleared(0) }
    }

    setters! {
        level: u32,
        layer: u32,
        store: StoreOp,
        resolve: ResolveMode,
    }

    /// The level and the layer that are drawn to.
    pub(crate) fn subresource(&self) -> Subresource {
        Subresource { aspect: Aspect::Stencil, level: self.level, layer: self.layer }
    }
}

/// What the kernels of a pipeline depend on in the targets of a pass.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct TargetFormats {
    /// The formats of the colour targets.
    pub colors: Vec<Format>,
    /// The format of the depth target, if there is one.
    pub depth: Option<Format>,
    /// Whether there is a stencil target.
    pub stencil: bool,
    /// Samples of a pixel.
    pub samples: Samples,
}

impl TargetFormats {
    /// Colour targets of these formats, no depth, one sample.
    pub fn new(colors: impl IntoIterator<Item = Format>) -> Self {
        Self { colors: colors.into_iter().collect(), ..Self::default() }
    }

    /// Those of `pass`.
    pub fn of(pass: &Pass) -> Self {
        Self {
            depth: pass.depth.as_ref().map(|depth| depth.format),
            stencil: pass.stencil.is_some(),
            samples: pass.samples,
            ..Self::new(pass.colors.iter().map(|color| color.format))
        }
    }

    setters! {
        stencil: bool,
        samples: Samples,
        ;
        into
        depth: Option<Format>,
    }
}

impl ColorTarget {
    /// The same target as each executor makes it. If it loads, it begins with what the image holds at this moment.
    ///
    /// # Errors
    /// As [`vk::Image::download`].
    pub(crate) fn snapshot(&self) -> Result<Self> {
        let load = self.load.snapshot(self.image.as_ref(), self.subresource())?;
        Ok(Self { image: None, level: 0, layer: 0, load, ..self.clone() })
    }
}

impl DepthTarget {
    /// As [`ColorTarget::snapshot`].
    ///
    /// # Errors
    /// As [`vk::Image::download`].
    pub(crate) fn snapshot(&self) -> Result<Self> {
        let load = self.load.snapshot(self.image.as_ref(), self.subresource())?;
        Ok(Self { image: None, level: 0, layer: 0, load, ..self.clone() })
    }
}

impl StencilTarget {
    /// As [`ColorTarget::snapshot`].
    ///
    /// # Errors
    /// As [`vk::Image::download`].
    pub(crate) fn snapshot(&self) -> Result<Self> {
        let load = self.load.snapshot(self.image.as_ref(), self.subresource())?;
        Ok(Self { image: None, level: 0, layer: 0, load, ..self.clone() })
    }
}

impl<T: Clone> LoadOp<T> {
    fn snapshot(&self, image: Option<&vk::Image>, at: Subresource) -> Result<Self> {
        match (self, image) {
            (LoadOp::Load, Some(image)) => {
                let picture = image.download_subresource(at)?;
                Ok(LoadOp::Picture(Arc::new(picture)))
            }
            (load, _) => Ok(load.clone()),
        }
    }
}

/// Whether `format` holds colours.
pub(crate) fn check_color_format(format: Format) -> Fault {
    match format.is_color() {
        true => Ok(()),
        false => Err(format!("{format:?} is no format of a colour target")),
    }
}

/// A fault of a target, without saying where.
type Fault = std::result::Result<(), String>;

impl ColorTarget {
    /// Whether a pass of `extent` can draw to it.
    pub(crate) fn check(&self, extent: Extent) -> Fault {
        let format = self.format;
        check_color_format(format)?;
        if let Some(color) = self.load.clear_value().filter(|color| !color.fits(format)) {
            return Err(format!("a target of {format:?} cannot be cleared to {color:?}"));
        }
        check((self.image.as_ref(), self.subresource()), &self.load, format, extent)
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
            LoadOp::Clear(_) | LoadOp::Load | LoadOp::Picture(_) => {}
        }
        let place = (self.image.as_ref(), self.subresource());
        if !self.format.is_depth() || self.format.is_stencil() {
            let of = |image: &vk::Image| format!("image `{}` is ", image.name());
            let of = self.image.as_ref().map(of).unwrap_or_default();
            return Err(format!("{of}{:?}, which is no format of a depth target", self.format));
        }
        check(place, &self.load, self.format, extent)?;
        if let LoadOp::Picture(picture) = &self.load
            && let Some(depth) = picture.depths().iter().find(|depth| !inside(depth))
        {
            return Err(format!("a depth of {depth} is uploaded, outside 0..=1"));
        }
        Ok(())
    }
}

impl StencilTarget {
    /// Whether a pass of `extent` can draw to it.
    pub(crate) fn check(&self, extent: Extent) -> Fault {
        if let Some(image) = self.image.as_ref().filter(|image| !image.format().is_stencil()) {
            let (name, format) = (image.name(), image.format());
            return Err(format!("image `{name}` is {format:?}, which holds no stencil values"));
        }
        if self.resolve == ResolveMode::Average {
            return Err("stencil values have no average: resolve them in another way".into());
        }
        check((self.image.as_ref(), self.subresource()), &self.load, Format::S8Uint, extent)
    }
}

fn check<T>(
    (image, subresource): (Option<&vk::Image>, Subresource),
    load: &LoadOp<T>,
    format: Format,
    extent: Extent,
) -> Fault {
    let Subresource { level, layer, .. } = subresource;
    if image.is_none() && (level, layer) != (0, 0) {
        return Err(format!("a target without an image has no level {level} or layer {layer}"));
    }
    if let Some(image) = image {
        let name = image.name();
        if image.usage() == vk::ImageUse::Sampled {
            return Err(format!(
                "image `{name}` is no target: those are made with `ImageUse::Attachment` or `ImageUse::Storage`"
            ));
        }
        image.0.check_subresource(subresource).map_err(|fault| fault.to_string())?;
        let (has, of, level) = (image.extent().level(level), image.format(), level);
        if (has, subresource.format(of)) != (extent, format) {
            let of_level = if level == 0 { String::new() } else { format!(" in level {level}") };
            return Err(format!(
                "image `{name}` is {has} {of:?}{of_level}; the pass draws to {extent} {format:?}"
            ));
        }
    }
    match load {
        LoadOp::Load if image.is_none() => {
            Err("a target without an image has nothing to load: clear it, or upload a picture"
                .into())
        }
        LoadOp::Picture(picture) => {
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
