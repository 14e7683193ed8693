//! Whether `glsl/spirv/` is older than the GLSL it was made from.
//!
//! The SPIR-V of `glsl/` is part of the repository, so that no build waits for a GLSL compiler. Beside it
//! is a checksum of each text that it was compiled from; this file compares it. The compiler itself compares the
//! constants and structs that the kernels take from `src/abi.rs` (`glsl/spirv/layout.rs`). The tests of
//! `glsl/tool` check that compiling the GLSL gives these very files.

use super::source;
use std::{fs, path::Path};

/// # Errors
/// A sentence that names the changed files and the command to run.
pub fn check() -> Result<(), String> {
    let glsl = Path::new("glsl");
    let list = fs::read_to_string(glsl.join("spirv").join(source::LIST)).unwrap_or_default();
    let changed: Vec<&str> = list
        .lines()
        .filter_map(|line| Some((line, line.split_once(' ')?.1)))
        .filter(|(line, name)| {
            let text = source::expand(&source::reader(glsl), name);
            !text.is_ok_and(|text| source::entry(name, &text).trim_end() == *line)
        })
        .map(|(_, name)| name)
        .collect();
    if changed.is_empty() {
        return Ok(());
    }
    Err(format!(
        "glsl/spirv/ is out of date: the text of {} has changed. Run `cargo spirv`, which compiles it.",
        changed.join(", ")
    ))
}
