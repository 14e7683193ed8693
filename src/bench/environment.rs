//! The machine, the device and the program that figures come from. Figures without them are worth nothing.

use super::limits::Rates;
use crate::{abi, prebuilt, vk::DeviceInfo};
use serde_json::{Value, json};
use std::{fs, time::SystemTime};

/// The environment as it stands in every JSON of the benchmark.
pub fn environment(device: &DeviceInfo, rates: Rates) -> Value {
    let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let driver_llvm = llvm(&device.name).or_else(|| llvm(&device.driver));
    let system = fs::read_to_string("/proc/sys/kernel/osrelease").ok();
    let variable = |name: &str| std::env::var(name).ok();
    json!({
        "tilewright": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TILEWRIGHT_COMMIT"),
        "date": humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
        "kernel_hash": kernel_hash(),
        "bin_pixels": abi::BIN_PIXELS,
        "device": {
            "name": device.name,
            "kind": device.kind.name(),
            "driver": device.driver,
            "llvm": driver_llvm,
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
        "cpu": field(&cpu, "model name"),
        "processor": processor(&cpu),
        "cores": std::thread::available_parallelism().map_or(1, |cores| cores.get()),
        "system": format!("{} {}", std::env::consts::OS, system.as_deref().unwrap_or("").trim()),
        "architecture": std::env::consts::ARCH,
        "optimised": !cfg!(debug_assertions),
        "variables": {
            "LP_NUM_THREADS": variable("LP_NUM_THREADS"),
            "LP_NATIVE_VECTOR_WIDTH": variable("LP_NATIVE_VECTOR_WIDTH"),
            "TILEWRIGHT_CACHE": variable("TILEWRIGHT_CACHE"),
            "TILEWRIGHT_VALIDATION": variable("TILEWRIGHT_VALIDATION"),
        },
    })
}

/// What `/proc/cpuinfo` says of the first processor under `key`.
fn field(cpuinfo: &str, key: &str) -> Option<String> {
    let mut pairs = cpuinfo.lines().filter_map(|line| line.split_once(':'));
    pairs.find(|(name, _)| name.trim() == key).map(|(_, value)| value.trim().to_string())
}

/// The processor as its maker counts it: a model's name alone may stand for several generations. On Arm,
/// the implementer, the part and its revision.
fn processor(cpuinfo: &str) -> Value {
    let governor = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor";
    json!({
        "vendor": field(cpuinfo, "vendor_id").or_else(|| field(cpuinfo, "CPU implementer")),
        "family": field(cpuinfo, "cpu family").or_else(|| field(cpuinfo, "CPU architecture")),
        "model": field(cpuinfo, "model").or_else(|| field(cpuinfo, "CPU part")),
        "stepping": field(cpuinfo, "stepping").or_else(|| field(cpuinfo, "CPU revision")),
        "microcode": field(cpuinfo, "microcode"),
        "cores_of_a_package": field(cpuinfo, "cpu cores"),
        "threads_of_a_package": field(cpuinfo, "siblings"),
        "governor": fs::read_to_string(governor).ok().map(|text| text.trim().to_string()),
    })
}

/// The version of LLVM in the name of a driver that compiles with it.
fn llvm(name: &str) -> Option<&str> {
    let version = name.split_once("LLVM ")?.1;
    version.split(|c: char| !c.is_ascii_digit() && c != '.').next().filter(|v| !v.is_empty())
}

/// A number that changes with any of the engine's kernels (FNV-1a over their SPIR-V).
fn kernel_hash() -> String {
    let bytes = prebuilt::KERNELS
        .iter()
        .flat_map(|(_, _, words)| words.iter())
        .flat_map(|w| w.to_le_bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    });
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processors_of_two_makers_are_named() {
        let x86 = "processor\t: 0\nvendor_id\t: AuthenticAMD\ncpu family\t: 25\nmodel\t\t: 1\n\
                   model name\t: AMD EPYC\nstepping\t: 1\ncpu cores\t: 2\n\nprocessor\t: 1\n\
                   vendor_id\t: other\n";
        assert_eq!(field(x86, "model name").as_deref(), Some("AMD EPYC"));
        let found = processor(x86);
        for (key, value) in
            [("vendor", "AuthenticAMD"), ("family", "25"), ("model", "1"), ("stepping", "1")]
        {
            assert_eq!(found[key], value, "{key}");
        }
        let arm = "processor\t: 0\nCPU implementer\t: 0x41\nCPU part\t: 0xd0c\nCPU revision\t: 1\n";
        assert_eq!(
            (&processor(arm)["vendor"], &processor(arm)["model"]),
            (&"0x41".into(), &"0xd0c".into())
        );
        assert_eq!(processor("")["vendor"], Value::Null);
    }

    #[test]
    fn the_compiler_of_a_driver_is_found_in_its_name() {
        assert_eq!(llvm("llvmpipe (LLVM 15.0.6, 256 bits)"), Some("15.0.6"));
        assert_eq!(llvm("Mesa 25.0.7 (LLVM 19.1.7)"), Some("19.1.7"));
        assert_eq!(llvm("SwiftShader Device (LLVM 10.0.0)"), Some("10.0.0"));
        assert_eq!(llvm("NVIDIA H100"), None);
    }
}
