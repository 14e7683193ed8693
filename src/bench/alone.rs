//! One executor in a process of its own: what its first frame costs, and how much memory it takes.
//!
//! Neither can be measured in a process that runs the other executor too. The process starts with empty
//! caches, ours and the driver's, and runs twice. So the first run is like a user's very first one, and the
//! second one finds the caches that the first one left on disk. The alternative was to turn caches off: then
//! the first run writes no caches, and there is no second one.
//!
//! The time of the first frame includes everything that an executor does for it once the device is open and
//! the scene is loaded: making its kernels, taking the pass in, compiling, drawing. The memory is the peak of
//! the process: the scene, the driver and, if the device is the host's own processor, the driver's
//! allocations for the device. The memory of a graphics card is not included.

use super::{clock::peak_bytes, statistics::Summary};
use crate::{classic, compute, error::Result, pass::Pass, vk::Gpu};
use serde_json::{Value, json};
use std::{path::Path, process::Command, time::Instant};

/// How many more times the pass is prepared and drawn.
const AGAIN: usize = 3;

/// The figures of one process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alone {
    /// Milliseconds from the making of the renderer to the end of the first frame.
    pub first_frame_ms: f64,
    /// Milliseconds to prepare and draw the pass once more; the median of three.
    pub again_ms: f64,
    /// Peak memory before the renderer was made.
    pub before_bytes: Option<u64>,
    /// Peak memory at the end.
    pub peak_bytes: Option<u64>,
}

impl Alone {
    /// Draws `pass` by compute.
    ///
    /// # Errors
    /// Those of the executor.
    pub fn compute(gpu: &Gpu, pass: &Pass) -> Result<Self> {
        Self::draw(
            || compute::Renderer::new(gpu),
            |renderer| renderer.prepare(pass)?.execute().map(|_| ()),
        )
    }

    /// Draws `pass` by the device's own pipeline.
    ///
    /// # Errors
    /// Those of the executor.
    pub fn classic(gpu: &Gpu, pass: &Pass) -> Result<Self> {
        Self::draw(
            || classic::Renderer::new(gpu),
            |renderer| renderer.prepare(pass)?.execute().map(|_| ()),
        )
    }

    fn draw<R>(
        make: impl FnOnce() -> Result<R>,
        frame: impl Fn(&mut R) -> Result<()>,
    ) -> Result<Self> {
        let before_bytes = peak_bytes();
        let started = Instant::now();
        let ms_since = |started: Instant| started.elapsed().as_secs_f64() * 1e3;
        let mut renderer = make()?;
        frame(&mut renderer)?;
        let first_frame_ms = ms_since(started);
        let mut again = Vec::new();
        for _ in 0..AGAIN {
            let started = Instant::now();
            frame(&mut renderer)?;
            again.push(ms_since(started));
        }
        let again_ms = Summary::new(&again).median;
        Ok(Self { first_frame_ms, again_ms, before_bytes, peak_bytes: peak_bytes() })
    }

    /// As one process tells another.
    pub fn json(&self) -> Value {
        json!({
            "first_frame_ms": self.first_frame_ms,
            "again_ms": self.again_ms,
            "before_bytes": self.before_bytes,
            "peak_bytes": self.peak_bytes,
        })
    }

    /// What [`Alone::json`] wrote.
    pub fn from_json(value: &Value) -> Option<Self> {
        Some(Self {
            first_frame_ms: value["first_frame_ms"].as_f64()?,
            again_ms: value["again_ms"].as_f64()?,
            before_bytes: value["before_bytes"].as_u64(),
            peak_bytes: value["peak_bytes"].as_u64(),
        })
    }
}

/// Gives `command` caches of its own in `folder`, which is empty before its first run.
pub fn in_empty_caches<'a>(command: &'a mut Command, folder: &Path) -> &'a mut Command {
    command
        .env("XDG_CACHE_HOME", folder)
        .env("MESA_SHADER_CACHE_DIR", folder)
        .env("__GL_SHADER_DISK_CACHE_PATH", folder)
        .env_remove("TILEWRIGHT_CACHE")
        .env_remove("MESA_SHADER_CACHE_DISABLE")
        .env_remove("MESA_GLSL_CACHE_DISABLE")
        .env_remove("__GL_SHADER_DISK_CACHE")
}
