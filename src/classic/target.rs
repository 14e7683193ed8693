//! The targets of a prepared pass: images, what they begin with, and where the host reads them.

use crate::{
    error::{Error, Result},
    format::Format,
    image::{self, Extent, texel::without_rest},
    pass::Pass,
    samples::Samples,
    state::ResolveMode,
    target::{LoadOp, StoreOp},
    vk::{
        Buffer, Gpu, Image, ImageInfo, ImageUse, Memory, Recorder, Recording, Subresource,
        clear_color,
    },
};
use ash::vk;

/// The targets of a pass.
pub(super) struct Targets {
    pub extent: Extent,
    pub colors: Vec<Target>,
    pub depth: Option<Target>,
}

/// One target.
pub(super) struct Target {
    image: Image,
    /// Its level and its layer that are drawn to.
    at: Subresource,
    /// The image has it.
    view: vk::ImageView,
    begin: Begin,
    store: StoreOp,
    /// What is drawn to, if pixels have several samples.
    samples: Option<SampledImage>,
    /// `Some` for an image that was made for the pass: what fills the buffer, which the host reads. It is not part of
    /// the draws, so that their time does not include it.
    copy: Option<(Recording, Buffer<u8>)>,
}

/// An image of several samples, and how the target is made of it.
struct SampledImage {
    image: Image,
    /// The image has it.
    view: vk::ImageView,
    resolve: vk::ResolveModeFlags,
}

/// What a target begins with.
enum Begin {
    Value(vk::ClearValue),
    Image,
    Picture(Buffer<u8>),
}

impl Targets {
    /// Those of `pass`, which is valid.
    pub fn new(gpu: &Gpu, pass: &Pass) -> Result<Self> {
        let colors = pass.colors.iter().map(|color| {
            let value = |of| vk::ClearValue { color: clear_color(color.format, of) };
            let begin = Begin::new(gpu, &color.load, value)?;
            let info = info("colour target", pass, color.format);
            let place = color.image.as_ref().map(|image| (image, color.subresource()));
            Target::new(gpu, &info, place, begin, (color.store, color.resolve()))
        });
        let depth = pass.depth.as_ref().map(|depth| {
            let value = |depth| vk::ClearValue {
                depth_stencil: vk::ClearDepthStencilValue { depth, stencil: 0 },
            };
            let begin = Begin::new(gpu, &depth.load, value)?;
            let info = info("depth target", pass, depth.format);
            let place = depth.image.as_ref().map(|image| (image, depth.subresource()));
            Target::new(gpu, &info, place, begin, (depth.store, depth.resolve))
        });
        Ok(Self {
            extent: pass.extent,
            colors: colors.collect::<Result<_>>()?,
            depth: depth.transpose()?,
        })
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Target> {
        self.colors.iter().chain(&self.depth)
    }
}

fn info<'a>(name: &'a str, pass: &Pass, format: Format) -> ImageInfo<'a> {
    let info = ImageInfo::new(name, pass.extent, format, ImageUse::Attachment);
    ImageInfo { samples: pass.samples, ..info }
}

impl Begin {
    fn new<T: Copy>(
        gpu: &Gpu,
        load: &LoadOp<T>,
        value: impl Fn(T) -> vk::ClearValue,
    ) -> Result<Self> {
        Ok(match load {
            LoadOp::Clear(of) => Begin::Value(value(*of)),
            LoadOp::Load => Begin::Image,
            LoadOp::Picture(picture) => {
                Begin::Picture(Buffer::with_content(gpu, "picture to begin with", &picture.bytes)?)
            }
        })
    }
}

impl SampledImage {
    fn new(
        gpu: &Gpu,
        info: &ImageInfo<'_>,
        begin: &Begin,
        (store, resolve): (StoreOp, ResolveMode),
    ) -> Result<Self> {
        let lacks = |what: &str| {
            Err(Error::Device(format!(
                "{}: {} itself {what}; the compute executor does",
                info.name,
                gpu.info().name
            )))
        };
        if !matches!(begin, Begin::Value(_)) {
            return lacks("loads no target of several samples: it can only clear one");
        }
        let resolve = match resolve {
            ResolveMode::Average => vk::ResolveModeFlags::AVERAGE,
            ResolveMode::SampleZero => vk::ResolveModeFlags::SAMPLE_ZERO,
            ResolveMode::Min => vk::ResolveModeFlags::MIN,
            ResolveMode::Max => vk::ResolveModeFlags::MAX,
        };
        let offered = gpu.0.draw_limits.depth_resolves;
        if info.format.is_depth() && store == StoreOp::Store && !offered.contains(resolve) {
            return lacks(&format!("resolves no depths by {resolve:?}"));
        }
        let image = Image::drawn(gpu, info)?;
        let view = image.0.target_view(Subresource::default())?;
        Ok(Self { image, view, resolve })
    }
}

