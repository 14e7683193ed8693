//! Listing devices and picking one; never silently the wrong one.

use super::{
    instance::Instance,
    requirements::{Missing, OPTIONAL, Probe},
};
use crate::error::{Error, Result};
use ash::vk;

/// The environment's twin of the device selector.
pub(super) const DEVICE_VARIABLE: &str = "TILEWRIGHT_DEVICE";

/// What kind of device it is, in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the host's memory.
    Integrated,
    /// A GPU seen through a virtual machine.
    Virtual,
    /// The host's processor.
    Cpu,
    /// None of these.
    Other,
}

impl DeviceKind {
    /// The name that `tilewright devices` prints.
    pub const fn name(self) -> &'static str {
        match self {
            DeviceKind::Discrete => "discrete",
            DeviceKind::Integrated => "integrated",
            DeviceKind::Virtual => "virtual",
            DeviceKind::Cpu => "cpu",
            DeviceKind::Other => "other",
        }
    }

    /// Whether it is a GPU, for [`Require::Gpu`].
    pub const fn is_gpu(self) -> bool {
        matches!(self, DeviceKind::Discrete | DeviceKind::Integrated | DeviceKind::Virtual)
    }
}

/// Which kind of device is acceptable. There is no fall-back to another kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Require {
    /// Any.
    #[default]
    Any,
    /// Only a GPU.
    Gpu,
    /// Only a driver that runs on the host's processor.
    Cpu,
}

/// One queue family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct QueueInfo {
    /// Queues of the family.
    pub count: u32,
    /// Whether it computes.
    pub compute: bool,
    /// Whether it draws.
    pub graphics: bool,
    /// Meaningful bits of a timestamp, 0 if there are none.
    pub timestamp_bits: u32,
}

/// A device as listed by [`devices`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// Its number in the loader's order, which `--device` takes.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// `deviceUUID` as 32 hexadecimal digits.
    pub uuid: String,
    /// What kind it is.
    pub kind: DeviceKind,
    /// Highest Vulkan version, as `1.3.280`.
    pub api_version: String,
    /// The driver's name and version as it describes itself.
    pub driver: String,
    /// PCI vendor and device ids.
    pub ids: (u32, u32),
    /// Bytes of device-local memory in all heaps.
    pub memory_bytes: u64,
    /// Smallest and largest subgroup size.
    pub subgroup_sizes: (u32, u32),
    /// Its queue families.
    pub queues: Vec<QueueInfo>,
    /// Requirements that it does not meet; empty for a device that can be used.
    pub missing: Vec<Missing>,
    /// Which of [`OPTIONAL`] it offers, by name.
    pub optional: Vec<&'static str>,
}

impl std::fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}, {})", self.name, self.kind.name(), self.driver)
    }
}

/// A physical device with all that was read from it.
pub(super) struct Candidate {
    pub raw: vk::PhysicalDevice,
    pub probe: Probe,
    pub info: DeviceInfo,
}

/// All devices of all drivers, in the loader's order.
///
/// # Errors
/// [`Error::Device`] without a loader or driver, with what to install.
pub fn devices() -> Result<Vec<DeviceInfo>> {
    let instance = Instance::new(false)?;
    Ok(candidates(&instance)?.into_iter().map(|c| c.info).collect())
}

pub(super) fn candidates(instance: &Instance) -> Result<Vec<Candidate>> {
    // SAFETY: the instance is alive.
    let physical = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(|e| Error::Device(format!("the Vulkan devices could not be listed: {e}")))?;
    Ok(physical
        .into_iter()
        .enumerate()
        .map(|(index, raw)| {
            let probe = Probe::read(&instance.raw, raw);
            Candidate { raw, info: describe(index, &probe), probe }
        })
        .collect())
}

/// Picks the device that `selector` names, or the best one that meets all requirements.
pub(super) fn pick(
    instance: &Instance,
    selector: Option<&str>,
    require: Require,
) -> Result<Candidate> {
    let mut all = candidates(instance)?;
    if all.is_empty() {
        return Err(Error::Device(
            "no Vulkan device was found (Debian, Ubuntu: apt install mesa-vulkan-drivers gives a \
             CPU driver that works everywhere)"
                .into(),
        ));
    }
    let list = list_of(&all);
    if let Some(selector) = selector {
        all.retain(|c| matches(selector, &c.info));
        if all.is_empty() {
            return Err(Error::Device(format!(
                "no device is called `{selector}` (an index, a UUID or a pattern of its name); \
                 there are: {list}"
            )));
        }
    }
    all.retain(|c| match require {
        Require::Any => true,
        Require::Gpu => c.info.kind.is_gpu(),
        Require::Cpu => c.info.kind == DeviceKind::Cpu,
    });
    if all.is_empty() {
        let wanted = if require == Require::Gpu { "a GPU" } else { "a CPU driver" };
        return Err(Error::Device(format!("{wanted} is required; there are: {list}")));
    }
    // Stable: among equals, which offer as much, the loader's order stands.
    let offers = |c: &Candidate| std::cmp::Reverse(c.info.optional.len());
    all.sort_by_key(|c| (!c.info.missing.is_empty(), c.info.kind, offers(c)));
    let best = all.swap_remove(0);
    check(&best.info, false)?;
    Ok(best)
}

