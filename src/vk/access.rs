//! Turns of host and device: when the host may touch memory that the device uses, also after the device failed.
//!
//! Handles are shared: a clone of a buffer may be written by one thread while another one runs a recording
//! that reads it. So host and device take turns, one lock for each device. A run holds the device's turn
//! until it has ended; runs of several threads share it, since barriers order them. A recording that is started and not
//! waited for holds it only while it is submitted. The host's turn, which excludes everybody else, waits for all that was
//! started, and is taken for each access to mapped memory and for each change to a resource
//! table that recordings may have bound. Nobody waits for a turn longer than a run may take
//! ([`super::GpuOptions::timeout`]).
//!
//! A timeline semaphore counts the submissions of a device. There is one queue, and barriers order all that it gets, so
//! that a submission has ended when the timeline has reached its number.
//!
//! Memory that nobody else can reach yet needs no turn: a new buffer's content, and the constants of a
//! recording that is being made. So uploads do not wait for what runs.
//!
//! (A lock for each buffer was the alternative. A run would have to take those of all buffers in its tables,
//! in one order for all threads; hosts that wait for a run are rare.)

use super::gpu::Shared;
use crate::error::{Error, Result};
use ash::vk;
use std::sync::{PoisonError, RwLockReadGuard, RwLockWriteGuard, atomic::Ordering};

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
        if self.is_lost() {
            return Err(self.lost_before());
        }
        // Nothing is submitted meanwhile. What was started without waiting may still be running.
        let started = self.submitted.load(Ordering::Relaxed);
        if started > self.completed() {
            let waited = self.wait_for(started);
            match waited {
                Err(e) if may_be_in_flight(waited) => {
                    return Err(self.abandoned("what was started", e));
                }
                waited => waited.map_err(|e| self.failure("waiting for what was started", e))?,
            }
        }
        Ok(turn)
    }

    /// The error of any use after the device was lost.
    pub fn lost_before(&self) -> Error {
        Error::Lost(format!("{} was lost before", self.info.name))
    }

    /// Hands `commands` to the queue. Returns where the timeline of the device is when they have ended.
    ///
    /// # Safety
    /// The commands are complete, and they are not running. All that they refer to lives until they have ended.
    pub unsafe fn submit(
        &self,
        commands: vk::CommandBuffer,
    ) -> std::result::Result<u64, vk::Result> {
        let queue = self.lock_queue();
        let ends_at = self.submitted.load(Ordering::Relaxed) + 1;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let signal = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.timeline)
            .value(ends_at)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let submit = [vk::SubmitInfo2::default()
            .command_buffer_infos(&commands)
            .signal_semaphore_infos(&signal)];
        // SAFETY: the caller's promise; values of the timeline grow, since the queue is locked.
        unsafe { self.device.queue_submit2(*queue, &submit, vk::Fence::null()) }?;
        self.submitted.store(ends_at, Ordering::Relaxed);
        Ok(ends_at)
    }

    /// Where the timeline of the device is: all submissions up to this one have ended.
    pub fn completed(&self) -> u64 {
        // SAFETY: the device and its semaphore are alive.
        match unsafe { self.device.get_semaphore_counter_value(self.timeline) } {
            Ok(value) => value,
            Err(e) => {
                if e == vk::Result::ERROR_DEVICE_LOST {
                    self.lost.store(true, Ordering::Relaxed);
                }
                0
            }
        }
    }

    /// Waits until the timeline is at `value`. Each submission on the way there may take as long as one may take.
    /// Nobody waits for a device that is lost: its last submissions may never end.
    pub fn wait_for(&self, value: u64) -> std::result::Result<(), vk::Result> {
        #[cfg(test)]
        match self.next_wait.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // A device that is lost works on nothing, so the test of a loss waits first.
            Some(lost @ vk::Result::ERROR_DEVICE_LOST) => return self.wait(value).and(Err(lost)),
            Some(failure) => return Err(failure),
            None => {}
        }
        self.wait(value)
    }

    fn wait(&self, value: u64) -> std::result::Result<(), vk::Result> {
        let timeout = u64::try_from(self.timeout.as_nanos()).unwrap_or(u64::MAX);
        let timeout = if self.is_lost() { 0 } else { timeout };
        loop {
            let done = self.completed();
            if done >= value {
                return Ok(());
            }
            let (semaphores, values) = ([self.timeline], [done + 1]);
            let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
            // SAFETY: the device and its semaphore are alive.
            unsafe { self.device.wait_semaphores(&info, timeout) }?;
        }
    }

    /// The error for a submission that may not have ended. Nothing else may run.
    pub fn abandoned(&self, what: &str, e: vk::Result) -> Error {
        self.lost.store(true, Ordering::Relaxed);
        if e != vk::Result::TIMEOUT {
            return self.failure(what, e);
        }
        Error::Lost(format!(
            "{} did not finish {what} within {} seconds; use a smaller size or scene, or allow more time \
             (--timeout, TILEWRIGHT_TIMEOUT, GpuOptions::timeout)",
            self.info.name,
            self.timeout.as_secs_f32()
        ))
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
            let cells = Buffer::with_content(&gpu, "cells", &[1u32, 4_000_000]).unwrap();
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
