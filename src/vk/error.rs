//! Vulkan's result codes as the library's errors.

use crate::error::Error;
use ash::vk;

/// The error for a Vulkan call that failed while doing `what` on the device named `device`.
pub(super) fn describe(device: &str, what: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_DEVICE_LOST => Error::Lost(format!(
            "{device} was lost while {what}: the driver or a kernel crashed; try another device \
             (`tilewright devices` lists them)"
        )),
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
        | vk::Result::ERROR_OUT_OF_HOST_MEMORY
        | vk::Result::ERROR_OUT_OF_POOL_MEMORY
        | vk::Result::ERROR_FRAGMENTED_POOL => Error::Full(format!(
            "{device} ran out of memory while {what}; use a smaller size or scene, or a device with \
             more memory"
        )),
        vk::Result::TIMEOUT => Error::Lost(format!("{device} did not answer while {what}")),
        result => Error::Device(format!("{device} failed while {what}: {result}")),
    }
}

/// The error where the system has no memory, whatever the limits say.
pub(crate) fn no_memory(what: &str, wanted: u64) -> Error {
    Error::Full(format!(
        "{what} needs {wanted} bytes, and the system does not give that much memory: use a smaller size or scene"
    ))
}

/// The error for memory that cannot be had.
pub(super) fn capacity(what: &str, wanted: u64, limit_of: String, limit: u64) -> Error {
    Error::Capacity {
        what: what.to_string(),
        wanted,
        limit_of,
        limit,
        advice: "use a smaller size or scene, or a device with more memory".into(),
    }
}
