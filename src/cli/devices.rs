//! `tilewright devices`: lists the devices and whether they can be used.

use super::{args::JsonArgs, device, exit::Outcome, output::write_json, output::write_stdout};
use crate::{
    error::Result,
    vk::{self, DeviceInfo},
};
use serde_json::{Value, json};
use std::fmt::Write;

/// Lists all devices of all drivers.
///
/// # Errors
/// As [`vk::devices`].
pub fn run(args: &JsonArgs) -> Result<Outcome> {
    let devices = vk::devices()?;
    if args.json {
        let devices: Vec<_> = devices.iter().map(entry).collect();
        write_json(&json!({ "schema_version": 1, "devices": devices }))?;
    } else {
        write_stdout(devices.iter().map(text).collect::<String>().as_bytes())?;
    }
    let usable = devices.iter().any(|device| device.missing.is_empty());
    Ok(if usable { Outcome::Done } else { Outcome::NoDevice })
}

/// The device's block, and whether it can be used.
pub fn entry(info: &DeviceInfo) -> Value {
    let mut entry = device::block(info);
    let queues = info.queues.iter().map(|queue| {
        json!({
            "count": queue.count,
            "compute": queue.compute,
            "graphics": queue.graphics,
            "timestamp_bits": queue.timestamp_bits,
        })
    });
    entry["queues"] = queues.collect();
    entry["usable"] = info.missing.is_empty().into();
    let missing = info
        .missing
        .iter()
        .map(|missing| json!({ "name": missing.name, "why": missing.why, "found": missing.found }));
    entry["missing"] = missing.collect();
    entry["optional"] = info.optional.iter().copied().collect();
    entry
}

/// The device in a few lines, for people.
pub fn text(info: &DeviceInfo) -> String {
    let mut text = String::new();
    let usable = if info.missing.is_empty() { "usable" } else { "NOT usable" };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}: {} ({}), {usable}", info.index, info.name, info.kind.name());
    let _ = writeln!(text, "   driver   {}, Vulkan {}", info.driver, info.api_version);
    let _ = writeln!(text, "   uuid     {}", info.uuid);
    let (smallest, largest) = info.subgroup_sizes;
    let _ = writeln!(
        text,
        "   memory   {:.1} GiB, subgroups of {smallest} to {largest}",
        info.memory_bytes as f64 / f64::from(1 << 30)
    );
    let queues = info.queues.iter().map(|queue| {
        let kind = match (queue.graphics, queue.compute) {
            (true, true) => "graphics and compute",
            (true, false) => "graphics",
            (false, true) => "compute",
            (false, false) => "transfer",
        };
        format!("{} {kind}", queue.count)
    });
    let _ = writeln!(text, "   queues   {}", queues.collect::<Vec<_>>().join(", "));
    if !info.optional.is_empty() {
        let _ = writeln!(text, "   offers   {}", info.optional.join(", "));
    }
    for missing in &info.missing {
        let _ =
            writeln!(text, "   lacks    {} ({}): it {}", missing.name, missing.why, missing.found);
    }
    text
}
