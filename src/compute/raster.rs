//! Records raster and z-test of opaque work: a workgroup for each non-empty bin.
//!
//! Reads: bins, lists, triangles. Writes: visibility, depth, stencil values, the bins of each fragment kernel with the
//! triangles that cover whole bins.
//! Contract and kernel: `glsl/raster.comp`.

use super::frame::Stage;
use crate::{
    error::Result,
    vk::{Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernel: &Kernel) -> Result<()> {
    let b = stage.buffers;
    recorder.copy(&b.shade_args_start, &b.shade_args)?;
    recorder
        .kernel(kernel)
        .bind("Bins", &b.bins)
        .bind("CellEnds", &b.cell_ends)
        .bind("Entries", &b.entries)
        .bind("Triangles", &b.triangles)
        .bind("Pieces", stage.pieces)
        .bind("Depth", &stage.target.depth)
        .bind("Stencil", &stage.target.stencil)
        .bind("BinBounds", &stage.target.bin_bounds)
        .bind("Visibility", &b.visibility)
        .bind("ShadeArgs", &b.shade_args)
        .bind("ShadeBins", &b.shade_bins)
        .push(&stage.push)
        .dispatch_indirect(&b.bin_args, 0)
}