impl Target {
    fn new(
        gpu: &Gpu,
        info: &ImageInfo<'_>,
        place: Option<(&Image, Subresource)>,
        begin: Begin,
        (store, resolve): (StoreOp, ResolveMode),
    ) -> Result<Self> {
        let samples = match info.samples {
            Samples::One => None,
            _ => Some(SampledImage::new(gpu, info, &begin, (store, resolve))?),
        };
        let info = &ImageInfo { samples: Samples::One, ..*info };
        if let Some((image, at)) = place {
            image.check_device(gpu)?;
            let view = image.0.target_view(at)?;
            let image = image.clone();
            return Ok(Self { image, at, view, begin, store, samples, copy: None });
        }
        let image = Image::new(gpu, info)?;
        let at = Subresource::default();
        let view = image.0.target_view(at)?;
        let copy = match store {
            StoreOp::Store => {
                let mut recorder = Recorder::new(gpu, &format!("copy of the {}", info.name))?;
                let bytes = info.extent.pixels() * info.format.texel_bytes();
                let host = Buffer::new(gpu, info.name, bytes, Memory::Readback)?;
                recorder.copy_from_image(&image, at, 0..info.extent.height, &host)?;
                Some((recorder.finish()?, host))
            }
            StoreOp::Discard => None,
        };
        Ok(Self { image, at, view, begin, store, samples, copy })
    }

    /// Records what comes before the draws.
    pub fn begin(&self, recorder: &mut Recorder) -> Result<()> {
        let from = match &self.begin {
            // The other levels and layers keep what they hold.
            Begin::Value(_) if self.is_part() => self.image.0.shader_layout(),
            Begin::Value(_) => vk::ImageLayout::UNDEFINED,
            Begin::Image => self.image.0.shader_layout(),
            Begin::Picture(picture) => {
                let rows = 0..self.image.extent().level(self.at.level).height;
                recorder.copy_to_image(picture, &self.image, self.at, rows)?;
                self.image.0.shader_layout()
            }
        };
        recorder.transition(&self.image, from, self.layout());
        if let Some(samples) = &self.samples {
            let nothing = vk::ImageLayout::UNDEFINED;
            recorder.transition(&samples.image, nothing, self.layout());
        }
        Ok(())
    }

    /// Records what comes after the draws.
    pub fn end(&self, recorder: &mut Recorder) {
        recorder.transition(&self.image, self.layout(), self.image.0.shader_layout());
    }

    /// How the draws take it.
    pub fn attachment(&self) -> vk::RenderingAttachmentInfo<'static> {
        let info = vk::RenderingAttachmentInfo::default().image_layout(self.layout());
        let info = match (&self.samples, self.store) {
            (None, StoreOp::Store) => {
                info.image_view(self.view).store_op(vk::AttachmentStoreOp::STORE)
            }
            (None, StoreOp::Discard) => {
                info.image_view(self.view).store_op(vk::AttachmentStoreOp::DONT_CARE)
            }
            (Some(samples), StoreOp::Store) => info
                .image_view(samples.view)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .resolve_mode(samples.resolve)
                .resolve_image_view(self.view)
                .resolve_image_layout(self.layout()),
            (Some(samples), StoreOp::Discard) => {
                info.image_view(samples.view).store_op(vk::AttachmentStoreOp::DONT_CARE)
            }
        };
        match &self.begin {
            Begin::Value(value) => info.load_op(vk::AttachmentLoadOp::CLEAR).clear_value(*value),
            Begin::Image | Begin::Picture(_) => info.load_op(vk::AttachmentLoadOp::LOAD),
        }
    }

    /// The target as it is now, if it is stored.
    pub fn read(&mut self) -> Result<Option<image::Picture>> {
        match (&mut self.copy, self.store) {
            (_, StoreOp::Discard) => Ok(None),
            (None, StoreOp::Store) => {
                self.image.download_layer(self.at.level, self.at.layer).map(Some)
            }
            (Some((copy, host)), StoreOp::Store) => {
                copy.run()?;
                let (extent, format) = (self.image.extent(), self.image.format());
                let bytes = without_rest(format, host.read()?);
                Ok(Some(image::Picture { extent, format, bytes }))
            }
        }
    }

    /// Whether anything is kept.
    pub fn is_stored(&self) -> bool {
        self.store == StoreOp::Store
    }

    /// Whether the image has more than what is drawn to.
    fn is_part(&self) -> bool {
        self.image.levels() > 1 || self.image.shape().pictures(0) > 1
    }

    fn layout(&self) -> vk::ImageLayout {
        match self.image.format().is_depth() {
            true => vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
            false => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        }
    }
}
