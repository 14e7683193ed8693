//! The constants that GLSL takes from Rust: the one place they come from.

use std::{collections::BTreeMap, fmt::Write as _};

#[allow(dead_code)]
#[path = "../../src/abi.rs"]
pub mod abi;

/// Name and value of every `pub const NAME: u32` of `src/abi.rs`. The values come from the compiled
/// module, so expressions are allowed.
pub fn constants() -> Result<BTreeMap<&'static str, u32>, String> {
    let known = values();
    for line in include_str!("../../src/abi.rs").lines() {
        let name = line.strip_prefix("pub const ").and_then(|rest| rest.split_once(": u32"));
        if let Some((name, _)) = name
            && !known.contains_key(name)
        {
            return Err(format!("list `{name}` of src/abi.rs in glsl/tool/constants.rs"));
        }
    }
    Ok(known)
}

/// The constants as GLSL macros.
pub fn defines(constants: &BTreeMap<&str, u32>) -> String {
    constants.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "#define {name} {value}u");
        text
    })
}

/// One assertion for each constant, so that kernels that were compiled with another value do not go
/// unnoticed.
pub fn assertions(constants: &BTreeMap<&str, u32>) -> String {
    constants.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(
            text,
            "const _: () = assert!(abi::{name} == {value}, \"{name} has changed: run `cargo spirv`\");"
        );
        text
    })
}

macro_rules! values {
    ($($name:ident)*) => { BTreeMap::from([$((stringify!($name), abi::$name)),*]) };
}

fn values() -> BTreeMap<&'static str, u32> {
    values! {
        SUBPIXEL_BITS BIN_SIZE_LOG2 BIN_PIXELS CELL_LEVELS CELL_LOG2_0 CELL_LOG2_1 CELL_LOG2_2
        CELL_LOG2_3 MAX_CELLS MAX_CELLS_TESTED SEVERAL_CELLS MAX_EXTENT_LOG2 GUARD_LOG2 MAX_CLIPPED KEY_LOG2
        MAX_FRAGMENT_KERNELS GROUP CLEAR_PIXELS VERTEX_ROUNDS PRIMITIVE_ROUNDS MAX_ATTRIBUTES MAX_VARYINGS
        QUAD WINDOW_LOG2 WINDOW_OVERLAP SPEC_LANES SPEC_READ SPEC_ATTRIBUTE
        ATTRIBUTE_COUNT_SHIFT ATTRIBUTE_PER_INSTANCE SPEC_WIDTH SPEC_COMPARE SPEC_IN_PLACE SPEC_FORMAT NONE SET_ENGINE SET_TABLE
        TABLE_BUFFERS VERTEX_RANGED VERTEX_PER_CORNER TRIANGLE_VALID TRIANGLE_FRONT TRIANGLE_CUT
        TRIANGLE_LEVEL_SHIFT TRIANGLE_EXTRA_SHIFT SPEC_DEPTH DEPTH_EARLY_TEST DEPTH_LATE
        DEPTH_EARLY FORMAT_RGBA8_UNORM FORMAT_RGBA8_SRGB FORMAT_RGBA16_FLOAT
    }
}
