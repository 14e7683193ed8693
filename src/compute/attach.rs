//! The targets of a pass, and the recording of what a band's rows begin with and of what becomes of them at its end:
//! the load and store operations.
//!
//! Narrow texels go by a buffer of their own and a kernel on the way between an image and the rows.
//!
//! At the beginning, rows are cleared, or copied from the target's image or from a picture. At the end, they are copied
//! to the image.

use super::{
    clear,
    narrow::{self, Way},
    target::Target,
};
use crate::{
    abi,
    error::{Error, Result},
    format::Format,
    grid::Grid,
    image::texel,
    pass::Pass,
    target::{ClearColor, LoadOp, StoreOp},
    vk::{Arena, Buffer, Gpu, Image, Kernel, Recorder, Subresource},
};
use std::ops::Range;

/// The targets of a pass.
pub struct Attachments {
    /// By number. A list of fixed length takes no memory of its own.
    colors: [Option<Attachment<ClearColor>>; MAX_COLORS],
    pub depth: Option<Attachment<f32>>,
    /// Bounds that hold for any depth, one for each bin of a band, if depth is loaded.
    any_bounds: Option<Buffer<[f32; 2]>>,
    /// Brings texels to images, or takes them from there, if there are narrow ones.
    narrow: Option<Kernel>,
}

const MAX_COLORS: usize = abi::MAX_COLORS as usize;

/// One target of a pass.
pub struct Attachment<T> {
    begin: Begin<T>,
    pub format: Format,
    pub image: Option<Image>,
    /// Its level and its layer.
    pub subresource: Subresource,
    store: StoreOp,
}

/// What a target begins with.
enum Begin<T> {
    Value(T),
    Image(Image),
    /// All rows of the target, as kernels have them.
    Picture(Buffer<u8>),
}

impl Attachments {
    /// Those of `pass`, which is valid, with bands up to the size of `band`. `narrow` makes that kernel.
    pub fn new(
        gpu: &Gpu,
        arena: &mut Arena,
        (pass, band): (&Pass, &Grid),
        narrow: impl FnOnce() -> Result<Kernel>,
    ) -> Result<Self> {
        let mut colors = [const { None }; MAX_COLORS];
        for (attachment, c) in colors.iter_mut().zip(&pass.colors) {
            let place = (&c.image, c.subresource());
            *attachment = Some(Attachment::new(gpu, c.format, place, &c.load, c.store)?);
        }
        let depth = pass.depth.as_ref();
        let depth = depth.map(|d| {
            let load = match &d.load {
                LoadOp::Clear(depth) => LoadOp::Clear(texel::kept_depth(d.format, *depth)),
                load => load.clone(),
            };
            Attachment::new(gpu, d.format, (&d.image, d.subresource()), &load, d.store)
        });
        let depth = depth.transpose()?;
        let mut narrow_ones = colors.iter().flatten().map(Attachment::is_narrow);
        let is_narrow =
            narrow_ones.any(|narrow| narrow) || depth.as_ref().is_some_and(Attachment::is_narrow);
        let narrow = is_narrow.then(narrow).transpose()?;
        let loaded = depth.as_ref().filter(|depth| !matches!(depth.begin, Begin::Value(_)));
        let any_bounds = loaded.map(|_| arena.push(&vec![[0.0, 1.0]; band.bins() as usize]));
        Ok(Self { colors, depth, any_bounds: any_bounds.transpose()?, narrow })
    }

    /// The colour targets, in their order.
    pub fn colors(&self) -> impl Iterator<Item = &Attachment<ClearColor>> {
        self.colors.iter().flatten()
    }

    /// The colour targets with the bytes of a band's colour that each of them has.
    pub fn planes(
        &self,
        band: &Grid,
    ) -> impl Iterator<Item = (&Attachment<ClearColor>, Range<usize>)> {
        let (plane, pixels) = (band.plane_pixels(), band.extent.pixels());
        self.colors().scan(0, move |next, color| {
            let (first, texel) = (*next, color.format.row_bytes());
            *next += plane * texel;
            Some((color, first..first + pixels * texel))
        })
    }

