//! Reads the files that a scene file refers to, by names that may come from other systems.

use crate::{Error, Result};
use std::{
    ffi::{OsStr, OsString},
    path::{Path, PathBuf},
};

/// Larger files are refused.
const MAX_FILE: u64 = 8 << 30;

/// Longer names are not looked for: no system opens them, and walking their folders would take long.
const LONGEST_NAME: usize = 4096;

/// A name is also looked for without the folders that it begins with, down from this many parts.
const MOST_PARTS: usize = 32;

/// Reads a regular file and adds it to `files`. Devices and pipes are refused: they may have no end.
pub(super) fn read(path: &Path, files: &mut Vec<PathBuf>) -> Result<Vec<u8>> {
    let io = |e: std::io::Error| Error::input(path, format!("cannot be read: {e}"));
    let meta = std::fs::metadata(path).map_err(io)?;
    if !meta.is_file() {
        return Err(Error::input(path, "is no regular file"));
    }
    if meta.len() > MAX_FILE {
        let (gib, limit) = (meta.len() >> 30, MAX_FILE >> 30);
        return Err(Error::input(path, format!("has {gib} GiB, the limit is {limit} GiB")));
    }
    let bytes = std::fs::read(path).map_err(io)?;
    files.push(path.to_path_buf());
    Ok(bytes)
}

/// Finds the file that `name` means in `folder`: as it stands, with the separators of Windows, with
/// other upper and lower case, and if it is no UTF-8, as Latin-1. No file has a name of more than
/// [`LONGEST_NAME`] bytes.
pub(super) fn find(folder: &Path, name: impl AsRef<[u8]>) -> Option<PathBuf> {
    let name = name.as_ref();
    if name.len() > LONGEST_NAME {
        return None;
    }
    let latin1 = || name.iter().map(|&byte| char::from(byte)).collect::<String>();
    match std::str::from_utf8(name) {
        Ok(text) => find_path(folder, text.as_ref()),
        Err(_) => {
            find_path(folder, &os_name(name)).or_else(|| find_path(folder, latin1().as_ref()))
        }
    }
}

/// The name as the system has it, where names are bytes.
#[cfg(unix)]
fn os_name(bytes: &[u8]) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes.to_vec())
}

#[cfg(not(unix))]
fn os_name(bytes: &[u8]) -> OsString {
    String::from_utf8_lossy(bytes).into_owned().into()
}

fn find_path(folder: &Path, name: &OsStr) -> Option<PathBuf> {
    // A path without a folder lies in the current one.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let exact = folder.join(name);
    if exact.is_file() {
        return Some(exact);
    }
    let bytes = name.as_encoded_bytes();
    let mut at = if bytes.starts_with(b"/") { PathBuf::from("/") } else { folder.to_path_buf() };
    for part in parts(bytes).filter(|p| !p.is_empty() && *p != b".") {
        let part = os_name(part);
        let next = at.join(&part);
        if part == ".." || next.exists() {
            at = next;
            continue;
        }
        let wanted = part.to_string_lossy().to_lowercase();
        at = std::fs::read_dir(&at)
            .ok()?
            .flatten()
            .find(|entry| entry.file_name().to_string_lossy().to_lowercase() == wanted)?
            .path();
    }
    at.is_file().then_some(at)
}

fn parts(name: &[u8]) -> impl Iterator<Item = &[u8]> {
    name.split(|b| matches!(b, b'/' | b'\\'))
}

/// [`find`], or else with ever fewer of the folders that the name begins with: paths in files often are
/// those of the machine they were made on.
pub(super) fn find_by_name(folder: &Path, name: impl AsRef<[u8]>) -> Option<PathBuf> {
    tails(name.as_ref()).find_map(|tail| find(folder, tail))
}

/// The name, then its last [`MOST_PARTS`] parts or what it has of them, and ever fewer. The limit keeps
/// the work for one name in proportion to its length.
fn tails(name: &[u8]) -> impl Iterator<Item = &[u8]> {
    let is_separator = |i: &usize| matches!(name[*i], b'/' | b'\\');
    let ends: Vec<usize> = (0..name.len()).rev().filter(is_separator).take(MOST_PARTS).collect();
    let shorter = ends.into_iter().rev().map(|end| &name[end + 1..]);
    std::iter::once(name).chain(shorter).filter(|tail| !tail.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_systems_are_found() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("Textures")).unwrap();
        std::fs::write(dir.path().join("Textures/Wood.JPG"), b"x").unwrap();
        for name in ["Textures/Wood.JPG", "textures\\wood.jpg", ".\\TEXTURES/wood.jpg"] {
            assert!(find(dir.path(), name).is_some(), "{name}");
        }
        for name in
            ["C:\\Users\\me\\Textures\\Wood.jpg", "/elsewhere/textures/wood.jpg", "//wood.JPG"]
        {
            assert_eq!(find_by_name(dir.path(), name).is_some(), !name.starts_with("//"), "{name}");
        }
        std::fs::write(dir.path().join("gr\u{fc}n.png"), b"x").unwrap();
        assert!(find(dir.path(), b"gr\xfcn.png").is_some(), "Latin-1");
        assert!(find(dir.path(), b"gr\xe4n.png").is_none());
        assert!(find(dir.path(), "textures/stone.jpg").is_none());
        assert!(find(Path::new(""), "CARGO.TOML").is_some(), "tests run where Cargo.toml is");
        let mut files = Vec::new();
        assert!(read(dir.path(), &mut files).is_err() && files.is_empty());
    }

    #[test]
    fn long_names_cost_little() {
        let shown = |name: &[u8]| -> Vec<String> {
            tails(name).map(|tail| String::from_utf8_lossy(tail).into_owned()).collect()
        };
        assert_eq!(shown(b"C:\\a/b.png"), ["C:\\a/b.png", "a/b.png", "b.png"]);
        assert_eq!(shown(b"a/"), ["a/"]);
        assert!(shown(b"").is_empty());
        for name in ["../".repeat(10_000), "a\\".repeat(10_000), "/".repeat(10_000)] {
            assert!(tails(name.as_bytes()).count() <= MOST_PARTS + 1);
        }
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("Wood.jpg"), b"x").unwrap();
        let name = |parts: usize| "./".repeat(parts) + "wood.jpg";
        assert!(find(dir.path(), name(LONGEST_NAME / 2 - 4)).is_some());
        assert!(find(dir.path(), name(LONGEST_NAME / 2 - 3)).is_none());
        let tail = name(LONGEST_NAME);
        assert!(find_by_name(dir.path(), tail).is_some(), "only its tails are looked for");
    }
}
