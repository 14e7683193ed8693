//! Finished recordings: how they run, and how long somebody waits for them.

use super::{access::may_be_in_flight, commands::Commands, gpu::Gpu};
use crate::error::{Error, Result};
use ash::vk;

/// A finished recording: it can run, more than once, and keeps alive all it refers to.
pub struct Recording {
    gpu: Gpu,
    /// `None` once it was leaked, because the device may not be done with it.
    commands: Option<Commands>,
    /// Where the device's timeline is when the last run has ended; 0 before the first.
    ends_at: u64,
}

/// How long the device took.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Timings {
    /// The whole recording, 0 if the device has no timestamps.
    pub total_ns: u64,
    /// Each dispatch in order, by label; empty unless [`super::Recorder::time_stages`] was called.
    pub stages: Vec<(String, u64)>,
}

impl Recording {
    pub(super) fn new(gpu: Gpu, commands: Commands) -> Result<Self> {
        commands.end()?;
        Ok(Self { gpu, commands: Some(commands), ends_at: 0 })
    }

    /// Runs it and waits, at most as long as [`super::GpuOptions::timeout`].
    ///
    /// # Errors
    /// [`Error::Lost`] if the device was lost or did not answer in time. Nothing can be run on the
    /// device afterwards, as after any other error of waiting.
    pub fn run(&mut self) -> Result<Timings> {
        self.settle()?;
        let shared = self.gpu.0.clone();
        let _turn = shared.device_turn();
        self.enqueue()?;
        self.wait()
    }

    /// Starts it and does not wait for its end. If it is running already, waits for the end of that run first. Waits as
    /// well while another thread has the turn of the host ([`super::Buffer::write`], [`super::Buffer::read`]).
    ///
    /// # Errors
    /// As [`Recording::run`].
    pub fn start(&mut self) -> Result<Submission> {
        self.settle()?;
        let shared = self.gpu.0.clone();
        let _turn = shared.device_turn();
        self.enqueue()?;
        Ok(Submission { gpu: self.gpu.clone(), ends_at: self.ends_at })
    }

    /// Whether it is running, as far as the host knows.
    pub(crate) fn is_running(&self) -> bool {
        self.ends_at > self.gpu.0.completed()
    }

    /// Waits for the end of its run, if there is one; returns the times of the last run.
    ///
    /// # Errors
    /// As [`Recording::run`].
    pub fn wait(&mut self) -> Result<Timings> {
        self.settle()?;
        match &self.commands {
            Some(commands) if self.ends_at > 0 => commands.timings(),
            _ => Ok(Timings::default()),
        }
    }

    /// Waits for the end of its run, if there is one.
    fn settle(&mut self) -> Result<()> {
        let shared = self.gpu.0.clone();
        let Some(commands) = &self.commands else { return Err(shared.lost_before()) };
        if self.ends_at == 0 {
            return Ok(());
        }
        let waited = shared.wait_for(self.ends_at);
        if may_be_in_flight(waited) {
            let what = commands.what();
            return Err(self.abandon(&what, waited.err().unwrap_or_default()));
        }
        waited.map_err(|e| shared.failure(&commands.what(), e))
    }

    /// Hands it to the queue. It is not running.
    fn enqueue(&mut self) -> Result<()> {
        let shared = self.gpu.0.clone();
        let Some(commands) = self.commands.as_ref().filter(|_| !shared.is_lost()) else {
            return Err(shared.lost_before());
        };
        if !commands.is_own() {
            return Err(Error::Usage(
                "a command buffer of the caller is submitted by the caller".into(),
            ));
        }
        // SAFETY: the recording is complete and not running: every start waits for the last one, and `&mut self` keeps
        // others away. All that it refers to is kept in `commands`.
        match unsafe { shared.submit(commands.raw) } {
            Ok(ends_at) => {
                self.ends_at = ends_at;
                Ok(())
            }
            // Vulkan promises that nothing has begun, or that a lost device works on nothing.
            Err(
                e @ (vk::Result::ERROR_OUT_OF_HOST_MEMORY
                | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
                | vk::Result::ERROR_DEVICE_LOST),
            ) => Err(shared.failure(&commands.what(), e)),
            Err(e) => {
                let what = commands.what();
                Err(self.abandon(&what, e))
            }
        }
    }

    /// Its device and its commands, to record others in their place.
    ///
    /// # Errors
    /// As [`Recording::wait`].
    pub(super) fn into_parts(mut self) -> Result<(Gpu, Commands)> {
        self.settle()?;
        let commands = self.commands.take().ok_or_else(|| self.gpu.0.lost_before())?;
        Ok((self.gpu.clone(), commands))
    }

    /// The error for a submission that may not have ended. The device may still read everything that the
    /// submission refers to, so nothing of it may be freed, and nothing else may run.
    fn abandon(&mut self, what: &str, e: vk::Result) -> Error {
        std::mem::forget(self.commands.take());
        self.gpu.0.abandoned(what, e)
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        if self.is_running() {
            // Commands that may still be running are leaked. Whoever waits next hears of it.
            let _ = self.settle();
        }
    }
}

/// Work that was started on a device.
#[derive(Clone, Debug)]
pub struct Submission {
    gpu: Gpu,
    ends_at: u64,
}

impl Submission {
    /// Whether it has ended. On a device that was lost, nothing is at work, and [`Submission::wait`] tells of the loss.
    pub fn is_done(&self) -> bool {
        self.gpu.0.completed() >= self.ends_at || self.gpu.0.is_lost()
    }

    /// The semaphore of the device that counts submissions, and its value when this one has ended: for submissions of the
    /// caller that come after it, on a device of the caller ([`super::Gpu::adopt`]).
    pub fn vulkan(&self) -> (vk::Semaphore, u64) {
        (self.gpu.0.timeline, self.ends_at)
    }

    /// Waits for its end, at most as long as [`super::GpuOptions::timeout`].
    ///
    /// # Errors
    /// As [`Recording::run`].
    pub fn wait(&self) -> Result<()> {
        let waited = self.gpu.0.wait_for(self.ends_at);
        match waited {
            Err(e) if may_be_in_flight(waited) => Err(self.gpu.0.abandoned("running a frame", e)),
            waited => waited.map_err(|e| self.gpu.failure("running a frame", e)),
        }
    }
}
