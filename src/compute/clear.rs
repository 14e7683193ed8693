//! Records the clear of a band's rows.
//!
//! Reads: nothing. Writes: colour, depth, stencil values. Contract and kernel: `glsl/clear.comp`, which is needed only
//! where a colour is no repetition of one word; the device fills the rest by itself.

use super::target::{Plane, Target};
use crate::{
    abi::{self, Clear},
    error::Result,
    format::Format,
    grid,
    image::texel,
    target::ClearColor,
    vk::{Kernel, Recorder},
};

/// Clears the samples of the colour target `plane`, which has this format.
pub fn color(
    recorder: &mut Recorder,
    kernel: &Kernel,
    plane: &Plane<'_>,
    format: Format,
    color: ClearColor,
) -> Result<()> {
    let texel = texel::encode(format, color);
    let (samples, bytes) = (plane.samples().0, plane.sample_bytes());
    let texels = match format.row_bytes() {
        4 => [texel[0]; 4],
        8 => [texel[0], texel[1], texel[0], texel[1]],
        _ => texel,
    };
    if texels == [texels[0]; 4] {
        let words = samples.slice(bytes.start / 4..bytes.end / 4)?;
        return recorder.fill(&words, texels[0]);
    }
    // A plane has room for whole times four words (`abi::PLANE_PIXELS`).
    let (first, count) = ((bytes.start / 16) as u32, bytes.len().div_ceil(16) as u32);
    let lanes = abi::GROUP * abi::CLEAR_ROUNDS;
    recorder
        .kernel(kernel)
        .bind("Color", &samples.cast::<[u32; 4]>()?)
        .push(&Clear { texels, count, first })
        .dispatch(grid::groups(count, lanes))
}

/// Clears stencil values to `value`.
pub fn stencil(recorder: &mut Recorder, target: &Target, value: u8) -> Result<()> {
    recorder.fill(&target.stencil, value.into())
}

/// Clears depth to `depth`, and the bounds of the bins with it.
pub fn depth(recorder: &mut Recorder, target: &Target, depth: f32) -> Result<()> {
    recorder.fill(&target.depth, depth.to_bits())?;
    recorder.fill(&target.bin_bounds, depth.to_bits())
}
