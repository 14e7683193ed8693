//! Texels that are others in the rows of a target than in images and in pictures. Those of one or two bytes have a word each
//! in the rows, so that no two invocations write one word; elsewhere they lie side by side. Depths are floats in the rows.
//!
//! Reads: rows, or memory that an image was copied to. Writes: the other one. Contract and kernel: `glsl/narrow.comp`.

use crate::{
    abi::{self, Narrow},
    error::Result,
    format::Format,
    grid,
    image::texel,
    target::ClearColor,
    vk::{Buffer, Kernel, Recorder, error::no_memory},
};

/// Whether texels of `format` are others in the rows.
pub const fn is_narrow(format: Format) -> bool {
    format.texel_bytes() < 4 || format.depth_bits() != 0
}

/// The texels of a picture as rows have them.
///
/// # Errors
/// [`Error::Capacity`] without memory for them.
pub fn widened(format: Format, texels: &[u8]) -> Result<Vec<u32>> {
    let bytes = |texel: &[u8]| -> u32 {
        match *texel {
            _ if format.is_depth() => texel::decode(format, texel)[0].to_bits(),
            [low] => low.into(),
            [low, high] => u16::from_ne_bytes([low, high]).into(),
            _ => unreachable!("a narrow texel has one or two bytes"),
        }
    };
    let texels = texels.chunks_exact(format.texel_bytes());
    let mut rows = Vec::new();
    let wanted = 4 * texels.len() as u64;
    rows.try_reserve_exact(texels.len()).map_err(|_| no_memory("the rows of a picture", wanted))?;
    rows.extend(texels.map(bytes));
    Ok(rows)
}

/// Appends to `texels` those of rows, which the host has read.
pub fn append(format: Format, rows: &[u32], texels: &mut Vec<u8>) {
    let number = |word: &u32| {
        let [number, ..] = texel::encode(format, ClearColor::Float([f32::from_bits(*word); 4]));
        number
    };
    match format.texel_bytes() {
        2 if format.is_depth() => {
            texels.extend(rows.iter().flat_map(|word| (number(word) as u16).to_ne_bytes()));
        }
        4 => texels.extend(rows.iter().flat_map(|word| number(word).to_ne_bytes())),
        1 => texels.extend(rows.iter().map(|word| *word as u8)),
        _ => texels.extend(rows.iter().flat_map(|word| (*word as u16).to_ne_bytes())),
    }
}

/// Which way texels go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    ToRows,
    FromRows,
}

/// Records the way of the texels of one target: between its rows, which begin with word `first` of `rows`, and `texels`.
pub fn record(
    recorder: &mut Recorder,
    kernel: &Kernel,
    (rows, first): (&Buffer<u32>, usize),
    (format, texels): (Format, &Buffer<u32>),
    (way, pixels): (Way, usize),
) -> Result<()> {
    let (bytes, to_rows) = (format.texel_bytes() as u32, (way == Way::ToRows).into());
    let push = Narrow {
        pixels: pixels as u32,
        first: first as u32,
        texel_bytes: bytes,
        depth_bits: format.depth_bits(),
        to_rows,
    };
    let (words, lanes) = (push.pixels.div_ceil(4 / bytes), abi::GROUP * abi::CLEAR_ROUNDS);
    recorder
        .kernel(kernel)
        .bind("Rows", rows)
        .bind("Texels", texels)
        .push(&push)
        .dispatch(grid::groups(words, lanes))
}
