//! The SPIR-V that the library contains: the engine's kernels, the scenes' shaders, the benchmark's, the id
//! shader. `cargo spirv` makes the files of `glsl/spirv/` from the GLSL beside them; `glsl/build.rs` explains
//! how the two are kept in step.

// Whether constants and structs of `abi` are those that the kernels were compiled with.
#[rustfmt::skip]
#[path = "../glsl/spirv/layout.rs"]
mod layout;
#[rustfmt::skip]
#[path = "../glsl/spirv/files.rs"]
mod files;

use crate::{abi::MAX_COLORS, shader::Variant};
pub use files::FILES;

/// The words of a file of `glsl/spirv/`.
macro_rules! file {
    ($name:literal) => {{
        const BYTES: &[u8] = include_bytes!(concat!("../glsl/spirv/", $name, ".spv"));
        const WORDS: [u32; BYTES.len() / 4] = words(BYTES);
        &WORDS
    }};
}

const fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    let (chunks, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty(), "a SPIR-V file is words");
    let mut words = [0; N];
    let mut at = 0;
    while at < N {
        words[at] = u32::from_le_bytes(chunks[at]);
        at += 1;
    }
    words
}

/// `vertex.comp`.
pub const VERTEX: &[u32] = file!("vertex.comp");
/// `shade.comp`.
pub const SHADE: &[u32] = file!("shade.comp");
/// `ordered.comp`.
pub const ORDERED: &[u32] = file!("ordered.comp");

/// All kernels: the name of the GLSL file, what it is compiled for, the words.
pub const KERNELS: &[(&str, Variant, &[u32])] = &[
    ("binning_scan.comp", Variant::PLAIN, file!("binning_scan.comp")),
    ("binning_scatter.comp", Variant::PLAIN, file!("binning_scatter.comp")),
    ("binning_sort.comp", Variant::PLAIN, file!("binning_sort.comp")),
    ("clear.comp", Variant::PLAIN, file!("clear.comp")),
    ("commands.comp", Variant::PLAIN, file!("commands.comp")),
    ("narrow.comp", Variant::PLAIN, file!("narrow.comp")),
    ("ordered.comp", Variant::PLAIN, ORDERED),
    ("ordered.comp", SEVERAL, file!("8-ordered.comp")),
    ("ordered.comp", ANY_ONE, file!("any-ordered.comp")),
    ("ordered.comp", ANY_SEVERAL, file!("any-8-ordered.comp")),
    ("primitive.comp", Variant::PLAIN, file!("primitive.comp")),
    ("primitive.comp", WITH_DISTANCES, file!("distances-primitive.comp")),
    ("raster.comp", Variant::PLAIN, file!("raster.comp")),
    ("resolve.comp", Variant::PLAIN, file!("resolve.comp")),
    ("resolve.comp", ANY_ONE, file!("any-resolve.comp")),
    ("shade.comp", Variant::PLAIN, SHADE),
    ("shade.comp", SEVERAL, file!("8-shade.comp")),
    ("shade.comp", ANY_ONE, file!("any-shade.comp")),
    ("shade.comp", ANY_SEVERAL, file!("any-8-shade.comp")),
    ("vertex.comp", Variant::PLAIN, VERTEX),
    ("vertex.comp", ANY_ONE, file!("any-vertex.comp")),
];

const SEVERAL: Variant = Variant { colors: MAX_COLORS, ..Variant::PLAIN };
const ANY_ONE: Variant = Variant { any_format: true, ..Variant::PLAIN };
const ANY_SEVERAL: Variant = Variant { colors: MAX_COLORS, ..ANY_ONE };
const WITH_DISTANCES: Variant = Variant { distances: true, ..Variant::PLAIN };

/// The macros that every kernel is compiled with.
pub const DEFINES: &str = include_str!("../glsl/spirv/defines.glsl");

/// The scenes' shader pair, and its fragment shader with `ALPHA_MASK`.
#[cfg(feature = "scene")]
pub mod scene {
    use super::words;

    pub const VERTEX: &[u32] = file!("material.vert");
    pub const FRAGMENT: &[u32] = file!("material.frag");
    pub const MASK_FRAGMENT: &[u32] = file!("material-mask.frag");
}

/// The fragment shader of id passes. The offset of its push constant is to be set.
pub const ID: &[u32] = file!("id.frag");

/// The benchmark's shaders.
#[cfg(feature = "scene")]
pub mod bench {
    use super::words;

    /// The vertex shader, with so many further varyings.
    pub const VERTEX: [(u32, &[u32]); 4] = [
        (0, file!("surface-0.vert")),
        (4, file!("surface-4.vert")),
        (8, file!("surface-8.vert")),
        (12, file!("surface-12.vert")),
    ];
    /// The fragment shader, with so many further varyings.
    pub const FRAGMENT: [(u32, &[u32]); 4] = [
        (0, file!("surface-0.frag")),
        (4, file!("surface-4.frag")),
        (8, file!("surface-8.frag")),
        (12, file!("surface-12.frag")),
    ];
    /// The fragment shader that writes several targets, with so many further varyings.
    pub const SEVERAL_FRAGMENT: [(u32, &[u32]); 4] = [
        (0, file!("surface-0-several.frag")),
        (4, file!("surface-4-several.frag")),
        (8, file!("surface-8-several.frag")),
        (12, file!("surface-12-several.frag")),
    ];
    /// `bench/copy.comp`.
    pub const COPY: &[u32] = file!("copy.comp");
    /// `bench/atomic.comp`.
    pub const ATOMIC: &[u32] = file!("atomic.comp");
}
