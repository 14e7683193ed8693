//! The targets of one band: colour and depth in rows, where kernels read and write them and where the
//! host finds them.
//!
//! Kernels work on the target's own rows, with no copy of a bin between a clear and a resolve of all
//! pixels; `docs/tried.md` has the cost of such copies.

use crate::{
    error::Result,
    format::Format,
    grid::Grid,
    vk::{Buffer, Gpu, Memory, Recorder, Recording},
};

/// Colour and depth of one band, row by row.
pub struct Target {
    /// Words of pixels.
    pub color: Buffer<u32>,
    /// Depth of pixels.
    pub depth: Buffer<f32>,
    /// The least and the greatest depth that a bin may hold, as the batches of opaque work that follow
    /// ask for them.
    pub bin_bounds: Buffer<[f32; 2]>,
    /// The memory that the host reads; the same as `color` if the host sees the device's memory.
    pub host_color: Buffer<u32>,
    /// See `host_color`.
    pub host_depth: Buffer<f32>,
}

impl Target {
    pub fn new(gpu: &Gpu, band: &Grid, format: Format) -> Result<Self> {
        let pixels = band.extent.pixels();
        let words = pixels * format.texel_bytes() / 4;
        let host_color = Buffer::new(gpu, "color", words, Memory::Readback)?;
        let host_depth = Buffer::new(gpu, "depth", pixels, Memory::Readback)?;
        let (color, depth) = if gpu.has_unified_memory() {
            (host_color.clone(), host_depth.clone())
        } else {
            let memory = Memory::Device;
            (Buffer::new(gpu, "color", words, memory)?, Buffer::new(gpu, "depth", pixels, memory)?)
        };
        let bins = band.bins() as usize;
        let bin_bounds = Buffer::new(gpu, "bounds of bins", bins, Memory::Device)?;
        Ok(Self { color, depth, bin_bounds, host_color, host_depth })
    }

    /// Brings colour to the host, where that takes anything.
    pub fn copy_of_color(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        copy(gpu, "copy of the colour target", &self.color, &self.host_color)
    }

    /// Brings depth to the host, where that takes anything.
    pub fn copy_of_depth(&self, gpu: &Gpu) -> Result<Option<Recording>> {
        copy(gpu, "copy of the depth target", &self.depth, &self.host_depth)
    }
}

fn copy<T: bytemuck::Pod>(
    gpu: &Gpu,
    label: &str,
    from: &Buffer<T>,
    to: &Buffer<T>,
) -> Result<Option<Recording>> {
    if gpu.has_unified_memory() {
        return Ok(None);
    }
    let mut recorder = Recorder::new(gpu, label)?;
    recorder.copy(from, to)?;
    recorder.finish().map(Some)
}
