//! Turns of host and device: when the host may touch memory that the device uses, also after the device failed.
//!
//! Handles are shared: a clone of a buffer may be written by one thread while another one runs a recording
//! that reads it. So host and device take turns, one lock for each device. A run holds the device's turn
//! until its fence; runs of several threads share it, since barriers order them. The host's turn, which
//! excludes everybody else, is taken for each access to mapped memory and for each change to a resource
//! table that recordings may have bound. Nobody waits for a turn longer than a run may take
//! ([`super::GpuOptions::timeout`]).
//!
//! Memory that nobody else can reach yet needs no turn: a new buffer's content, and the constants of a
//! recording that is being made. So uploads do not wait for what runs.
//!
//! (A lock for each buffer was the alternative. A run would have to take those of all buffers in its tables,
//! in one order for all threads; hosts that wait for a run are rare.)

use super::gpu::Shared;
use crate::error::{Error, Result};
use ash::vk;
use std::sync::{PoisonError, RwLockReadGuard, RwLockWriteGuard};

impl Shared {
    /// The turn of the device, to be held while a submission may be in flight.
    pub fn device_turn(&self) -> RwLockReadGuard<'_, ()> {
        self.turn.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// The turn of the host. Once the device is lost, the host gets no turn any more: the device may still be
    /// at work on its last submission.
    ///
    /// # Errors
    /// [`Error::Lost`].
    pub fn host_turn(&self) -> Result<RwLockWriteGuard<'_, ()>> {
        let turn = self.turn.write().unwrap_or_else(PoisonError::into_inner);
        if self.is_lost() { Err(self.lost_before()) } else { Ok(turn) }
    }

    /// The error of any use after the device was lost.
    pub fn lost_before(&self) -> Error {
        Error::Lost(format!("{} was lost before", self.info.name))
    }

    /// Waits for `fence`, at most as long as a submission may take.
    pub fn wait_for(&self, fence: vk::Fence) -> std::result::Result<(), vk::Result> {
        #[cfg(test)]
        match self.next_wait.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // A device that is lost works on nothing, so the test of a loss waits first.
            Some(lost @ vk::Result::ERROR_DEVICE_LOST) => return self.wait(fence).and(Err(lost)),
            Some(failure) => return Err(failure),
            None => {}
        }
        self.wait(fence)
    }

    fn wait(&self, fence: vk::Fence) -> std::result::Result<(), vk::Result> {
        let timeout = u64::try_from(self.timeout.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the fence is alive.
        unsafe { self.device.wait_for_fences(&[fence], true, timeout) }
    }
}

/// Whether a submission may still be in flight although waiting for it ended with `waited`. A lost device works
/// on nothing: to decide whether resources are in use, Vulkan treats the loss as success (section "Lost Device").
pub(super) fn may_be_in_flight(waited: std::result::Result<(), vk::Result>) -> bool {
    !matches!(waited, Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST))
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use crate::{
        Error,
        shader::testing::kernel,
        vk::{Buffer, Gpu, GpuOptions, Kernel, KernelInfo, Memory, Recorder, ResourceTable},
    };
    use ash::vk;

    const SLOW: &str = "#version 460
layout(local_size_x = 4) in;
layout(binding = 0) buffer Cells { uint cells[]; };
void main() {
    for (uint i = 0; i < cells[1]; i++) cells[0] = cells[0] * 1664525u + 1013904223u;
}";

    /// A wait that fails while the device is at work, for any reason: nothing that it is at work on may go,
    /// and nobody may touch it.
    #[test]
    fn what_may_be_in_flight_outlives_a_wait_that_fails() {
        for failure in [
            vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            vk::Result::ERROR_UNKNOWN,
            vk::Result::TIMEOUT,
        ] {
            let options = GpuOptions { validation: true, cache: None, ..GpuOptions::default() };
            let gpu = Gpu::open(&options).unwrap();
            let spirv = kernel(SLOW);
            let info = KernelInfo { name: "slow", spirv: &spirv, ..KernelInfo::default() };
            let slow = Kernel::new(&gpu, &info).unwrap();
            let cells = Buffer::upload(&gpu, "cells", &[1u32, 4_000_000]).unwrap();
            let read = Buffer::<u32>::new(&gpu, "read", 2, Memory::Readback).unwrap();
            let mut table = ResourceTable::new(&gpu).unwrap();
            table.insert_buffer(&cells).unwrap();
            let mut recorder = Recorder::new(&gpu, "slow").unwrap();
            recorder.kernel(&slow).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
            recorder.copy(&cells, &read).unwrap();
            let mut recording = recorder.finish().unwrap();
            *gpu.0.next_wait.lock().unwrap() = Some(failure);
            let error = recording.run().unwrap_err();
            assert!(!matches!(error, Error::Usage(_)), "{error}");
            for after in [
                recording.run().err(),
                cells.write(0, &[2]).err(),
                read.read().err(),
                Recorder::new(&gpu, "next").unwrap().submit().err(),
            ] {
                assert!(matches!(after, Some(Error::Lost(_))), "{failure:?}: {after:?}");
            }
            drop((recording, slow, cells, read, table));
            assert_eq!(gpu.validation_messages(), [""; 0], "{failure:?}");
            // The driver's threads must not be at work when the process ends.
            // SAFETY: the device is alive, and no other thread uses it.
            unsafe { gpu.0.device.device_wait_idle() }.unwrap();
        }
    }

    /// After a loss nothing is in flight, so that all goes as usual; Vulkan says so.
    #[test]
    fn a_device_that_is_lost_is_closed() {
        let gpu = Gpu::open(&GpuOptions { cache: None, ..GpuOptions::default() }).unwrap();
        let recorder = Recorder::new(&gpu, "nothing").unwrap();
        *gpu.0.next_wait.lock().unwrap() = Some(vk::Result::ERROR_DEVICE_LOST);
        assert!(matches!(recorder.submit(), Err(Error::Lost(_))));
        assert_eq!(std::sync::Arc::strong_count(&gpu.0), 1, "the recording is gone");
    }
}
