//! Opens the requested device and names it.
//!
//! Every run names its device on standard error, and every file that the tool writes names it too: a picture
//! or a figure is worth nothing without its device.

use super::{args::DeviceArgs, messages};
use crate::{
    error::{Error, Result},
    vk::{DeviceInfo, Gpu, GpuOptions, Require},
};
use serde_json::{Value, json};

/// Opens the device and names it on standard error.
///
/// # Errors
/// As [`Gpu::open`].
pub fn open(args: &DeviceArgs) -> Result<Gpu> {
    let require = match (args.require_gpu, args.require_cpu) {
        (true, _) => Require::Gpu,
        (_, true) => Require::Cpu,
        _ => Require::Any,
    };
    let device = args.device.clone().filter(|selector| !selector.is_empty());
    let timeout = args.timeout.0;
    let mut options = GpuOptions::from_env().require(require).timeout(timeout);
    options.device = device.or(options.device);
    let gpu = Gpu::open(&options)?;
    messages::note(format_args!("device: {}", gpu.info()));
    Ok(gpu)
}

/// Refuses a device whose own pipeline cannot be compared with.
///
/// # Errors
/// [`Error::Device`].
pub fn require_graphics(gpu: &Gpu) -> Result<()> {
    let lacks = if !gpu.has_graphics() {
        "does not draw by itself, so there is nothing to compare with"
    } else if !gpu.has_primitive_ids() {
        "draws without gl_PrimitiveID (its feature geometryShader), so the triangle that won a pixel \
         is not known"
    } else {
        return Ok(());
    };
    Err(Error::Device(format!(
        "{} {lacks}; choose another device (`tilewright devices` lists them)",
        gpu.info().name
    )))
}

/// The device as it stands in every JSON this tool writes.
pub fn block(info: &DeviceInfo) -> Value {
    json!({
        "index": info.index,
        "name": info.name,
        "uuid": info.uuid,
        "kind": info.kind.name(),
        "driver": info.driver,
        "api_version": info.api_version,
        "vendor_id": info.ids.0,
        "device_id": info.ids.1,
        "memory_bytes": info.memory_bytes,
        "subgroup_sizes": [info.subgroup_sizes.0, info.subgroup_sizes.1],
    })
}
