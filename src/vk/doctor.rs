//! The state of Vulkan on this machine, its faults and their exact fixes: the data behind `tilewright doctor`.

use super::{
    device::{self, DeviceInfo},
    drivers::{self, DriverFile},
    instance::{Instance, VALIDATION_LAYER, loader},
};
use ash::vk;
use std::path::Path;

/// The state of Vulkan on this machine.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Doctor {
    /// The loader's version, or why there is none.
    pub loader: std::result::Result<String, String>,
    /// Driver files (ICD manifests) in the order in which the loader looks for them.
    pub drivers: Vec<DriverFile>,
    /// Whether the validation layer is installed, which tests need.
    pub validation_layer: bool,
    /// Variables that change which drivers are seen, where set.
    pub environment: Vec<(String, String)>,
    /// Devices of all drivers.
    pub devices: Vec<DeviceInfo>,
    /// The faults, the worst first; empty if there are none.
    pub findings: Vec<Finding>,
}

/// How bad a [`Finding`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Severity {
    /// Nothing can be rendered.
    Error,
    /// Something does not work, rendering does.
    Warning,
}

/// Something that is wrong, with its fix.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// The fault, as a sentence.
    pub problem: String,
    /// What to do, where it is known: usually a command.
    pub fix: String,
}

const INSTALL_LOADER: &str = "Debian, Ubuntu: apt install libvulkan1 mesa-vulkan-drivers";
pub(super) const INSTALL_DRIVER: &str =
    "Debian, Ubuntu: apt install mesa-vulkan-drivers (on Debian 12: from bookworm-backports)";
const INSTALL_LAYER: &str = "Debian, Ubuntu: apt install vulkan-validationlayers";

/// Variables that the loader obeys when it looks for drivers and layers, and ours.
const VARIABLES: [&str; 8] = [
    "VK_DRIVER_FILES",
    "VK_ICD_FILENAMES",
    "VK_ADD_DRIVER_FILES",
    "VK_LOADER_DRIVERS_SELECT",
    "VK_LOADER_DRIVERS_DISABLE",
    "VK_LAYER_PATH",
    "VK_INSTANCE_LAYERS",
    device::DEVICE_VARIABLE,
];

/// Examines this machine. It never fails: faults are part of the answer.
pub fn doctor() -> Doctor {
    let environment: Vec<_> =
        VARIABLES.iter().filter_map(|v| Some((v.to_string(), std::env::var(v).ok()?))).collect();
    let variable = |name: &str| std::env::var_os(name);
    let drivers = drivers::examine_all(variable);
    let loader = loader().map_err(|e| e.to_string());
    let mut findings = Vec::new();
    let mut error = |problem: String, fix: &str| {
        findings.push(Finding { severity: Severity::Error, problem, fix: fix.into() });
    };
    let mut devices = Vec::new();
    let mut validation_layer = false;
    match &loader {
        Err(e) => error(e.clone(), INSTALL_LOADER),
        Ok(entry) => {
            // SAFETY: a query without preconditions.
            let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
            validation_layer =
                layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER));
            match Instance::new(false).and_then(|i| device::candidates(&i)) {
                Ok(candidates) => devices = candidates.into_iter().map(|c| c.info).collect(),
                Err(e) => {
                    // What other verbs say of it ends with the fix, which has its own place here.
                    let (said, fix) = (e.to_string(), drivers::fix_of_none(variable));
                    let problem = said.split_once(&format!("; {fix}")).map(|(problem, _)| problem);
                    error(problem.unwrap_or(&said).into(), &fix);
                }
            }
            if !devices.is_empty() && devices.iter().all(|d| !d.missing.is_empty()) {
                error("no device meets all requirements".into(), INSTALL_DRIVER);
            }
        }
    }
    let mut warn = |problem: String, fix: &str| {
        findings.push(Finding { severity: Severity::Warning, problem, fix: fix.into() });
    };
    for driver in &drivers {
        if let Some(fault) = &driver.fault {
            warn(format!("driver file {} {fault}", driver.path.display()), &driver.fix(variable));
        }
    }
    for (problem, fix) in drivers::hardware_without_driver(Path::new("/"), &drivers) {
        warn(problem, fix);
    }
    for device in &devices {
        for missing in &device.missing {
            let problem =
                format!("{device} lacks {} ({}): it {}", missing.name, missing.why, missing.found);
            warn(problem, "install a newer driver, or use another device");
        }
    }
    if !validation_layer {
        let problem = "the validation layer is not installed; only tests need it";
        warn(problem.into(), INSTALL_LAYER);
    }
    findings.sort_by_key(|f| f.severity);
    let version = |entry: &ash::Entry| {
        // SAFETY: a query without preconditions.
        let version = unsafe { entry.try_enumerate_instance_version() };
        let version = version.ok().flatten().unwrap_or(vk::API_VERSION_1_0);
        format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        )
    };
    let loader = loader.map(version);
    Doctor { loader, drivers, validation_layer, environment, devices, findings }
}

impl Doctor {
    /// Whether something can be rendered.
    pub fn is_well(&self) -> bool {
        self.findings.iter().all(|f| f.severity != Severity::Error)
    }
}
