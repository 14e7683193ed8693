//! Images: sampled textures, storage images and attachments.

use super::{
    buffer::{Buffer, Memory},
    gpu::Gpu,
    owner::same_device,
    raw_image::RawImage,
    recorder::Recorder,
};
use crate::{
    error::{Error, Result},
    format::Format,
    image::{self, Extent, Shape, texel::without_rest},
    samples::Samples,
};
use std::sync::Arc;

/// What an image is for; it decides usage and resting layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ImageUse {
    /// Uploaded once, then sampled by kernels of yours alone, through a [`super::ResourceTable`]. What passes sample is a
    /// texture of the host ([`crate::texture::Texture::new`]) or an image for [`ImageUse::Attachment`].
    Sampled,
    /// Read and written as a storage image by shaders of passes ([`crate::pass::Binding::StorageImage`]) and by kernels of
    /// yours (a [`super::ResourceTable`]), and everything that [`ImageUse::Attachment`] is for. Devices draw to such images
    /// and sample them more slowly. Devices write few formats so: none that is sRGB-encoded and no depths, and packed ones seldom.
    Storage,
    /// Drawn to by passes and sampled by their shaders, as often as wanted; also a texture that the host uploads. It can be uploaded and read back at any time, and
    /// holds zeros until something else is written.
    Attachment,
}

/// How to make an [`Image`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ImageInfo<'a> {
    /// For messages and captures.
    pub name: &'a str,
    /// Size of level 0 of one layer or slice.
    pub extent: Extent,
    /// Layout of a texel.
    pub format: Format,
    /// Its purpose.
    pub usage: ImageUse,
    /// Dimensions and layers.
    pub shape: Shape,
    /// Mip levels.
    pub levels: u32,
    /// Samples of a texel. Images with several of them are drawn to by the device's own pipeline, and nothing else.
    pub(crate) samples: Samples,
}

impl<'a> ImageInfo<'a> {
    /// A picture of one mip level.
    pub fn new(name: &'a str, extent: Extent, format: Format, usage: ImageUse) -> Self {
        let (shape, levels, samples) = (Shape::D2, 1, Samples::One);
        Self { name, extent, format, usage, shape, levels, samples }
    }

    setters! {
        shape: Shape,
        levels: u32,
    }

    /// The same with all mip levels down to one texel. [`crate::Encoder::make_levels`] makes those below level 0.
    #[must_use]
    pub const fn all_levels(self) -> Self {
        self.levels(self.shape.most_levels(self.extent))
    }
}

/// One layer or slice of one mip level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Subresource {
    pub aspect: Aspect,
    pub level: u32,
    pub layer: u32,
}

/// A part of texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) enum Aspect {
    /// Colours or depths; of a format that holds nothing else, stencil values.
    #[default]
    Main,
    /// Stencil values.
    Stencil,
}

impl Subresource {
    /// The format of its texels in an image of `format`.
    pub fn format(&self, format: Format) -> Format {
        match self.aspect {
            Aspect::Main => format.without_stencil(),
            Aspect::Stencil => Format::S8Uint,
        }
    }
}

/// An image with its views. A clone is the same image.
#[derive(Clone)]
pub struct Image(pub(crate) Arc<RawImage>);

impl Image {
    /// An image. It holds zeros, unless it is for [`ImageUse::Sampled`]: that has no content yet.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if a side has no pixels, if extent and shape do not fit each other, if there are no levels, or if
    /// there are more levels than it takes to halve the longest side to one pixel. [`crate::Error::Full`] if it has more
    /// pixels a side or more layers than the device allows, [`crate::Error::Capacity`] if there is no memory for it.
    /// [`crate::Error::Device`] if the device has no such images: depth needs a device that draws, since Vulkan lets no other
    /// one copy it.
    pub fn new(gpu: &Gpu, info: &ImageInfo<'_>) -> Result<Self> {
        let image = Self(Arc::new(RawImage::new(gpu, info)?));
        if info.usage != ImageUse::Sampled {
            let mut recorder = Recorder::new(gpu, "clear of a new image")?;
            recorder.clear_image(&image);
            recorder.submit()?;
        }
        Ok(image)
    }

