//! Records the clear of a band's targets.
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

/// The clear values of a pass.
#[derive(Clone, Copy, Debug)]
pub struct Values {
    /// Linear RGBA.
    pub color: [f32; 4],
    /// Depth.
    pub depth: f32,
}

pub fn record(
    recorder: &mut Recorder,
    kernel: &Kernel,
    target: &Target,
    format: Format,
    values: Values,
) -> Result<()> {
    recorder.group(|recorder| {
        recorder.fill(&target.depth, values.depth.to_bits())?;
        recorder.fill(&target.bin_bounds, values.depth.to_bits())?;
        if let Some(texel) = image::texel_rgba8(format, values.color) {
            return recorder.fill(&target.color, u32::from_le_bytes(texel));
        }
        let pixels = target.depth.len() as u32;
        let lanes = abi::GROUP * abi::CLEAR_PIXELS;
        recorder
            .kernel(kernel)
            .bind("Color", &target.color.cast::<[u32; 2]>()?)
            .push(&Clear { color: values.color, pixels })
            .dispatch(grid::groups(pixels, lanes))
    })
}
