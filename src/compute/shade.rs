//! Records shading of opaque work: a dispatch for each fragment kernel over the bins it is seen in.
//!
//! Reads: the bins and the triangles that cover whole bins, visibility, triangles, positions, varyings, the
//! resource table. Writes: colour.
//! Contract and kernel: `glsl/shade.comp`.

use super::frame::Stage;
use crate::{
    abi::Batch,
    error::Result,
    vk::{Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernels: &[Kernel]) -> Result<()> {
    let b = stage.buffers;
    recorder.group(|recorder| {
        for (number, kernel) in kernels.iter().enumerate() {
            let push = Batch { fragment_kernel: number as u32, ..stage.push };
            recorder
                .kernel(kernel)
                .bind("Pieces", stage.pieces)
                .bind("Triangles", &b.triangles)
                .bind("Positions", &b.positions)
                .bind("Varyings", &b.varyings.cast::<[u32; 2]>()?)
                .bind("ResourceSlots", &b.resource_slots)
                .bind("ShadeBins", &b.shade_bins)
                .bind("Visibility", &b.visibility)
                .bind("Color", &stage.target.color)
                .table(stage.table)
                .push(&push)
                .dispatch_indirect(&b.shade_args, 12 * number as u64)?;
        }
        Ok(())
    })
}
