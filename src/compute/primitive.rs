//! Records the primitive stage.
//!
//! Reads: pieces, index buffers, window positions, positions. Writes: triangles, counts of the cells.
//! Contract and kernel: `glsl/primitive.comp`.

use super::frame::Stage;
use crate::{
    error::Result,
    vk::{Dispatch, Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernel: &Kernel) -> Result<()> {
    let dispatch = bound(recorder, stage, kernel)?;
    stage.over_primitives(dispatch)
}

/// Reads varyings too, among which the distances are.
pub fn record_with_distances(
    recorder: &mut Recorder,
    stage: &Stage,
    kernel: &Kernel,
) -> Result<()> {
    let varyings = stage.buffers.varyings.cast::<[u32; 4]>()?;
    let dispatch = bound(recorder, stage, kernel)?.bind("Varyings", &varyings);
    stage.over_primitives(dispatch)
}

fn bound<'r>(
    recorder: &'r mut Recorder,
    stage: &Stage,
    kernel: &'r Kernel,
) -> Result<Dispatch<'r>> {
    let b = stage.buffers;
    recorder.fill(&b.cell_counts, 0)?;
    let dispatch = recorder
        .kernel(kernel)
        .bind("Pieces", stage.pieces)
        .bind("Positions", &b.positions)
        .bind("WindowPositions", &b.window_positions)
        .bind("Triangles", &b.triangles)
        .bind("CellCounts", &b.cell_counts)
        .bind("PrimitiveCells", &b.primitive_cells)
        .table(stage.table)
        .push(&stage.push);
    Ok(dispatch)
}
