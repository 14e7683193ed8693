//! Records raster, shading and blending of work whose order matters: a workgroup for each non-empty
//! bin.
//!
//! Reads: bins, sorted lists, triangles, positions, varyings, the resource table.
//! Writes: colour, depth, stencil values; visibility for a trace. Contract and kernel: `glsl/ordered.comp`.

use super::frame::Stage;
use crate::{
    error::Result,
    vk::{Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernel: &Kernel) -> Result<()> {
    let b = stage.buffers;
    recorder
        .kernel(kernel)
        .bind("Pieces", stage.pieces)
        .bind("Triangles", &b.triangles)
        .bind("Positions", &b.positions)
        .bind("Varyings", &b.varyings.cast::<[u32; 2]>()?)
        .bind("ResourceSlots", &b.resource_slots)
        .bind("Bins", &b.bins)
        .bind("CellEnds", &b.cell_ends)
        .bind("Entries", &b.entries)
        .bind("Depth", &stage.target.depth)
        .bind("Stencil", &stage.target.stencil)
        .bind("BinBounds", &stage.target.bin_bounds)
        .bind("Visibility", &b.visibility)
        .bind("Color", &stage.target.color)
        .table(stage.table)
        .push(&stage.push)
        .dispatch_indirect(&b.bin_args, 0)
}
