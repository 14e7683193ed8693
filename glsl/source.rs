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
/// The first one of `read`, or a sentence that names the file and the line of an include that is none of these.
pub fn expand(
    read: &impl Fn(&str) -> Result<String, String>,
    name: &str,
) -> Result<String, String> {
    let mut text = String::new();
    add(read, name, &mut Vec::new(), &mut vec![name.into()], &mut text)?;
    Ok(text)
}

/// Files that include one another, at most.
const DEPTH: usize = 32;

fn add(
    read: &impl Fn(&str) -> Result<String, String>,
    name: &str,
    seen: &mut Vec<String>,
    open: &mut Vec<String>,
    all: &mut String,
) -> Result<(), String> {
    for (number, line) in read(name)?.lines().enumerate() {
        let fault = |text: String| Err(format!("{name} line {}: {text}", number + 1));
        let directive = line.trim().strip_prefix('#').map(str::trim_start);
        if !directive.is_some_and(|directive| directive.starts_with("include")) {
            *all += line;
            all.push('\n');
            continue;
        }
        let included = line.trim().strip_prefix("#include \"").and_then(|l| l.strip_suffix('"'));
        let Some(included) = included else {
            return fault("an include is `#include \"file\"`, and nothing else in its line".into());
        };
        if open.iter().any(|file| file == included) {
            return fault(format!("`{included}` includes itself"));
        }
        if open.len() > DEPTH {
            return fault(format!("more than {DEPTH} files include one another"));
        }
        if !seen.iter().any(|file| file == included) {
            seen.push(included.into());
            open.push(included.into());
            add(read, included, seen, open, all)?;
            open.pop();
        }
    }
    Ok(())
}

/// A line of [`LIST`]: the checksum of an expanded text (64-bit FNV-1a), and the file it belongs to.
pub fn entry(name: &str, text: &str) -> String {
    let sum = text.bytes().fold(0xcbf2_9ce4_8422_2325u64, |sum, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    });
    format!("{sum:016x} {name}\n")
}