    /// Bytes of a pixel of all colour targets.
    pub fn row_bytes(&self) -> usize {
        self.colors().map(|color| color.format.row_bytes()).sum()
    }

    /// Most bytes of a pixel of a target that the kernel `narrow` brings to an image or takes from one.
    pub fn narrow_bytes(&self) -> Option<usize> {
        let bytes = |is_narrow: bool, format: Format| is_narrow.then(|| format.texel_bytes());
        let colors = self.colors().filter_map(|color| bytes(color.is_narrow(), color.format));
        let depth = self.depth.iter().filter_map(|depth| bytes(depth.is_narrow(), depth.format));
        colors.chain(depth).max()
    }

    /// The kernel that a target needs on the way to its image and back, if it does.
    fn narrows<T: Copy>(&self, target: &Attachment<T>) -> Option<&Kernel> {
        self.narrow.as_ref().filter(|_| target.is_narrow())
    }

    /// Records what the rows of `target` begin with, which are those of `band`. `kernel` clears.
    pub fn begin(
        &self,
        recorder: &mut Recorder,
        kernel: &Kernel,
        (band, target): (&Grid, &Target),
    ) -> Result<()> {
        let begin = |recorder: &mut Recorder, color: &Attachment<_>, bytes: Range<usize>| {
            let rows = || target.color.cast()?.slice(bytes.clone());
            match (&color.begin, self.narrows(color), target.texels.as_ref()) {
                (Begin::Value(value), ..) => {
                    clear::color(recorder, kernel, target, (color.format, &bytes), *value)
                }
                (Begin::Image(_), Some(narrow), Some(texels)) => color.load_narrow(
                    recorder,
                    narrow,
                    band,
                    (&target.color, bytes.start / 4),
                    texels,
                ),
                _ => color.load(recorder, band, &rows()?),
            }
        };
        // All of them have one buffer, which kernels bind as a whole: only one goes at the same time as depth, if a single
        // command brings its rows to what they begin with.
        let goes_alone = |color: &Attachment<_>| self.narrows(color).is_some();
        for (n, (color, bytes)) in self.planes(band).enumerate() {
            if n > 0 || goes_alone(color) {
                begin(recorder, color, bytes)?;
            }
        }
        let narrow_depth = match (&self.depth, target.texels.as_ref()) {
            (Some(depth), Some(texels)) if matches!(depth.begin, Begin::Image(_)) => {
                self.narrows(depth).map(|narrow| (depth, narrow, texels))
            }
            _ => None,
        };
        if let Some((depth, narrow, texels)) = narrow_depth {
            depth.load_narrow(recorder, narrow, band, (&target.depth.cast()?, 0), texels)?;
        }
        recorder.group(|recorder| {
            if let Some((color, bytes)) = self.planes(band).next().filter(|(c, _)| !goes_alone(c)) {
                begin(recorder, color, bytes)?;
            }
            match (&self.depth, &self.any_bounds) {
                (Some(depth), Some(bounds)) => {
                    if narrow_depth.is_none() {
                        depth.load(recorder, band, &target.depth.cast()?)?;
                    }
                    let bins = target.bin_bounds.len();
                    recorder.copy(&bounds.slice(0..bins)?, &target.bin_bounds)
                }
                (depth, _) => {
                    let value = match depth.as_ref().map(|depth| &depth.begin) {
                        Some(Begin::Value(value)) => *value,
                        _ => 1.0,
                    };
                    clear::depth(recorder, target, value)
                }
            }
        })
    }

    /// Records what becomes of the rows of `target`, which are those of `band` and complete.
    pub fn end(&self, recorder: &mut Recorder, (band, target): (&Grid, &Target)) -> Result<()> {
        for (color, bytes) in self.planes(band) {
            match (self.narrows(color), &target.texels) {
                (Some(narrow), Some(texels)) => {
                    let rows = (&target.color, bytes.start / 4);
                    color.store_narrow(recorder, narrow, band, rows, texels)?;
                }
                _ => color.store(recorder, band, &target.color.cast()?.slice(bytes)?)?,
            }
        }
        match (&self.depth, &target.texels) {
            (Some(depth), Some(texels)) if depth.is_narrow() => {
                let Some(narrow) = self.narrows(depth) else { return Ok(()) };
                let rows = (&target.depth.cast()?, 0);
                depth.store_narrow(recorder, narrow, band, rows, texels)?;
            }
            (Some(depth), _) => depth.store(recorder, band, &target.depth.cast()?)?,
            (None, _) => {}
        }
        Ok(())
    }
}

