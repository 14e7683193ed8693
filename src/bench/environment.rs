//! Where figures come from: without it they are worth nothing.

use super::limits::Rates;
use crate::{abi, prebuilt, vk::DeviceInfo};
use serde_json::{Value, json};
use std::fs;

/// The environment as it stands in every JSON of the benchmark.
pub fn environment(device: &DeviceInfo, rates: Rates) -> Value {
    let cpu = fs::read_to_string("/proc/cpuinfo").ok();
    let model = cpu.as_deref().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_string())
    });
    let system = fs::read_to_string("/proc/sys/kernel/osrelease").ok();
    let variable = |name: &str| std::env::var(name).ok();
    json!({
        "tilewright": env!("CARGO_PKG_VERSION"),
        "kernel_hash": kernel_hash(),
        "bin_pixels": abi::BIN_PIXELS,
        "device": {
            "name": device.name,
            "kind": device.kind.name(),
            "driver": device.driver,
            "api_version": device.api_version,
            "uuid": device.uuid,
            "vendor_id": device.ids.0,
            "device_id": device.ids.1,
            "memory_bytes": device.memory_bytes,
            "subgroup_sizes": [device.subgroup_sizes.0, device.subgroup_sizes.1],
        },
        "rates": {
            "copy_bytes_per_second": rates.copy.map(f64::round),
            "atomics_per_second": rates.atomics.map(f64::round),
        },
        "cpu": model,
        "cores": std::thread::available_parallelism().map_or(1, |cores| cores.get()),
        "system": format!("{} {}", std::env::consts::OS, system.as_deref().unwrap_or("").trim()),
        "architecture": std::env::consts::ARCH,
        "optimised": !cfg!(debug_assertions),
        "variables": {
            "LP_NUM_THREADS": variable("LP_NUM_THREADS"),
            "TILEWRIGHT_CACHE": variable("TILEWRIGHT_CACHE"),
            "TILEWRIGHT_VALIDATION": variable("TILEWRIGHT_VALIDATION"),
        },
    })
}

/// A number that changes with any of the engine's kernels (FNV-1a over their SPIR-V).
fn kernel_hash() -> String {
    let bytes =
        prebuilt::KERNELS.iter().flat_map(|words| words.iter()).flat_map(|w| w.to_le_bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    });
    format!("{hash:016x}")
}