    /// An image that only the device's own pipeline draws to, without content: it may have several samples.
    ///
    /// # Errors
    /// As [`Image::new`].
    pub(crate) fn drawn(gpu: &Gpu, info: &ImageInfo<'_>) -> Result<Self> {
        RawImage::new(gpu, info).map(|raw| Self(Arc::new(raw)))
    }

    /// The present content of mip level `level`: copied by the device, and waited for. If there are several layers or
    /// slices, they come one below the other.
    ///
    /// # Errors
    /// As [`Recorder::download_image`] and [`super::Recording::run`].
    pub fn download(&self, level: u32) -> Result<image::Picture> {
        let mut recorder = Recorder::new(&Gpu(self.0.gpu.clone()), "download")?;
        let copy = recorder.download_image(self, level)?;
        recorder.submit()?;
        let Extent { width, height } = self.extent().level(level);
        let extent = Extent::new(width, height * self.shape().pictures(level));
        let format = self.format().without_stencil();
        Ok(image::Picture { extent, format, bytes: without_rest(format, copy.read()?) })
    }

    /// The present content of one layer or slice of mip level `level`.
    ///
    /// # Errors
    /// As [`Image::download`], and [`crate::Error::Usage`] if there is no such layer or slice.
    pub fn download_layer(&self, level: u32, layer: u32) -> Result<image::Picture> {
        self.download_subresource(Subresource { aspect: Aspect::Main, level, layer })
    }

    /// The present stencil values of one layer of mip level `level`: a picture of [`Format::S8Uint`].
    ///
    /// # Errors
    /// As [`Image::download_layer`], and [`crate::Error::Usage`] if the image has none.
    pub fn download_stencil(&self, level: u32, layer: u32) -> Result<image::Picture> {
        if !self.format().is_stencil() {
            return Err(Error::Usage(format!(
                "image `{}` ({:?}) holds no stencil values",
                self.name(),
                self.format()
            )));
        }
        self.download_subresource(Subresource { aspect: Aspect::Stencil, level, layer })
    }

    /// The present content of a subresource.
    pub(crate) fn download_subresource(&self, subresource: Subresource) -> Result<image::Picture> {
        let gpu = Gpu(self.0.gpu.clone());
        let extent = self.extent().level(subresource.level);
        let format = subresource.format(self.format());
        let bytes = extent.pixels() * format.texel_bytes();
        let copy = Buffer::new(&gpu, "download of a layer", bytes, Memory::Readback)?;
        let mut recorder = Recorder::new(&gpu, "download")?;
        recorder.copy_from_image(self, subresource, 0..extent.height, &copy)?;
        recorder.submit()?;
        Ok(image::Picture { extent, format, bytes: without_rest(format, copy.read()?) })
    }

    /// Replaces the content of levels, from the largest down, and waits. [`Recorder::upload_image`] does not wait, and says
    /// what becomes of further levels.
    ///
    /// # Errors
    /// As [`Recorder::upload_image`] and [`super::Recording::run`].
    pub fn upload<L: AsRef<[u8]>>(&self, levels: &[L]) -> Result<()> {
        let mut recorder = Recorder::new(&Gpu(self.0.gpu.clone()), "upload")?;
        recorder.upload_image(self, levels)?;
        recorder.submit()?;
        Ok(())
    }

    /// Size of level 0.
    pub fn extent(&self) -> Extent {
        self.0.extent
    }

    /// Dimensions and layers.
    pub fn shape(&self) -> Shape {
        self.0.shape
    }

    /// Layout of a texel.
    pub fn format(&self) -> Format {
        self.0.format
    }

    /// Whether `other` is the same image.
    pub fn is(&self, other: &Image) -> bool {
        // The caller may have had one image adopted twice.
        Arc::ptr_eq(&self.0.gpu, &other.0.gpu) && self.0.handle == other.0.handle
    }

    /// Mip levels.
    pub fn levels(&self) -> u32 {
        self.0.levels
    }

    /// What it was made for.
    pub fn usage(&self) -> ImageUse {
        self.0.usage
    }

    /// The name it was made with.
    pub fn name(&self) -> &str {
        &self.0.name
    }
}

impl Image {
    /// Refuses an image of another device.
    pub(crate) fn check_device(&self, gpu: &Gpu) -> Result<()> {
        same_device(self, gpu)
    }
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image `{}` of {} {:?}", self.0.name, self.0.extent, self.0.format)
    }
}