impl<T: Copy> Attachment<T> {
    fn new(
        gpu: &Gpu,
        format: Format,
        (image, subresource): (&Option<Image>, Subresource),
        load: &LoadOp<T>,
        store: StoreOp,
    ) -> Result<Self> {
        if let Some(image) = image {
            image.check_device(gpu)?;
            image.0.check_copied(matches!(load, LoadOp::Load), store == StoreOp::Store)?;
        }
        let begin = match (load, image) {
            (LoadOp::Clear(value), _) => Begin::Value(*value),
            (LoadOp::Picture(picture), _) => {
                let name = "picture to begin with";
                Begin::Picture(match narrow::is_narrow(format) {
                    true => {
                        let rows = narrow::widened(format, &picture.bytes)?;
                        Buffer::with_content(gpu, name, &rows)?.cast()?
                    }
                    false => Buffer::with_content(gpu, name, &picture.bytes)?,
                })
            }
            (LoadOp::Load, Some(image)) => Begin::Image(image.clone()),
            (LoadOp::Load, None) => {
                return Err(Error::Usage("a target without an image has nothing to load".into()));
            }
        };
        Ok(Self { begin, format, image: image.clone(), subresource, store })
    }

    /// Whether its texels are others in its image than in the rows.
    fn is_narrow(&self) -> bool {
        self.image.is_some() && narrow::is_narrow(self.format)
    }

    /// Whether the host reads the rows.
    pub fn is_read(&self) -> bool {
        self.image.is_none() && self.is_stored()
    }

    /// Whether anything is kept.
    pub fn is_stored(&self) -> bool {
        self.store == StoreOp::Store
    }

    /// Copies to `rows` what they begin with, unless that is one value.
    fn load(&self, recorder: &mut Recorder, band: &Grid, rows: &Buffer<u8>) -> Result<()> {
        match &self.begin {
            Begin::Value(_) => Ok(()),
            Begin::Image(image) => {
                recorder.copy_from_image(image, self.subresource, band.rows(), rows)
            }
            Begin::Picture(picture) => {
                let Grid { origin_y, extent, .. } = *band;
                let first = origin_y as usize * extent.width as usize * self.format.row_bytes();
                recorder.copy(&picture.slice(first..first + rows.len())?, rows)
            }
        }
    }

    /// As [`Attachment::load`] from an image, by way of `texels`, to the rows that begin with a word of a buffer.
    fn load_narrow(
        &self,
        recorder: &mut Recorder,
        narrow: &Kernel,
        band: &Grid,
        rows: (&Buffer<u32>, usize),
        texels: &Buffer<u32>,
    ) -> Result<()> {
        self.load(recorder, band, &texels.cast()?)?;
        let way = (Way::ToRows, band.extent.pixels());
        narrow::record(recorder, narrow, rows, (self.format, texels), way)
    }

    /// As [`Attachment::store`], by way of `texels`, of the rows that begin with a word of a buffer.
    fn store_narrow(
        &self,
        recorder: &mut Recorder,
        narrow: &Kernel,
        band: &Grid,
        rows: (&Buffer<u32>, usize),
        texels: &Buffer<u32>,
    ) -> Result<()> {
        if !self.is_stored() {
            return Ok(());
        }
        let way = (Way::FromRows, band.extent.pixels());
        narrow::record(recorder, narrow, rows, (self.format, texels), way)?;
        self.store(recorder, band, &texels.cast()?)
    }

    /// Copies `rows` to the image, if there is one that keeps them.
    fn store(&self, recorder: &mut Recorder, band: &Grid, rows: &Buffer<u8>) -> Result<()> {
        match &self.image {
            Some(image) if self.is_stored() => {
                recorder.copy_to_image(rows, image, self.subresource, band.rows())
            }
            _ => Ok(()),
        }
    }
}
