//! Reading what a scene file refers to, as files from other systems name it.

use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Larger files are refused.
const MAX_FILE: u64 = 8 << 30;

/// Reads a regular file. Devices and pipes are refused: they may have no end.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    let io = |e: std::io::Error| Error::input(path, format!("cannot be read: {e}"));
    let meta = std::fs::metadata(path).map_err(io)?;
    if !meta.is_file() {
        return Err(Error::input(path, "is no regular file"));
    }
    if meta.len() > MAX_FILE {
        let (gib, limit) = (meta.len() >> 30, MAX_FILE >> 30);
        return Err(Error::input(path, format!("has {gib} GiB, the limit is {limit} GiB")));
    }
    std::fs::read(path).map_err(io)
}

/// Finds the file that `name` means in `folder`: as it stands, with the separators of Windows, and
/// with other upper and lower case.
pub(super) fn find(folder: &Path, name: &str) -> Option<PathBuf> {
    let exact = folder.join(name);
    if exact.is_file() {
        return Some(exact);
    }
    let mut at = if name.starts_with('/') { PathBuf::from("/") } else { folder.to_path_buf() };
    for part in name.split(['/', '\\']).filter(|p| !p.is_empty() && *p != ".") {
        let next = at.join(part);
        if part == ".." || next.exists() {
            at = next;
            continue;
        }
        let wanted = part.to_lowercase();
        at = std::fs::read_dir(&at)
            .ok()?
            .flatten()
            .find(|entry| entry.file_name().to_string_lossy().to_lowercase() == wanted)?
            .path();
    }
    at.is_file().then_some(at)
}

/// [`find`], or else the file of that name beside the scene: paths in files often are those of the
/// machine they were made on.
pub(super) fn find_by_name(folder: &Path, name: &str) -> Option<PathBuf> {
    let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
    find(folder, name).or_else(|| find(folder, last))
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
        assert!(find(dir.path(), "textures/stone.jpg").is_none());
        assert!(read(dir.path()).is_err());
    }
}