/// Refuses a device that does not meet all requirements, by what it offers or, if it was `opened`, by what is enabled.
pub(super) fn check(info: &DeviceInfo, opened: bool) -> Result<()> {
    if info.missing.is_empty() {
        return Ok(());
    }
    let faults = info.missing.iter().map(|m| format!("{} ({}): it {}", m.name, m.why, m.found));
    let faults = faults.collect::<Vec<_>>().join("; ");
    Err(Error::Device(match opened {
        true => format!(
            "{info} cannot be used, it was opened without {faults}; add what is missing to the \
             `VkDeviceCreateInfo`, as `vk::Enable` does"
        ),
        false => format!(
            "{info} cannot be used, it lacks {faults}; choose another device (`tilewright devices` \
             lists them) or install a newer driver"
        ),
    }))
}

fn list_of(all: &[Candidate]) -> String {
    all.iter().map(|c| format!("{}: {}", c.info.index, c.info)).collect::<Vec<_>>().join(", ")
}

/// Whether `selector` (index, UUID or name pattern) means this device.
fn matches(selector: &str, info: &DeviceInfo) -> bool {
    let selector = selector.trim();
    if let Ok(index) = selector.parse::<usize>()
        && selector.len() < 32
    {
        return index == info.index;
    }
    let hex: String = selector.chars().filter(|c| *c != '-').collect();
    if hex.len() == 32 && hex.chars().all(|c| c.is_ascii_hexdigit()) {
        return hex.eq_ignore_ascii_case(&info.uuid);
    }
    let (pattern, name) = (selector.to_lowercase(), info.name.to_lowercase());
    if pattern.contains(['*', '?']) {
        glob(pattern.as_bytes(), name.as_bytes())
    } else {
        name.contains(&pattern)
    }
}

/// `*` is any run of bytes, `?` any one byte.
fn glob(pattern: &[u8], text: &[u8]) -> bool {
    let (mut p, mut t) = (0, 0);
    // Where to resume after the latest star: one byte later than last time.
    let mut retry = None;
    while t < text.len() {
        if p < pattern.len() && pattern[p] == b'*' {
            retry = Some((p + 1, t));
            p += 1;
        } else if p < pattern.len() && (pattern[p] == b'?' || pattern[p] == text[t]) {
            (p, t) = (p + 1, t + 1);
        } else if let Some((star, from)) = retry {
            retry = Some((star, from + 1));
            (p, t) = (star, from + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|&c| c == b'*')
}

pub(super) fn describe(index: usize, probe: &Probe) -> DeviceInfo {
    let p = &probe.properties;
    let version = p.api_version;
    let text = |s: std::result::Result<&std::ffi::CStr, _>| match s {
        Ok(s) => s.to_string_lossy().into_owned(),
        Err(std::ffi::FromBytesUntilNulError { .. }) => String::new(),
    };
    let driver_name = text(probe.vulkan12.driver_name_as_c_str());
    let driver_info = text(probe.vulkan12.driver_info_as_c_str());
    let local = vk::MemoryHeapFlags::DEVICE_LOCAL;
    DeviceInfo {
        index,
        name: text(p.device_name_as_c_str()),
        uuid: probe.vulkan11.device_uuid.iter().map(|b| format!("{b:02x}")).collect(),
        kind: match p.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        api_version: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        driver: match (driver_name.is_empty(), driver_info.is_empty()) {
            (true, _) => format!("driver version {}", p.driver_version),
            (false, true) => format!("{driver_name} {}", p.driver_version),
            (false, false) => format!("{driver_name} {driver_info}"),
        },
        ids: (p.vendor_id, p.device_id),
        memory_bytes: probe
            .memory
            .memory_heaps_as_slice()
            .iter()
            .filter(|h| h.flags.contains(local))
            .map(|h| h.size)
            .sum(),
        subgroup_sizes: (probe.vulkan13.min_subgroup_size, probe.vulkan13.max_subgroup_size),
        queues: probe
            .queues
            .iter()
            .map(|q| QueueInfo {
                count: q.queue_count,
                compute: q.queue_flags.contains(vk::QueueFlags::COMPUTE),
                graphics: q.queue_flags.contains(vk::QueueFlags::GRAPHICS),
                timestamp_bits: q.timestamp_valid_bits,
            })
            .collect(),
        missing: probe.missing(),
        optional: OPTIONAL.iter().filter(|o| o.present(probe)).map(|o| o.name).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn globs_match_as_in_a_shell() {
        for (pattern, text, expected) in [
            ("*", "", true),
            ("llvm*", "llvmpipe (LLVM 15)", true),
            ("*shader*", "swiftshader device", true),
            ("a?c", "abc", true),
            ("a?c", "ac", false),
            ("*a*b", "xaxxbxab", true),
            ("*a*b", "xaxxbxa", false),
            ("abc", "abcd", false),
        ] {
            assert_eq!(glob(pattern.as_bytes(), text.as_bytes()), expected, "{pattern} {text}");
        }
    }

    #[test]
    fn selectors_are_index_uuid_or_name() {
        let mut info = describe(3, &Probe::default());
        info.name = "llvmpipe (LLVM 15.0.6, 256 bits)".into();
        info.uuid = "00112233445566778899aabbccddeeff".into();
        for selector in [
            "3",
            "llvmpipe",
            "LLVM*bits)",
            "00112233-4455-6677-8899-AABBCCDDEEFF",
            "00112233445566778899aabbccddeeff",
        ] {
            assert!(matches(selector, &info), "{selector}");
        }
        for selector in ["0", "nvidia", "llvmpip?", "10112233445566778899aabbccddeeff"] {
            assert!(!matches(selector, &info), "{selector}");
        }
    }
}
