//! Records the way from bins to rows.
//!
//! Reads: colour, depth. Writes: their rows. Contract and kernel: `glsl/resolve.comp`.

use super::frame::Stage;
use crate::{
    abi,
    error::Result,
    grid,
    vk::{Kernel, Recorder},
};

pub fn record(recorder: &mut Recorder, stage: &Stage, kernel: &Kernel) -> Result<()> {
    let b = stage.buffers;
    recorder
        .kernel(kernel)
        .bind("Color", &b.color)
        .bind("Depth", &b.depth)
        .bind("ColorRows", &b.color_rows)
        .bind("DepthRows", &b.depth_rows)
        .push(&stage.push)
        .dispatch(grid::groups(stage.push.width * stage.push.height, abi::GROUP))
}
