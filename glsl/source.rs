//! The text that a file of `glsl/` is compiled from, and a checksum that tells when it changed. The build
//! script and the tool that makes `glsl/spirv/` both include this file.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// The file of `glsl/spirv/` with the checksum of each compiled file's text.
pub const LIST: &str = "sources.txt";

/// The text of the file `name` of the folder `glsl` with its includes in place, each file once.
///
/// # Errors
/// A sentence that names the file which cannot be read.
pub fn expand(glsl: &Path, name: &str) -> Result<String, String> {
    add(glsl, name, &mut Vec::new())
}

fn add(glsl: &Path, name: &str, seen: &mut Vec<PathBuf>) -> Result<String, String> {
    let path = glsl.join(name);
    let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut all = String::new();
    for line in text.lines() {
        match line.trim().strip_prefix("#include \"").and_then(|l| l.strip_suffix('"')) {
            Some(name) => {
                let file = glsl.join(name);
                if !seen.contains(&file) {
                    seen.push(file);
                    all += &add(glsl, name, seen)?;
                }
            }
            None => {
                all += line;
                all.push('\n');
            }
        }
    }
    Ok(all)
}

/// A line of [`LIST`]: the checksum of an expanded text (64-bit FNV-1a), and the file it belongs to.
pub fn entry(name: &str, text: &str) -> String {
    let sum = text.bytes().fold(0xcbf2_9ce4_8422_2325u64, |sum, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    });
    format!("{sum:016x} {name}\n")
}
