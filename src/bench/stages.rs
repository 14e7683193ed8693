//! The parts of compute's frame time: the time of each stage, and the remainder.
//!
//! Each timestamp costs a barrier, so stages are timed in frames of their own. Such a frame is not the one
//! that was measured, and its stages do not fill it: submitting, waiting and the gaps between dispatches
//! take time too. So there are two figures for each stage: the time that the device's clock gave, and the
//! stage's share of the measured frame. The shares and the remainder add up to the measured frame.

use super::statistics::Summary;
use crate::{compute, error::Result, pass::Pass, vk::Timings};
use std::time::Instant;

/// Frames in which stages are timed.
const FRAMES: usize = 5;

/// Every stage of compute's frame by its label, in the pipeline's order.
pub const STAGES: [&str; 10] = [
    "clear",
    "vertex",
    "primitive",
    "binning_scan",
    "binning_scatter",
    "binning_sort",
    "raster",
    "shade",
    "ordered",
    "resolve",
];

/// A stage's part of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct StageTime {
    /// The stage's label, without the shader.
    pub stage: String,
    /// Its dispatches in a frame.
    pub dispatches: usize,
    /// Milliseconds of all of them by the device's clock, the median over frames.
    pub timed_ms: f64,
    /// Milliseconds of the measured frame.
    pub share_ms: f64,
}

/// A frame, taken apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stages {
    /// In the order of first appearance.
    pub stages: Vec<StageTime>,
    /// Milliseconds of the frames in which the stages were timed, from submission to end; the median.
    pub timed_frame_ms: f64,
    /// Milliseconds of the measured frame that are no stage's.
    pub remainder_ms: f64,
}

impl Stages {
    /// Shares `frame_ms` out as the frames of `samples` were: each a frame's milliseconds and its stages.
    fn new(samples: &[(f64, Vec<StageTime>)], frame_ms: f64) -> Self {
        let mut stages = samples.first().map_or(Vec::new(), |(_, stages)| stages.clone());
        for (number, stage) in stages.iter_mut().enumerate() {
            // A recording runs as it is: every frame has the same stages.
            let times = samples.iter().filter_map(|(_, stages)| Some(stages.get(number)?.timed_ms));
            stage.timed_ms = Summary::new(&times.collect::<Vec<_>>()).median;
        }
        let frames: Vec<f64> = samples.iter().map(|(ms, _)| *ms).collect();
        let timed_frame_ms = Summary::new(&frames).median;
        let total: f64 = stages.iter().map(|stage| stage.timed_ms).sum();
        // Medians of parts may add up to more than the median of the whole.
        let whole = timed_frame_ms.max(total);
        let scale = if whole > 0.0 { frame_ms / whole } else { 0.0 };
        stages.iter_mut().for_each(|stage| stage.share_ms = stage.timed_ms * scale);
        let remainder_ms = (frame_ms - total * scale).max(0.0);
        Self { stages, timed_frame_ms, remainder_ms }
    }
}

/// Times the stages of `pass`, whose measured frame takes `frame_ms`.
///
/// # Errors
/// Those of the executor.
pub fn stages(compute: &mut compute::Renderer, pass: &Pass, frame_ms: f64) -> Result<Stages> {
    compute.time_stages(true);
    let prepared = compute.prepare(pass);
    compute.time_stages(false);
    let mut prepared = prepared?;
    prepared.execute()?;
    let mut samples = Vec::with_capacity(FRAMES);
    for _ in 0..FRAMES {
        let started = Instant::now();
        let timings = prepared.execute()?;
        samples.push((started.elapsed().as_secs_f64() * 1e3, by_stage(&timings)));
    }
    Ok(Stages::new(&samples, frame_ms))
}

/// Sums a frame's dispatches by stage, in the order of first appearance.
fn by_stage(timings: &Timings) -> Vec<StageTime> {
    let mut stages: Vec<StageTime> = Vec::new();
    for (label, ns) in &timings.stages {
        // A stage that runs a user's shader has the shader's name behind its own.
        let name = label.split(' ').next().unwrap_or(label);
        let timed_ms = *ns as f64 / 1e6;
        match stages.iter_mut().find(|stage| stage.stage == name) {
            Some(stage) => {
                stage.timed_ms += timed_ms;
                stage.dispatches += 1;
            }
            None => stages.push(StageTime {
                stage: name.into(),
                dispatches: 1,
                timed_ms,
                share_ms: 0.0,
            }),
        }
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(stage: &str, dispatches: usize, timed_ms: f64) -> StageTime {
        StageTime { stage: stage.into(), dispatches, timed_ms, share_ms: 0.0 }
    }

    #[test]
    fn dispatches_are_summed_by_stage_whatever_the_shader() {
        let stages =
            [("clear", 1_000_000), ("vertex a.vert", 2_000_000), ("vertex b.vert", 500_000)];
        let stages = stages.map(|(label, ns)| (label.to_string(), ns)).to_vec();
        let timings = Timings { total_ns: 0, stages };
        assert_eq!(by_stage(&timings), [of("clear", 1, 1.0), of("vertex", 2, 2.5)]);
    }

    #[test]
    fn shares_and_remainder_add_up_to_the_frame() {
        let stages = || vec![of("clear", 1, 1.0), of("shade", 1, 5.0)];
        // Frames with gaps; frames whose parts seem to be longer than the whole; no clock at all.
        for (timed, stages) in [(8.0, stages()), (5.0, stages()), (8.0, Vec::new())] {
            let found = Stages::new(&[(timed, stages)], 7.0);
            let shares: f64 = found.stages.iter().map(|stage| stage.share_ms).sum();
            assert!((shares + found.remainder_ms - 7.0).abs() < 1e-9, "{found:?}");
            assert!(found.remainder_ms >= 0.0);
        }
        let found = Stages::new(&[(8.0, stages())], 4.0);
        assert_eq!((found.stages[1].share_ms, found.stages[1].timed_ms), (2.5, 5.0));
        assert_eq!((found.remainder_ms, found.timed_frame_ms), (1.0, 8.0));
    }
}
