//! How fast the device copies memory and adds by atomics, and how much of both each stage needs at least.
//!
//! The distance between a stage's time and the time of its least work shows how much there is to gain: a
//! stage at its limit becomes faster only if it gets less to do. The least work counts each value once that
//! the stage's contract makes it read or write. It ignores caches and is no prediction.

use super::{counts::Counts, statistics::Summary};
use crate::{
    abi::Triangle,
    error::Result,
    image::Extent,
    prebuilt::bench as prebuilt,
    vk::{Buffer, Gpu, Kernel, KernelInfo, Memory, Recorder, Recording},
};
use std::time::Instant;

/// Lanes of a workgroup of both kernels.
const GROUP: usize = 64;
/// Bytes that are copied: more than any cache holds of both sides.
const COPY_BYTES: usize = 48 << 20;
/// Counters; as many as a large picture has bins.
const COUNTERS: usize = 1 << 15;
/// Additions.
const ADDITIONS: usize = 3 << 20;
/// How often each is done; the fastest counts, since nothing makes a device faster than it is.
const TRIES: usize = 5;

/// The rates of the device; `None` if it has no timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Bytes a second, those read and those written both counted.
    pub copy: Option<f64>,
    /// Atomic additions a second.
    pub atomics: Option<f64>,
}

impl Rates {
    /// Measures them, in a fraction of a second.
    ///
    /// # Errors
    /// [`Error::Full`](crate::Error::Full) if 96 MiB cannot be had.
    pub fn measure(gpu: &Gpu) -> Result<Self> {
        let kernel =
            |name, spirv| Kernel::trusted(gpu, &KernelInfo { name, spirv, ..Default::default() });
        let copy = {
            let quads = |name| Buffer::<[u32; 4]>::new(gpu, name, COPY_BYTES / 16, Memory::Device);
            let (from, to) = (quads("from")?, quads("to")?);
            let mut recorder = Recorder::new(gpu, "clear before copying")?;
            recorder.fill(&from, 1)?;
            recorder.fill(&to, 0)?;
            recorder.submit()?;
            let groups = (COPY_BYTES / 16 / GROUP) as u32;
            let kernel = kernel("bench/copy", prebuilt::COPY)?;
            fastest(gpu, |recorder| {
                recorder.kernel(&kernel).bind("From", &from).bind("To", &to).dispatch(wide(groups))
            })?
        };
        let atomics = fastest(gpu, |recorder| additions(gpu, recorder))?;
        let per_second = |amount: usize, ns: u64| (ns > 0).then(|| amount as f64 * 1e9 / ns as f64);
        Ok(Self { copy: per_second(2 * COPY_BYTES, copy), atomics: per_second(ADDITIONS, atomics) })
    }
}

/// Records [`ADDITIONS`] scattered atomic additions.
fn additions(gpu: &Gpu, recorder: &mut Recorder) -> Result<()> {
    let spirv = prebuilt::ATOMIC;
    let info = KernelInfo { name: "bench/atomic", spirv, ..Default::default() };
    let kernel = Kernel::own(gpu, &info)?;
    let counters = Buffer::<u32>::new(gpu, "counters", COUNTERS, Memory::Device)?;
    let groups = (ADDITIONS / GROUP) as u32;
    recorder.kernel(&kernel).bind("Counters", &counters).dispatch(wide(groups))
}

/// A fixed piece of work of the device. It takes as long each time, unless something else works there too
/// or the clock changes.
pub(super) struct Calibration(Recording);

impl Calibration {
    /// The work, done once.
    ///
    /// # Errors
    /// [`Error::Full`](crate::Error::Full) without memory for it.
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let mut recorder = Recorder::new(gpu, "calibration")?;
        additions(gpu, &mut recorder)?;
        let mut recording = recorder.finish()?;
        recording.run()?;
        Ok(Self(recording))
    }

    /// Milliseconds from submission to end; the median of a few times.
    ///
    /// # Errors
    /// [`Error::Lost`](crate::Error::Lost).
    pub(super) fn run(&mut self) -> Result<f64> {
        let mut times = Vec::with_capacity(TRIES);
        for _ in 0..TRIES {
            let started = Instant::now();
            self.0.run()?;
            times.push(started.elapsed().as_secs_f64() * 1e3);
        }
        Ok(Summary::new(&times).median)
    }
}

