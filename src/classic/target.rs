//! The targets of a prepared pass: images, what they begin with, and where the host reads them.

use crate::{
    error::{Error, Result},
    format::Format,
    image::{self, texel::without_rest},
    pass::Pass,
    samples::Samples,
    state::ResolveMode,
    target::{DepthTarget, LoadOp, StencilTarget, StoreOp},
    vk::{
        Aspect, Buffer, Gpu, Image, ImageInfo, ImageUse, Memory, Recorder, Recording, Subresource,
        clear_color,
    },
};
use ash::vk;

/// The targets of a pass.
pub(super) struct Targets {
    pub extent: image::Extent,
    pub colors: Vec<Target>,
    /// Depths, stencil values or both.
    pub depth_stencil: Option<Target>,
}

/// One target.
pub(super) struct Target {
    image: Image,
    /// Its level and its layer that are drawn to.
    at: Subresource,
    /// The image has it.
    view: vk::ImageView,
    /// What is drawn to, if pixels have several samples: an image and its view.
    samples: Option<(Image, vk::ImageView)>,
    /// One, or depths and stencil values.
    parts: Vec<Part>,
}

/// What is done with an aspect of a target.
struct Part {
    aspect: Aspect,
    begin: Begin,
    store: StoreOp,
    /// How several samples become a texel.
    resolve: vk::ResolveModeFlags,
    /// `Some` for an image that was made for the pass: what fills the buffer, which the host reads. It is not part of
    /// the draws, so that their time does not include it.
    copy: Option<(Recording, Buffer<u8>)>,
}

/// What a part begins with.
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
            let part = Part::new(Aspect::Main, begin, color.store, color.resolve());
            Target::new(gpu, &info, place, vec![part])
        });
        Ok(Self {
            extent: pass.extent,
            colors: colors.collect::<Result<_>>()?,
            depth_stencil: depth_stencil(gpu, pass)?,
        })
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Target> {
        self.colors.iter().chain(&self.depth_stencil)
    }
}

/// The target of depths and stencil values of `pass`, if it has any.
fn depth_stencil(gpu: &Gpu, pass: &Pass) -> Result<Option<Target>> {
    let Some(format) = depth_stencil_format(gpu, pass)? else { return Ok(None) };
    let mut parts = Vec::new();
    if let Some(DepthTarget { load, store, resolve, .. }) = &pass.depth {
        let begin = Begin::new(gpu, load, |depth| cleared(depth, 0))?;
        parts.push(Part::new(Aspect::Main, begin, *store, *resolve));
    }
    if let Some(StencilTarget { load, store, resolve, .. }) = &pass.stencil {
        let begin = Begin::new(gpu, load, |value| cleared(0.0, value))?;
        parts.push(Part::new(Aspect::Stencil, begin, *store, *resolve));
    }
    if pass.samples != Samples::One
        && let [depth, stencil] = &parts[..]
        && !resolves_both(gpu, [depth, stencil])
    {
        return Err(Error::Device(format!(
            "pass `{}`: {} itself does not resolve depths in one way and stencil values in another; the compute executor does",
            pass.label,
            gpu.info().name
        )));
    }
    let depth = pass.depth.iter().map(|depth| (&depth.image, depth.level, depth.layer));
    let stencil = pass.stencil.iter().map(|of| (&of.image, of.level, of.layer));
    let mut places = depth.chain(stencil).filter_map(|(image, level, layer)| {
        Some((image.as_ref()?, Subresource { level, layer, ..Subresource::default() }))
    });
    let name = if pass.depth.is_some() { "depth target" } else { "stencil target" };
    Target::new(gpu, &info(name, pass, format), places.next(), parts).map(Some)
}

/// Whether the device resolves both of these parts as they want it.
fn resolves_both(gpu: &Gpu, parts: [&Part; 2]) -> bool {
    let limits = &gpu.0.draw_limits;
    let [a, b] = parts.map(|part| (part.store == StoreOp::Store).then_some(part.resolve));
    let one_alone = a.is_none() || b.is_none();
    a == b || limits.resolves_apart || (one_alone && limits.resolves_one)
}

fn cleared(depth: f32, stencil: u8) -> vk::ClearValue {
    let stencil = stencil.into();
    vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth, stencil } }
}

