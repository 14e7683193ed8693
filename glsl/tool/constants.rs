//! The macros that GLSL takes from Rust: constants, numbers of enums and the order of a bin's pixels.
//! The names and the numbers are those of `src/`; nothing is listed here twice.

#[macro_use]
#[path = "../../src/setters.rs"]
mod setters;
#[macro_use]
#[path = "../../src/shared.rs"]
mod shared;
#[allow(dead_code)]
#[path = "../../src/abi.rs"]
pub mod abi;
#[allow(dead_code)]
#[path = "../../src/format.rs"]
mod format;
#[allow(dead_code)]
// The library shows these names to the world, and they are judged there.
#[allow(clippy::enum_variant_names)]
#[path = "../../src/state.rs"]
mod state;
#[allow(dead_code)]
#[path = "../../src/stencil.rs"]
mod stencil;
#[allow(dead_code)]
#[path = "../../src/topology.rs"]
mod topology;

use std::fmt::Write as _;

/// The modules that share constants with GLSL, with the name and the number of each constant.
fn shared() -> [(&'static str, &'static [(&'static str, u32)]); 15] {
    [
        ("abi", abi::CONSTANTS),
        ("format", format::Numeric::NUMBERS),
        ("format", format::Packing::NUMBERS),
        ("format", format::Format::NUMBERS),
        ("state", state::Topology::NUMBERS),
        ("state", state::PrimitiveKind::NUMBERS),
        ("state", state::LineMode::NUMBERS),
        ("state", state::Cull::NUMBERS),
        ("state", state::FrontFace::NUMBERS),
        ("state", state::Compare::NUMBERS),
        ("state", state::BlendFactor::NUMBERS),
        ("state", state::BlendOp::NUMBERS),
        ("state", state::LogicOp::NUMBERS),
        ("state", state::ResolveMode::NUMBERS),
        ("stencil", stencil::StencilOp::NUMBERS),
    ]
}

/// The macros that every kernel is compiled with.
pub fn defines() -> String {
    let mut text = String::new();
    for (name, value) in shared().into_iter().flat_map(|(_, names)| names) {
        let _ = writeln!(text, "#define {} {value}u", macro_name(name));
    }
    text + &pixel_order(abi::PIXEL_COLUMN_BITS, abi::BIN_PIXELS)
}

/// One assertion for each number, so that kernels that were compiled with another one do not go unnoticed.
pub fn assertions() -> String {
    let mut text = String::new();
    for (module, names) in shared() {
        for (name, value) in names {
            let number = if name.contains("::") { " as u32" } else { "" };
            let _ = writeln!(
                text,
                "const _: () = assert!({module}::{name}{number} == {value}, \"{name} has changed: run `cargo spirv`\");"
            );
        }
    }
    text
}

/// The macro of a constant or of an enum's variant: `BLEND_FACTOR_SRC_ALPHA` for `BlendFactor::SrcAlpha`.
pub fn macro_name(name: &str) -> String {
    let mut text = String::new();
    let mut before = '_';
    for c in name.replace("::", "_").chars() {
        // A word begins with a capital that no other capital precedes: `U8Norm` has two words, `BIN_PIXELS` too.
        if c.is_ascii_uppercase() && (before.is_ascii_lowercase() || before.is_ascii_digit()) {
            text.push('_');
        }
        text.push(c.to_ascii_uppercase());
        before = c;
    }
    text
}

/// Macros from a pixel's number in its bin to its column and row, and back.
fn pixel_order(column_bits: u32, pixels: u32) -> String {
    let row_bits = (pixels - 1) & !column_bits;
    let [(column, back_x), (row, back_y)] = [column_bits, row_bits].map(|bits| {
        // Neighbouring bits move together: where the run begins in the number, and where in the coordinate.
        let (mut gathered, mut scattered) = (Vec::new(), Vec::new());
        let (mut left, mut to) = (bits, 0);
        while left != 0 {
            let from = left.trailing_zeros();
            let length = (left >> from).trailing_ones();
            let (mask, shift) = (((1 << length) - 1) << to, from - to);
            gathered.push(format!("((i) >> {shift} & {mask}u)"));
            scattered.push(format!("((x) & {mask}u) << {shift}"));
            left &= !(((1 << length) - 1) << from);
            to += length;
        }
        (gathered.join(" | "), scattered.join(" | "))
    });
    let back_y = back_y.replace("(x)", "(y)");
    format!(
        "#define PIXEL_COLUMN(i) ({column})\n#define PIXEL_ROW(i) ({row})\n\
         #define PIXEL_NUMBER(x, y) ({back_x} | {back_y})\n"
    )
}
