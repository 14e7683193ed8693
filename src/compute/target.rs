//! The rows of one band: colour, depth and stencil values where kernels read and write them, and where the host finds them.
//!
//! Kernels work on the rows, with no copy of a bin between a clear and a store of all
//! pixels; `docs/tried.md` has the cost of such copies. If pixels have several samples, kernels work on these, and rows have
//! one texel for each pixel.

use super::{
    attach::{Attachment, Attachments},
    scratch::Scratch,
};
use crate::{
    error::{Error, Result},
    grid::Grid,
    vk::{Buffer, Gpu, Memory, Recorder, Recording},
};
use bytemuck::Pod;
use std::{borrow::Cow, ops::Range};

/// Colour, depth and stencil values of one band, row by row.
pub struct Target {
    /// Words of samples, one target after the other ([`Attachments::planes`]).
    pub color: Buffer<u32>,
    /// The same with one texel for each pixel; the same memory, if pixels have one sample.
    color_rows: Buffer<u32>,
    /// Texels of one target at a time, on their way to an image or from one, if there are narrow ones.
    pub texels: Option<Buffer<u32>>,
    /// Depth of samples.
    pub depth: Buffer<f32>,
    /// See `color_rows`.
    depth_rows: Buffer<f32>,
    /// Stencil values of samples, a word each.
    pub stencil: Buffer<u32>,
    /// See `color_rows`.
    stencil_rows: Buffer<u32>,
    samples: usize,
    /// The least and the greatest depth that a bin may hold, as the batches of opaque work that follow
    /// ask for them.
    pub bin_bounds: Buffer<[f32; 2]>,
    /// The memory where the host reads rows of colour, if it does; the same as the rows if the host sees the device's memory.
    pub host_color: Option<Buffer<u32>>,
    /// See `host_color`.
    pub host_depth: Option<Buffer<f32>>,
    /// See `host_color`.
    pub host_stencil: Option<Buffer<u32>>,
}

/// The memory of one target in a band.
pub struct Plane<'a> {
    samples: (Cow<'a, Buffer<u32>>, Range<usize>),
    rows: (Cow<'a, Buffer<u32>>, Range<usize>),
    texels: Option<&'a Buffer<u32>>,
}

impl Plane<'_> {
    /// The buffer of its samples, and the word that is its first.
    pub fn samples(&self) -> (&Buffer<u32>, usize) {
        (&self.samples.0, self.samples.1.start / 4)
    }

    /// The bytes of its samples in their buffer.
    pub fn sample_bytes(&self) -> Range<usize> {
        self.samples.1.clone()
    }

    /// The buffer of its rows, and the word that is its first.
    pub fn rows(&self) -> (&Buffer<u32>, usize) {
        (&self.rows.0, self.rows.1.start / 4)
    }

    /// Its rows alone.
    pub fn row_bytes(&self) -> Result<Buffer<u8>> {
        self.rows.0.cast()?.slice(self.rows.1.clone())
    }

    /// Where its texels are on their way to an image or from one, if they are narrow.
    pub fn texels(&self) -> Result<&Buffer<u32>> {
        self.texels.ok_or_else(|| Error::Usage("a band has no room for narrow texels".into()))
    }
}

impl Target {
    /// Rows that the host does not read are in `scratch`.
    pub fn new(
        gpu: &Gpu,
        scratch: &mut Scratch,
        band: &Grid,
        attachments: &Attachments,
    ) -> Result<Self> {
        let (pixels, samples) = (band.extent.pixels(), attachments.samples.count() as usize);
        // A buffer without elements cannot be bound.
        let words = (band.plane_pixels() * attachments.row_bytes() / 4).max(1);
        let is_read = attachments.colors().any(Attachment::is_read);
        let texels = attachments.narrow_bytes().map(|texel_bytes| {
            scratch.get(gpu, "narrow texels", (pixels * texel_bytes).div_ceil(4))
        });
        let resolves = attachments.colors().any(Attachment::resolves);
        let names = ["color", "samples of colour"];
        let color = Memories::new(gpu, scratch, names, words, (samples, resolves, is_read))?;
        let of_depth = attachments.depth.as_ref();
        let is_read = of_depth.is_some_and(Attachment::is_read);
        let resolves = of_depth.is_some_and(Attachment::resolves);
        let names = ["depth", "samples of depth"];
        let depth = Memories::new(gpu, scratch, names, pixels, (samples, resolves, is_read))?;
        let of_stencil = attachments.stencil.as_ref();
        let is_read = of_stencil.is_some_and(Attachment::is_read);
        let resolves = of_stencil.is_some_and(Attachment::resolves);
        let names = ["stencil values", "samples of stencil values"];
        // Kernels bind a buffer in any case.
        let words = if of_stencil.is_some() { pixels } else { 1 };
        let stencil = Memories::new(gpu, scratch, names, words, (samples, resolves, is_read))?;
        let bin_bounds = scratch.get(gpu, "bounds of bins", band.bins() as usize)?;
        let texels = texels.transpose()?;
        Ok(Self {
            color: color.samples,
            color_rows: color.rows,
            host_color: color.host,
            depth: depth.samples,
            depth_rows: depth.rows,
            host_depth: depth.host,
            stencil: stencil.samples,
            stencil_rows: stencil.rows,
            host_stencil: stencil.host,
            texels,
            samples,
            bin_bounds,
        })
    }

