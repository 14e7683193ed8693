//! `tilewright doctor`: reports which parts of Vulkan are installed and which are missing, with the exact fix.

use super::{
    args::JsonArgs,
    devices,
    exit::Outcome,
    output::{write_json, write_stdout},
};
use crate::{
    error::Result,
    vk::{self, Doctor, Severity},
};
use serde_json::{Value, json};
use std::fmt::Write;

/// Examines this machine.
///
/// # Errors
/// Only if the report cannot be written: faults of the machine are part of the report.
pub fn run(args: &JsonArgs) -> Result<Outcome> {
    let doctor = vk::doctor();
    if args.json {
        write_json(&json_of(&doctor))?;
    } else {
        write_stdout(text_of(&doctor).as_bytes())?;
    }
    Ok(if doctor.is_well() { Outcome::Done } else { Outcome::NoDevice })
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    }
}

fn json_of(doctor: &Doctor) -> Value {
    let drivers = doctor.drivers.iter().map(|driver| {
        json!({
            "path": driver.path.to_string_lossy(),
            "library": driver.library,
            "fault": driver.fault,
        })
    });
    let findings = doctor.findings.iter().map(|finding| {
        json!({
            "severity": severity(finding.severity),
            "problem": finding.problem,
            "fix": finding.fix,
        })
    });
    let environment = doctor.environment.iter().map(|(name, value)| (name.clone(), json!(value)));
    json!({
        "schema_version": 1,
        "well": doctor.is_well(),
        "loader": { "version": doctor.loader.as_ref().ok(), "fault": doctor.loader.as_ref().err() },
        "drivers": drivers.collect::<Vec<_>>(),
        "validation_layer": doctor.validation_layer,
        "environment": environment.collect::<serde_json::Map<_, _>>(),
        "devices": doctor.devices.iter().map(devices::entry).collect::<Vec<_>>(),
        "findings": findings.collect::<Vec<_>>(),
    })
}

fn text_of(doctor: &Doctor) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = match &doctor.loader {
        Ok(version) => writeln!(text, "Vulkan loader {version}"),
        Err(_) => writeln!(text, "no Vulkan loader"),
    };
    for (name, value) in &doctor.environment {
        let _ = writeln!(text, "environment: {name}={value}");
    }
    for driver in &doctor.drivers {
        let fault = driver.fault.as_ref().map_or(String::new(), |fault| format!(": it {fault}"));
        let _ =
            writeln!(text, "driver file {} -> {}{fault}", driver.path.display(), driver.library);
    }
    let layer = if doctor.validation_layer { "installed" } else { "not installed" };
    let _ = writeln!(text, "validation layer {layer}\n");
    for device in &doctor.devices {
        text.push_str(&devices::text(device));
    }
    if doctor.findings.is_empty() {
        let _ = writeln!(text, "\nall is well");
    }
    for finding in &doctor.findings {
        let _ = writeln!(text, "\n{}: {}", severity(finding.severity), finding.problem);
        let _ = writeln!(text, "  fix: {}", finding.fix);
    }
    text
}
