//! Records the way between the samples of a target and texels, one for each pixel.
//!
//! Reads: samples, or texels. Writes: the other ones. Contract and kernel: `glsl/resolve.comp`.

use crate::{
    abi::{self, Resolve},
    error::Result,
    grid,
    vk::{Buffer, Kernel, Recorder},
};

/// Which way values go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    ToSamples,
    FromSamples,
}

/// Records it for one target, whose samples begin with a word of `samples`, and whose texels begin with a word of `texels`.
pub fn record(
    recorder: &mut Recorder,
    kernel: &Kernel,
    (samples, first_sample): (&Buffer<u32>, usize),
    (texels, first_texel): (&Buffer<u32>, usize),
    (way, pixels): (Way, usize),
) -> Result<()> {
    let push = Resolve {
        pixels: pixels as u32,
        first_sample: first_sample as u32,
        first_texel: first_texel as u32,
        to_samples: (way == Way::ToSamples).into(),
    };
    recorder
        .kernel(kernel)
        .bind("Samples", samples)
        .bind("Texels", texels)
        .push(&push)
        .dispatch(grid::groups(push.pixels, abi::GROUP * abi::CLEAR_ROUNDS))
}