/// One direction is enough: every device takes 65,535 workgroups in it.
fn wide(groups: u32) -> [u32; 3] {
    [groups, 1, 1]
}

/// The shortest time of one dispatch, in nanoseconds.
fn fastest(gpu: &Gpu, record: impl Fn(&mut Recorder) -> Result<()>) -> Result<u64> {
    let mut recorder = Recorder::new(gpu, "rates")?;
    recorder.time_stages();
    record(&mut recorder)?;
    let mut recording = recorder.finish()?;
    recording.run()?;
    let mut best = u64::MAX;
    for _ in 0..TRIES {
        let timings = recording.run()?;
        best = best.min(timings.stages.first().map_or(0, |(_, ns)| *ns));
    }
    Ok(best)
}

/// The least work of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Least {
    /// Bytes read and written.
    pub bytes: u64,
    /// Atomic additions.
    pub atomics: u64,
}

impl Least {
    /// The least work of the stage called `stage`, by its contract; `None` if the work depends on the picture, or
    /// if there is no rule for the stage.
    pub fn of(stage: &str, counts: &Counts, extent: Extent) -> Option<Self> {
        let pixels = extent.pixels() as u64;
        // Depth, stencil values and colours are kept for each sample.
        let samples = pixels * u64::from(counts.samples);
        let (position, depth) = (16, 4);
        let only = |bytes| Some(Self { bytes, atomics: 0 });
        match stage {
            "clear" => only(samples * (counts.color_bytes + depth + u64::from(counts.stencil))),
            // Positions go out twice: in clip space and in the window.
            "vertex" => only(
                counts.attribute_bytes + counts.vertices * 2 * position + counts.varying_words * 4,
            ),
            // Positions in, triangles and their cells out if all are kept; each is counted in a cell at
            // least.
            "primitive" => Some(Self {
                bytes: counts.vertices * position
                    + counts.triangles * (12 + size_of::<Triangle>() as u64 + 4),
                atomics: counts.triangles,
            }),
            // A cell in, a key out, if each triangle is in one cell.
            "binning_scatter" => {
                Some(Self { bytes: counts.triangles * 8, atomics: counts.triangles })
            }
            // A depth for each sample: a bin that one triangle covers needs no keys.
            "raster" => only(samples * depth),
            // A colour for each sample of each target.
            "shade" => only(samples * counts.color_bytes),
            // Colours of samples in, those of pixels out.
            "resolve" => only((samples + pixels) * counts.color_bytes),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_and_targets_are_work_of_the_stages_that_write_them() {
        let bytes = |stage, samples, color_bytes| {
            let counts = Counts { samples, color_bytes, triangles: 5, ..Counts::default() };
            Least::of(stage, &counts, Extent::new(10, 10)).map(|least| least.bytes)
        };
        let of = |samples, color_bytes| {
            ["clear", "raster", "shade", "resolve"].map(|stage| bytes(stage, samples, color_bytes))
        };
        assert_eq!(of(1, 4), [Some(800), Some(400), Some(400), Some(800)]);
        assert_eq!(of(4, 8), [Some(4800), Some(1600), Some(3200), Some(4000)]);
        assert_eq!(bytes("primitive", 1, 4), bytes("primitive", 4, 8));
        assert_eq!(bytes("ordered", 4, 8), None);
        let stencil = Counts { samples: 4, stencil: true, ..Counts::default() };
        let cleared = Least::of("clear", &stencil, Extent::new(10, 10)).map(|least| least.bytes);
        assert_eq!(cleared, Some(400 * 5), "a depth and a stencil value for each sample");
    }
}
