//! Records binning: scan, scatter and, for work whose order matters, sort.
//!
//! Reads: triangles, counts of the cells. Writes: the cells' lists, the non-empty bins.
//! Contract and kernels: `glsl/binning_scan.comp`, `glsl/binning_scatter.comp`,
//! `glsl/binning_sort.comp`.

use super::{frame::Stage, kernels::Kernels};
use crate::{
    error::Result,
    grid,
    vk::{Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernels: &Kernels) -> Result<()> {
    let b = stage.buffers;
    recorder
        .kernel(&kernels.scan)
        .bind("CellCounts", &b.cell_counts)
        .bind("CellEnds", &b.cell_ends)
        .bind("Bins", &b.bins)
        .bind("BinArgs", &b.bin_args)
        .push(&stage.push)
        .dispatch([1, 1, 1])?;
    let dispatch = recorder
        .kernel(&kernels.scatter)
        .bind("Triangles", &b.triangles)
        .bind("CellEnds", &b.cell_ends)
        .bind("Entries", &b.entries)
        .bind("PrimitiveCells", &b.primitive_cells)
        .table(stage.table)
        .push(&stage.push);
    stage.over_primitives(dispatch)
}

pub fn record_sort(recorder: &mut Recorder, stage: &Stage, kernel: &Kernel) -> Result<()> {
    recorder
        .kernel(kernel)
        .bind("CellEnds", &stage.buffers.cell_ends)
        .bind("Entries", &stage.buffers.entries)
        .push(&stage.push)
        .dispatch(grid::groups(stage.push.cells, 1))
}
