//! Records the vertex stage: a dispatch for each vertex kernel of the batch.
//!
//! Reads: pieces, runs, attributes, resource slots, the resource table.
//! Writes: positions, varyings. Contract and kernel: `glsl/vertex.comp`.

use super::frame::Stage;
use crate::{
    abi::{self, Batch},
    error::Result,
    grid,
    plan::BatchPlan,
    vk::{Kernel, Recorder},
};

pub fn record(
    recorder: &mut Recorder,
    stage: &Stage,
    kernels: &[Kernel],
    batch: &BatchPlan,
) -> Result<()> {
    let b = stage.buffers;
    let varyings = b.varyings.cast::<[u32; 4]>()?;
    recorder.group(|recorder| {
        for work in &batch.vertex_work {
            let push = Batch {
                run_first: work.run_first,
                run_count: work.run_count,
                slot_first: work.slot_first,
                slot_count: work.slot_count,
                ..stage.push
            };
            recorder
                .kernel(&kernels[work.kernel])
                .bind("Pieces", stage.pieces)
                .bind("Positions", &b.positions)
                .bind("Varyings", &varyings)
                .bind("Attributes", &b.attributes)
                .bind("ResourceSlots", &b.resource_slots)
                .bind("Runs", &b.runs)
                .table(stage.table)
                .push(&push)
                .dispatch(grid::groups(work.slot_count, abi::GROUP * abi::VERTEX_ROUNDS))?;
        }
        Ok(())
    })
}
