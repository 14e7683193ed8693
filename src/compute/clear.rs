//! Records the clear of a band's working buffers.
//!
//! Reads: nothing. Writes: colour, depth. Contract and kernel: `glsl/clear.comp`.

use super::frame::Buffers;
use crate::{
    abi::{self, Clear},
    error::Result,
    grid,
    vk::{Kernel, Recorder},
};

pub fn record(
    recorder: &mut Recorder,
    buffers: &Buffers,
    kernel: &Kernel,
    clear: &Clear,
) -> Result<()> {
    recorder
        .kernel(kernel)
        .bind("Color", &buffers.color)
        .bind("Depth", &buffers.depth)
        .push(clear)
        .dispatch(grid::groups(clear.pixels, abi::GROUP))
}
