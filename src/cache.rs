//! A cache on disk for results that are slow to make: compiled shaders and pipelines.
//!
//! One file per result, in the folder that the caller names. The folder may be deleted at any time. A file is replaced as a whole and carries
//! a checksum, since a run may be killed and a disk may be full. A file that cannot be read or written is
//! treated as missing: a cache never fails a run.
//!
//! Spliced kernels are not kept: splicing takes less than a millisecond, about as long as reading and
//! checking a file.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

const MAGIC: &[u8; 8] = b"TWCACHE1";
/// Bytes before the content: magic and checksum.
const HEADER_BYTES: usize = 16;

/// `tilewright` in the user's cache folder (`XDG_CACHE_HOME` or `~/.cache`); `None` if there is no such folder, or if the
/// variable `TILEWRIGHT_CACHE` is `off`. The library keeps no file there unless it is told to: see
/// [`crate::vk::GpuOptions::cache`] and [`crate::shader::keep_compiled`].
pub fn cache_folder() -> Option<PathBuf> {
    if std::env::var_os("TILEWRIGHT_CACHE").is_some_and(|v| v == "off") {
        return None;
    }
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let base = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
    Some(base.join("tilewright"))
}

/// The content of a file that [`write`] wrote.
pub(crate) fn read(file: &Path) -> Option<Vec<u8>> {
    unwrap(std::fs::read(file).ok()?)
}

/// Replaces a file.
pub(crate) fn write(file: &Path, content: &[u8]) {
    if let Err(e) = replace(file, &wrap(content)) {
        log::debug!("{}: {e}", file.display());
    }
}

/// FNV-1a, for file names and to detect broken files. A key is compared in full, not by its hash.
pub(crate) fn checksum<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> u64 {
    parts
        .into_iter()
        .flatten()
        .fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

fn replace(file: &Path, content: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut new = tempfile::NamedTempFile::new_in(folder)?;
    new.write_all(content)?;
    new.persist(file).map_err(|e| e.error)?;
    Ok(())
}

fn wrap(content: &[u8]) -> Vec<u8> {
    let mut whole = Vec::with_capacity(HEADER_BYTES + content.len());
    whole.extend_from_slice(MAGIC);
    whole.extend_from_slice(&checksum([content]).to_le_bytes());
    whole.extend_from_slice(content);
    whole
}

fn unwrap(whole: Vec<u8>) -> Option<Vec<u8>> {
    let content = whole.get(HEADER_BYTES..)?;
    let good = &whole[..8] == MAGIC && whole[8..16] == checksum([content]).to_le_bytes();
    good.then(|| content.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_wrapped_is_unwrapped_and_anything_else_is_refused() {
        let content = wrap(b"a blob");
        assert_eq!(unwrap(content.clone()).as_deref(), Some(&b"a blob"[..]));
        for i in 0..content.len() {
            let mut broken = content.clone();
            broken[i] ^= 1;
            assert_eq!(unwrap(broken), None, "byte {i}");
            assert_eq!(unwrap(content[..i].to_vec()), None, "cut at {i}");
        }
    }

    #[test]
    fn a_file_is_replaced_as_a_whole_and_a_broken_one_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/cache.bin");
        assert_eq!(read(&file), None);
        write(&file, b"one");
        write(&file, b"two");
        assert_eq!(read(&file).as_deref(), Some(&b"two"[..]));
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 1);
        std::fs::write(&file, b"TWCACHE1 and then nonsense").unwrap();
        assert_eq!(read(&file), None);
        // A folder where the file should be: nothing happens.
        write(file.parent().unwrap(), b"three");
    }
}