/// The format of the image that has the depths and the stencil values of `pass`, if it has any.
///
/// # Errors
/// [`Error::Device`] if they cannot be in one image of the device.
pub(super) fn depth_stencil_format(gpu: &Gpu, pass: &Pass) -> Result<Option<Format>> {
    let lacks = |what: String| {
        let name = &gpu.info().name;
        Err(Error::Device(format!(
            "pass `{}`: {name} itself {what}; the compute executor does",
            pass.label
        )))
    };
    let draws = |format: &Format| gpu.0.draws_to(*format);
    match (&pass.depth, &pass.stencil) {
        (None, None) => Ok(None),
        (Some(depth), None) => Ok(Some(match &depth.image {
            Some(image) => image.format(),
            None => depth.format,
        })),
        (None, Some(StencilTarget { image: Some(image), .. })) => Ok(Some(image.format())),
        (None, Some(_)) => {
            let all = [Format::S8Uint, Format::D24UnormS8Uint, Format::D32FloatS8Uint];
            match all.into_iter().find(draws) {
                Some(format) => Ok(Some(format)),
                None => lacks("draws to no image of stencil values".into()),
            }
        }
        (Some(depth), Some(stencil)) => match (&depth.image, &stencil.image) {
            (None, None) => match depth.format.with_stencil().filter(draws) {
                Some(format) => Ok(Some(format)),
                None => {
                    lacks(format!("draws to no image of {:?} and stencil values", depth.format))
                }
            },
            (Some(a), Some(b))
                if a.is(b) && (depth.level, depth.layer) == (stencil.level, stencil.layer) =>
            {
                Ok(Some(a.format()))
            }
            _ => lacks("does not draw depths to one image and stencil values to another".into()),
        },
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

impl Part {
    fn new(aspect: Aspect, begin: Begin, store: StoreOp, resolve: ResolveMode) -> Self {
        let resolve = match resolve {
            ResolveMode::Average => vk::ResolveModeFlags::AVERAGE,
            ResolveMode::SampleZero => vk::ResolveModeFlags::SAMPLE_ZERO,
            ResolveMode::Min => vk::ResolveModeFlags::MIN,
            ResolveMode::Max => vk::ResolveModeFlags::MAX,
        };
        Self { aspect, begin, store, resolve, copy: None }
    }

    fn is_cleared(&self) -> bool {
        matches!(self.begin, Begin::Value(_))
    }

    /// Refuses what the device itself does not do with several samples.
    fn check_samples(&self, gpu: &Gpu, info: &ImageInfo<'_>) -> Result<()> {
        let lacks = |what: &str| {
            Err(Error::Device(format!(
                "{}: {} itself {what}; the compute executor does",
                info.name,
                gpu.info().name
            )))
        };
        if !self.is_cleared() {
            return lacks("loads no target of several samples: it can only clear one");
        }
        let limits = &gpu.0.draw_limits;
        let offered = match self.aspect {
            Aspect::Stencil => limits.stencil_resolves,
            Aspect::Main if info.format.is_depth() => limits.depth_resolves,
            Aspect::Main => return Ok(()),
        };
        if self.store == StoreOp::Store && !offered.contains(self.resolve) {
            return lacks(&format!("does not resolve it by {:?}", self.resolve));
        }
        Ok(())
    }
}

impl Target {
    fn new(
        gpu: &Gpu,
        info: &ImageInfo<'_>,
        place: Option<(&Image, Subresource)>,
        mut parts: Vec<Part>,
    ) -> Result<Self> {
        let samples = match info.samples {
            Samples::One => None,
            _ => {
                parts.iter().try_for_each(|part| part.check_samples(gpu, info))?;
                let image = Image::drawn(gpu, info)?;
                let view = image.0.target_view(Subresource::default())?;
                Some((image, view))
            }
        };
        let info = &ImageInfo { samples: Samples::One, ..*info };
        if let Some((image, at)) = place {
            image.check_device(gpu)?;
            let at = Subresource { aspect: Aspect::Main, ..at };
            let view = image.0.target_view(at)?;
            return Ok(Self { image: image.clone(), at, view, samples, parts });
        }
        let image = Image::new(gpu, info)?;
        let at = Subresource::default();
        let view = image.0.target_view(at)?;
        for part in parts.iter_mut().filter(|part| part.store == StoreOp::Store) {
            let mut recorder = Recorder::new(gpu, &format!("copy of the {}", info.name))?;
            let at = Subresource { aspect: part.aspect, ..at };
            let bytes = info.extent.pixels() * at.format(info.format).texel_bytes();
            let host = Buffer::new(gpu, info.name, bytes, Memory::Readback)?;
            recorder.copy_from_image(&image, at, 0..info.extent.height, &host)?;
            part.copy = Some((recorder.finish()?, host));
        }
        Ok(Self { image, at, view, samples, parts })
    }

    /// Records what comes before the draws.
    pub fn begin(&self, recorder: &mut Recorder) -> Result<()> {
        for part in &self.parts {
            if let Begin::Picture(picture) = &part.begin {
                let rows = 0..self.image.extent().level(self.at.level).height;
                let at = Subresource { aspect: part.aspect, ..self.at };
                recorder.copy_to_image(picture, &self.image, at, rows)?;
            }
        }
        // What is not drawn to keeps what it holds.
        let from = match self.is_whole() && self.parts.iter().all(Part::is_cleared) {
            true => vk::ImageLayout::UNDEFINED,
            false => self.image.0.shader_layout(),
        };
        recorder.transition(&self.image, from, self.layout());
        if let Some((samples, _)) = &self.samples {
            recorder.transition(samples, vk::ImageLayout::UNDEFINED, self.layout());
        }
        Ok(())
    }

    /// Records what comes after the draws.
    pub fn end(&self, recorder: &mut Recorder) {
        recorder.transition(&self.image, self.layout(), self.image.0.shader_layout());
    }

    /// How the draws take the target, or an aspect of it.
    pub fn attachment(&self, aspect: Aspect) -> Option<vk::RenderingAttachmentInfo<'static>> {
        let part = self.part(aspect)?;
        let info = vk::RenderingAttachmentInfo::default().image_layout(self.layout());
        let info = match (&self.samples, part.store) {
            (None, StoreOp::Store) => {
                info.image_view(self.view).store_op(vk::AttachmentStoreOp::STORE)
            }
            (None, StoreOp::Discard) => {
                info.image_view(self.view).store_op(vk::AttachmentStoreOp::DONT_CARE)
            }
            (Some((_, samples)), StoreOp::Store) => info
                .image_view(*samples)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .resolve_mode(part.resolve)
                .resolve_image_view(self.view)
                .resolve_image_layout(self.layout()),
            (Some((_, samples)), StoreOp::Discard) => {
                info.image_view(*samples).store_op(vk::AttachmentStoreOp::DONT_CARE)
            }
        };
        Some(match &part.begin {
            Begin::Value(value) => info.load_op(vk::AttachmentLoadOp::CLEAR).clear_value(*value),
            Begin::Image | Begin::Picture(_) => info.load_op(vk::AttachmentLoadOp::LOAD),
        })
    }

    /// An aspect of the target as it is now, if it is there and stored.
    pub fn read(&mut self, aspect: Aspect) -> Result<Option<image::Picture>> {
        let at = Subresource { aspect, ..self.at };
        let Some(part) = self.parts.iter_mut().find(|part| part.aspect == aspect) else {
            return Ok(None);
        };
        match (&mut part.copy, part.store) {
            (_, StoreOp::Discard) => Ok(None),
            (None, StoreOp::Store) => self.image.download_subresource(at).map(Some),
            (Some((copy, host)), StoreOp::Store) => {
                copy.run()?;
                let (extent, format) = (self.image.extent(), at.format(self.image.format()));
                let bytes = without_rest(format, host.read()?);
                Ok(Some(image::Picture { extent, format, bytes }))
            }
        }
    }

    /// Whether anything of it is kept.
    pub fn is_stored(&self) -> bool {
        self.parts.iter().any(|part| part.store == StoreOp::Store)
    }

    fn part(&self, aspect: Aspect) -> Option<&Part> {
        self.parts.iter().find(|part| part.aspect == aspect)
    }

    /// Whether the image has nothing but what is drawn to.
    fn is_whole(&self) -> bool {
        let format = self.image.format();
        let aspects = if format.is_depth() && format.is_stencil() { 2 } else { 1 };
        let single = self.image.levels() == 1 && self.image.shape().pictures(0) == 1;
        single && self.parts.len() == aspects
    }

    fn layout(&self) -> vk::ImageLayout {
        let format = self.image.format();
        match (format.is_depth(), format.is_stencil()) {
            (false, false) => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            (true, false) => vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
            (false, true) => vk::ImageLayout::STENCIL_ATTACHMENT_OPTIMAL,
            (true, true) => vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        }
    }
}
