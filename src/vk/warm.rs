//! Code that drivers generate late.
//!
//! Drivers for CPUs generate the code of a kernel when the kernel is dispatched for the first time, and not when it is made.
//! That takes a tenth of a second or more for each. So whoever wants it done earlier dispatches the kernel over nothing.

use super::{
    buffer::Buffer, device::DeviceKind, gpu::Gpu, kernel::Kernel, placeholder::Placeholders,
    recorder::Recorder, table::ResourceTable,
};
use crate::error::Result;

/// Dispatches each of `kernels` over nothing, and waits, on a device of ours that needs that. On a device of the caller,
/// somebody else may use the queue at this moment.
///
/// # Errors
/// As [`super::Recording::run`], and [`crate::Error::Full`] without memory.
pub(crate) fn generate_code<'k>(
    gpu: &Gpu,
    kernels: impl IntoIterator<Item = &'k Kernel>,
) -> Result<()> {
    if gpu.info().kind != DeviceKind::Cpu || gpu.0.adopted {
        return Ok(());
    }
    let placeholders = Placeholders::of(gpu)?;
    let zeros: &Buffer<u32> = &placeholders.buffer;
    let table = ResourceTable::new(gpu)?;
    let mut recorder = Recorder::new(gpu, "kernels over nothing")?;
    for kernel in kernels {
        recorder.kernel(kernel).table(&table).bind_everywhere(zeros).dispatch_indirect(zeros, 0)?;
    }
    recorder.submit().map(drop)
}
