//! Records how the device makes the pieces of a batch from draw commands.
//!
//! Reads: the template of the pieces, the commands in the resource table. Writes: pieces, runs, the arguments of the
//! dispatches over vertices and primitives. Contract and kernel: `glsl/commands.comp`.

use super::{
    frame::{CommandBuffers, Stage},
    vertex,
};
use crate::{
    abi::{self, Commands},
    error::Result,
    vk::{Kernel, Recorder},
};

pub fn record(
    recorder: &mut Recorder,
    stage: &Stage,
    kernel: &Kernel,
    (commands, buffers): (&Commands, &CommandBuffers),
) -> Result<()> {
    let of_group =
        [vertex::lanes(stage.width) * abi::VERTEX_ROUNDS, abi::GROUP * abi::PRIMITIVE_ROUNDS];
    recorder
        .kernel(kernel)
        .bind("Pieces", stage.pieces)
        .bind("CommandPieces", &buffers.pieces)
        .bind("Runs", &buffers.runs)
        .bind("CommandArgs", &buffers.args)
        .table(stage.table)
        .push(&Commands { of_group, ..*commands })
        .dispatch([1, 1, 1])
}
