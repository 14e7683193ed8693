//! Compiled pipelines on disk, one file per device and driver.
//!
//! The file is the driver's own blob behind a small header with a checksum: drivers are known to
//! crash on blobs that were cut short. It is replaced atomically, and one that cannot be read is
//! ignored: a cache never fails a run.

use super::{gpu::Shared, requirements::Probe};
use crate::error::Result;
use ash::vk;
use std::{
    io::Write,
    path::{Path, PathBuf},
};

const MAGIC: &[u8; 8] = b"TWPIPE01";
/// Bytes before the driver's blob: magic and checksum.
const HEADER_BYTES: usize = 16;

/// `tilewright` in the user's cache folder.
pub(super) fn default_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let base = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
    Some(base.join("tilewright"))
}

/// The file for this device and driver.
pub(super) fn file(folder: &Path, probe: &Probe) -> PathBuf {
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let device = hex(&probe.vulkan11.device_uuid);
    // Changes with the driver's build, which its driver UUID does not do everywhere.
    let driver = hex(&probe.properties.pipeline_cache_uuid);
    folder.join(format!("pipelines-{device}-{driver}.bin"))
}

pub(super) fn open(gpu: &Shared, file: Option<&Path>) -> Result<vk::PipelineCache> {
    let blob = file.and_then(|f| std::fs::read(f).ok()).and_then(unwrap).unwrap_or_default();
    let info = vk::PipelineCacheCreateInfo::default().initial_data(&blob);
    // SAFETY: the blob is the driver's own, whole, and for the same device and driver.
    unsafe { gpu.device.create_pipeline_cache(&info, None) }
        .map_err(|e| gpu.failure("creating the pipeline cache", e))
}

pub(super) fn save(gpu: &Shared, file: Option<&Path>) {
    let Some(file) = file.filter(|_| gpu.pipeline_cache != vk::PipelineCache::null()) else {
        return;
    };
    // SAFETY: the cache belongs to this device.
    let Ok(blob) = (unsafe { gpu.device.get_pipeline_cache_data(gpu.pipeline_cache) }) else {
        return;
    };
    let content = wrap(&blob);
    // Drivers with a disk cache of their own return a constant.
    if std::fs::read(file).is_ok_and(|old| old == content) {
        return;
    }
    if let Err(e) = replace(file, &content) {
        log::debug!("{}: {e}", file.display());
    }
}

fn replace(file: &Path, content: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut new = tempfile::NamedTempFile::new_in(folder)?;
    new.write_all(content)?;
    new.persist(file).map_err(|e| e.error)?;
    Ok(())
}

fn wrap(blob: &[u8]) -> Vec<u8> {
    let mut content = Vec::with_capacity(HEADER_BYTES + blob.len());
    content.extend_from_slice(MAGIC);
    content.extend_from_slice(&checksum(blob).to_le_bytes());
    content.extend_from_slice(blob);
    content
}

fn unwrap(content: Vec<u8>) -> Option<Vec<u8>> {
    let blob = content.get(HEADER_BYTES..)?;
    let whole = &content[..8] == MAGIC && content[8..16] == checksum(blob).to_le_bytes();
    whole.then(|| blob.to_vec())
}

/// FNV-1a.
fn checksum(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
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
    fn a_file_is_replaced_as_a_whole() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/cache.bin");
        replace(&file, b"one").unwrap();
        replace(&file, b"two").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 1);
    }
}
