//! Records the primitive stage.
//!
//! Reads: pieces, index buffers, window positions, positions. Writes: triangles, counts of the cells.
//! Contract and kernel: `glsl/primitive.comp`.

use super::frame::Stage;
use crate::{
    error::Result,
    vk::{Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernel: &Kernel) -> Result<()> {
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
    stage.over_primitives(dispatch)
}
