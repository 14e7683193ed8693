//! The targets of a pass, and the recording of what a band's rows begin with and of what becomes of them at its end:
//! the load and store operations.
//!
//! At the beginning, rows are cleared, or copied from the target's image or from a picture. At the end, they are copied
//! to the image.

use super::{clear, target::Target};
use crate::{
    abi,
    error::{Error, Result},
    format::Format,
    grid::Grid,
    pass::Pass,
    target::{LoadOp, StoreOp},
    vk::{Arena, Buffer, Gpu, Image, Kernel, Recorder, Subresource},
};
use std::ops::Range;

/// The targets of a pass.
pub struct Attachments {
    /// By number. A list of fixed length takes no memory of its own.
    colors: [Option<Attachment<[f32; 4]>>; MAX_COLORS],
    pub depth: Option<Attachment<f32>>,
    /// Bounds that hold for any depth, one for each bin of a band, if depth is loaded.
    any_bounds: Option<Buffer<[f32; 2]>>,
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
    /// All rows of the target.
    Picture(Buffer<u8>),
}

impl Attachments {
    /// Those of `pass`, which is valid, with bands up to the size of `band`.
    pub fn new(gpu: &Gpu, arena: &mut Arena, pass: &Pass, band: &Grid) -> Result<Self> {
        let mut colors = [const { None }; MAX_COLORS];
        for (attachment, c) in colors.iter_mut().zip(&pass.colors) {
            let place = (&c.image, c.subresource());
            *attachment = Some(Attachment::new(gpu, c.format, place, &c.load, c.store)?);
        }
        let depth = pass.depth.as_ref();
        let depth = depth.map(|d| {
            Attachment::new(gpu, Format::D32Float, (&d.image, d.subresource()), &d.load, d.store)
        });
        let depth = depth.transpose()?;
        let loaded = depth.as_ref().filter(|depth| !matches!(depth.begin, Begin::Value(_)));
        let any_bounds = loaded.map(|_| arena.push(&vec![[0.0, 1.0]; band.bins() as usize]));
        Ok(Self { colors, depth, any_bounds: any_bounds.transpose()? })
    }

    /// The colour targets, in their order.
    pub fn colors(&self) -> impl Iterator<Item = &Attachment<[f32; 4]>> {
        self.colors.iter().flatten()
    }

    /// The colour targets with the bytes of a band's colour that each of them has.
    pub fn planes(
        &self,
        band: &Grid,
    ) -> impl Iterator<Item = (&Attachment<[f32; 4]>, Range<usize>)> {
        let (plane, pixels) = (band.plane_pixels(), band.extent.pixels());
        self.colors().scan(0, move |next, color| {
            let (first, texel) = (*next, color.format.texel_bytes());
            *next += plane * texel;
            Some((color, first..first + pixels * texel))
        })
    }

    /// Bytes of a pixel of all colour targets.
    pub fn texel_bytes(&self) -> usize {
        self.colors().map(|color| color.format.texel_bytes()).sum()
    }

    /// Records what the rows of `target` begin with, which are those of `band`. `kernel` clears.
    pub fn begin(
        &self,
        recorder: &mut Recorder,
        kernel: &Kernel,
        (band, target): (&Grid, &Target),
    ) -> Result<()> {
        let begin =
            |recorder: &mut Recorder, color: &Attachment<_>, bytes: Range<usize>| match color.begin
            {
                Begin::Value(value) => {
                    clear::color(recorder, kernel, target, (color.format, &bytes), value)
                }
                _ => color.load(recorder, band, &target.color.cast()?.slice(bytes)?),
            };
        // All of them have one buffer, which the clear binds as a whole: only one goes at the same time as depth.
        for (color, bytes) in self.planes(band).skip(1) {
            begin(recorder, color, bytes)?;
        }
        recorder.group(|recorder| {
            if let Some((color, bytes)) = self.planes(band).next() {
                begin(recorder, color, bytes)?;
            }
            match (&self.depth, &self.any_bounds) {
                (Some(depth), Some(bounds)) => {
                    depth.load(recorder, band, &target.depth.cast()?)?;
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
            color.store(recorder, band, &target.color.cast()?.slice(bytes)?)?;
        }
        if let Some(depth) = &self.depth {
            depth.store(recorder, band, &target.depth.cast()?)?;
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
                Begin::Picture(Buffer::with_content(gpu, "picture to begin with", &picture.bytes)?)
            }
            (LoadOp::Load, Some(image)) => Begin::Image(image.clone()),
            (LoadOp::Load, None) => {
                return Err(Error::Usage("a target without an image has nothing to load".into()));
            }
        };
        Ok(Self { begin, format, image: image.clone(), subresource, store })
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
                let first = origin_y as usize * extent.width as usize * self.format.texel_bytes();
                recorder.copy(&picture.slice(first..first + rows.len())?, rows)
            }
        }
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