    /// The memory of the colour target whose rows are the bytes `rows`.
    pub fn color_plane(&self, rows: Range<usize>) -> Plane<'_> {
        let samples = rows.start * self.samples..rows.end * self.samples;
        Plane {
            samples: (Cow::Borrowed(&self.color), samples),
            rows: (Cow::Borrowed(&self.color_rows), rows),
            texels: self.texels.as_ref(),
        }
    }

    /// The memory of the depth target.
    pub fn depth_plane(&self) -> Result<Plane<'_>> {
        let (samples, rows) = (self.depth.cast::<u32>()?, self.depth_rows.cast::<u32>()?);
        Ok(self.plane(Cow::Owned(samples), Cow::Owned(rows)))
    }

    /// The memory of the stencil target.
    pub fn stencil_plane(&self) -> Plane<'_> {
        self.plane(Cow::Borrowed(&self.stencil), Cow::Borrowed(&self.stencil_rows))
    }

    /// The memory of a target that has buffers of its own.
    fn plane<'a>(&'a self, samples: Cow<'a, Buffer<u32>>, rows: Cow<'a, Buffer<u32>>) -> Plane<'a> {
        let bytes = |buffer: &Buffer<u32>| 0..4 * buffer.len();
        let (of_samples, of_rows) = (bytes(&samples), bytes(&rows));
        Plane {
            samples: (samples, of_samples),
            rows: (rows, of_rows),
            texels: self.texels.as_ref(),
        }
    }

    /// Brings colour to the host, where that takes anything.
    pub fn copy_of_color(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        copy(gpu, "copy of the colour targets", &self.color_rows, self.host_color.as_ref())
    }

    /// Brings depth to the host, where that takes anything.
    pub fn copy_of_depth(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        copy(gpu, "copy of the depth target", &self.depth_rows, self.host_depth.as_ref())
    }

    /// Brings stencil values to the host, where that takes anything.
    pub fn copy_of_stencil(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        let (rows, host) = (&self.stencil_rows, self.host_stencil.as_ref());
        copy(gpu, "copy of the stencil target", rows, host)
    }
}

/// The samples of a target and its rows, which are the same memory unless pixels have several samples that are resolved.
struct Memories<T> {
    samples: Buffer<T>,
    rows: Buffer<T>,
    /// Where the host reads the rows, if it does.
    host: Option<Buffer<T>>,
}

impl<T: Pod> Memories<T> {
    /// For rows of `len` elements.
    fn new(
        gpu: &Gpu,
        scratch: &mut Scratch,
        [of_rows, of_samples]: [&'static str; 2],
        len: usize,
        (samples, resolves, is_read): (usize, bool, bool),
    ) -> Result<Self> {
        if samples == 1 {
            let (rows, host) = rows(gpu, scratch, of_rows, len, is_read)?;
            return Ok(Self { samples: rows.clone(), rows, host });
        }
        let samples = scratch.get(gpu, of_samples, len * samples)?;
        if !resolves {
            return Ok(Self { rows: samples.clone(), samples, host: None });
        }
        let (rows, host) = rows(gpu, scratch, of_rows, len, is_read)?;
        Ok(Self { samples, rows, host })
    }
}

/// Memory for `len` elements of rows, and the memory where the host reads them.
fn rows<T: Pod>(
    gpu: &Gpu,
    scratch: &mut Scratch,
    name: &'static str,
    len: usize,
    is_read: bool,
) -> Result<(Buffer<T>, Option<Buffer<T>>)> {
    if !is_read {
        return Ok((scratch.get(gpu, name, len)?, None));
    }
    let host = Buffer::new(gpu, name, len, Memory::Readback)?;
    let rows = match gpu.has_unified_memory() {
        true => host.clone(),
        false => Buffer::new(gpu, name, len, Memory::Device)?,
    };
    Ok((rows, Some(host)))
}

fn copy<T: Pod>(
    gpu: &Gpu,
    label: &str,
    from: &Buffer<T>,
    to: Option<&Buffer<T>>,
) -> Result<Option<Recording>> {
    match to {
        Some(to) if !gpu.has_unified_memory() => {
            let mut recorder = Recorder::new(gpu, label)?;
            recorder.copy(from, to)?;
            recorder.finish().map(Some)
        }
        _ => Ok(None),
    }
}
