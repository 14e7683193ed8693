//! The rows of one band: colour and depth where kernels read and write them, and where the host finds them.
//!
//! Kernels work on the rows, with no copy of a bin between a clear and a resolve of all
//! pixels; `docs/tried.md` has the cost of such copies.

use super::{
    attach::{Attachment, Attachments},
    scratch::Scratch,
};
use crate::{
    error::Result,
    grid::Grid,
    vk::{Buffer, Gpu, Memory, Recorder, Recording},
};
use bytemuck::Pod;

/// Colour and depth of one band, row by row.
pub struct Target {
    /// Words of pixels, one target after the other ([`Attachments::planes`]).
    pub color: Buffer<u32>,
    /// Texels of one target at a time, on their way to an image or from one, if there are narrow ones.
    pub texels: Option<Buffer<u32>>,
    /// Depth of pixels.
    pub depth: Buffer<f32>,
    /// The least and the greatest depth that a bin may hold, as the batches of opaque work that follow
    /// ask for them.
    pub bin_bounds: Buffer<[f32; 2]>,
    /// The memory where the host reads colour, if it does; the same as `color` if the host sees the device's memory.
    pub host_color: Option<Buffer<u32>>,
    /// See `host_color`.
    pub host_depth: Option<Buffer<f32>>,
}

impl Target {
    /// Rows that the host does not read are in `scratch`.
    pub fn new(
        gpu: &Gpu,
        scratch: &mut Scratch,
        band: &Grid,
        attachments: &Attachments,
    ) -> Result<Self> {
        let pixels = band.extent.pixels();
        // A buffer without elements cannot be bound.
        let words = (band.plane_pixels() * attachments.row_bytes() / 4).max(1);
        let is_read = attachments.colors().any(Attachment::is_read);
        let texels = attachments.narrow_bytes().map(|texel_bytes| {
            scratch.get(gpu, "narrow texels", (pixels * texel_bytes).div_ceil(4))
        });
        let (color, host_color) = rows(gpu, scratch, "color", words, is_read)?;
        let is_read = attachments.depth.as_ref().is_some_and(Attachment::is_read);
        let (depth, host_depth) = rows(gpu, scratch, "depth", pixels, is_read)?;
        let bin_bounds = scratch.get(gpu, "bounds of bins", band.bins() as usize)?;
        let texels = texels.transpose()?;
        Ok(Self { color, texels, depth, bin_bounds, host_color, host_depth })
    }

    /// Brings colour to the host, where that takes anything.
    pub fn copy_of_color(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        copy(gpu, "copy of the colour targets", &self.color, self.host_color.as_ref())
    }

    /// Brings depth to the host, where that takes anything.
    pub fn copy_of_depth(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        copy(gpu, "copy of the depth target", &self.depth, self.host_depth.as_ref())
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
