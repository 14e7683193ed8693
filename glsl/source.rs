//! The text that a file of `glsl/` is compiled from, and a checksum that tells when it changed. The build
//! script, the tool that makes `glsl/spirv/` and the library all include this file.

use std::{fs, path::Path};

/// The file of `glsl/spirv/` with the checksum of each compiled file's text.
pub const LIST: &str = "sources.txt";

/// Reads files of the folder `glsl`, for [`expand`].
pub fn reader(glsl: &Path) -> impl Fn(&str) -> Result<String, String> {
    move |name| {
        let path = glsl.join(name);
        fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
    }
}

/// The text of the file `name` with its includes in place, each file once. `read` gives the text of a file.
///
/// # Errors
/// The first one of `read`.
pub fn expand(
    read: &impl Fn(&str) -> Result<String, String>,
    name: &str,
) -> Result<String, String> {
    add(read, name, &mut Vec::new())
}

fn add(
    read: &impl Fn(&str) -> Result<String, String>,
    name: &str,
    seen: &mut Vec<String>,
) -> Result<String, String> {
    let mut all = String::new();
    for line in read(name)?.lines() {
        match line.trim().strip_prefix("#include \"").and_then(|l| l.strip_suffix('"')) {
            Some(name) => {
                if !seen.iter().any(|file| file == name) {
                    seen.push(name.into());
                    all += &add(read, name, seen)?;
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
