//! Records the clear of a band's rows.
//!
//! Reads: nothing. Writes: colour, depth. Contract and kernel: `glsl/clear.comp`, which is needed only
//! where a colour is no repetition of one word; the device fills the rest by itself.

use super::target::Target;
use crate::{
    abi::{self, Clear},
    error::Result,
    format::Format,
    grid, image,
    vk::{Kernel, Recorder},
};
use std::ops::Range;

/// Clears the colour target of this format to `color`, linear RGBA. It has the `bytes` of the colour of the band.
pub fn color(
    recorder: &mut Recorder,
    kernel: &Kernel,
    target: &Target,
    (format, bytes): (Format, &Range<usize>),
    color: [f32; 4],
) -> Result<()> {
    if let Some(texel) = image::texel_rgba8(format, color) {
        let words = target.color.slice(bytes.start / 4..bytes.end / 4)?;
        return recorder.fill(&words, u32::from_le_bytes(texel));
    }
    let (pixels, first) = (target.depth.len() as u32, (bytes.start / format.texel_bytes()) as u32);
    let lanes = abi::GROUP * abi::CLEAR_PIXELS;
    recorder
        .kernel(kernel)
        .bind("Color", &target.color.cast::<[u32; 2]>()?)
        .push(&Clear { color, pixels, first })
        .dispatch(grid::groups(pixels, lanes))
}

/// Clears depth to `depth`, and the bounds of the bins with it.
pub fn depth(recorder: &mut Recorder, target: &Target, depth: f32) -> Result<()> {
    recorder.fill(&target.depth, depth.to_bits())?;
    recorder.fill(&target.bin_bounds, depth.to_bits())
}
