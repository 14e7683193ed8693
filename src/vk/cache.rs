//! Compiled pipelines on disk (see [`crate::cache`]), one file per device and driver. The checksum
//! matters here: drivers are known to crash on blobs that were cut short.

use super::{gpu::Shared, requirements::Probe};
use crate::{cache, error::Result};
use ash::vk;
use std::path::{Path, PathBuf};

/// The file for this device and driver.
pub(super) fn file(folder: &Path, probe: &Probe) -> PathBuf {
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let device = hex(&probe.vulkan11.device_uuid);
    // Changes with the driver's build, which its driver UUID does not do everywhere.
    let driver = hex(&probe.properties.pipeline_cache_uuid);
    folder.join(format!("pipelines-{device}-{driver}.bin"))
}

pub(super) fn open(gpu: &Shared, file: Option<&Path>) -> Result<vk::PipelineCache> {
    let blob = file.and_then(cache::read).unwrap_or_default();
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
    // Drivers with a disk cache of their own return a constant.
    if cache::read(file).is_none_or(|old| old != blob) {
        cache::write(file, &blob);
    }
}
