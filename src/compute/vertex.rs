//! Records the vertex stage: a dispatch for each vertex kernel of the batch.
//!
//! Reads: pieces, runs, attributes, resource slots, the resource table.
//! Writes: positions, window positions, varyings. Contract and kernel: `glsl/vertex.comp`.

use super::frame::Stage;
use crate::{
    abi::{self, Batch},
    error::Result,
    grid,
    plan::BatchPlan,
    vk::{Kernel, Recorder},
};

/// Invocations of a workgroup: whole subgroups, whose quads fetch together.
pub fn lanes(width: u32) -> u32 {
    width.max(abi::GROUP)
}

pub fn record(
    recorder: &mut Recorder,
    stage: &Stage,
    kernels: &[Kernel],
    batch: &BatchPlan,
) -> Result<()> {
    let b = stage.buffers;
    let varyings = b.varyings.cast::<[u32; 4]>()?;
    let lanes = lanes(stage.width);
    recorder.group(|recorder| {
        for work in &batch.vertex_work {
            let push = Batch {
                run_first: work.run_first,
                run_count: work.run_count,
                slot_first: work.slot_first,
                slot_count: work.slot_count,
                ..stage.push
            };
            let dispatch = recorder
                .kernel(&kernels[work.kernel])
                .bind("Pieces", stage.pieces)
                .bind("Positions", &b.positions)
                .bind("WindowPositions", &b.window_positions)
                .bind("Varyings", &varyings)
                .bind("Attributes", &b.attributes)
                .bind("ResourceSlots", &b.resource_slots)
                .bind("Runs", stage.runs)
                .table(stage.table)
                .push(&push);
            let groups = grid::groups(work.slot_count, lanes * abi::VERTEX_ROUNDS);
            stage.over_vertices(dispatch, groups)?;
        }
        Ok(())
    })
}
