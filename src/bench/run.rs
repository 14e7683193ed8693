//! One pass by both executors, compared and then timed.
//!
//! The pictures are compared first, by the rules of [`crate::compare`]: times of different pictures say
//! nothing. Then both passes are prepared, warmed up, and executed in turns, one frame each, in one
//! process: what disturbs the machine for longer than a frame disturbs both alike. A frame is timed by
//! the host, from its submission until its fence has signalled and the result of its timestamps is
//! there. Bringing the picture to the host is part of neither frame.
//!
//! Stages are timed in frames of their own, since each timestamp costs a barrier.

use super::{
    clock::process_cpu_ms,
    counts::Counts,
    statistics::{FEWEST, Ratio, Summary, Verdict},
};
use crate::{
    classic,
    compare::{Both, Difference},
    compute,
    error::Result,
    pass::Pass,
    vk::{Gpu, Timings},
};
use std::time::{Duration, Instant};

/// Frames of each that are not counted: drivers compile kernels at their first use.
const WARM_UP: usize = 2;
/// Rounds after which nothing is gained.
const MOST_ROUNDS: usize = 200;
/// Rounds after which a ratio may be sure enough.
const ENOUGH_ROUNDS: usize = 15;
/// Width of the ratio's interval that is sure enough, relative to its lower end.
const SURE: f64 = 0.01;
/// Frames in which stages are timed.
const STAGE_FRAMES: usize = 5;

/// The two that compete. They keep their kernels and pipelines from pass to pass.
pub struct Executors {
    /// The product.
    pub compute: compute::Renderer,
    /// The opponent.
    pub classic: classic::Renderer,
}

impl Executors {
    /// Both, on `gpu`.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) if the device lacks what one of them needs.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { compute: compute::Renderer::new(gpu)?, classic: classic::Renderer::new(gpu)? })
    }
}

/// What one executor took for a frame.
#[derive(Clone, Debug, Default)]
pub struct Side {
    /// Milliseconds from submission to fence.
    pub frame: Summary,
    /// Milliseconds by the device's own clock; `None` if it has none.
    pub device_ms: Option<f64>,
    /// Milliseconds of all the process's threads together, a driver's included; `None` where the
    /// system does not say.
    pub cpu_ms: Option<f64>,
}

/// Device time of a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StageTime {
    /// The stage's label, without the shader.
    pub stage: String,
    /// Its dispatches in a frame.
    pub dispatches: usize,
    /// Milliseconds of all of them, the median over frames.
    pub ms: f64,
}

/// All that is known of a pass afterwards.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// What the pass consists of.
    pub counts: Counts,
    /// By how much the pictures differ.
    pub difference: Difference,
    /// Whether they count as the same.
    pub images_equal: bool,
    /// Rounds of one frame each.
    pub rounds: usize,
    /// Compute's frames.
    pub compute: Side,
    /// Classic's frames.
    pub classic: Side,
    /// Compute's stages.
    pub stages: Vec<StageTime>,
    /// Classic time / compute time.
    pub ratio: Option<Ratio>,
    /// What the ratio comes to.
    pub verdict: Verdict,
}

/// Compares and times `pass`. Rounds go on for `budget`, or until the ratio is known within a hundredth;
/// there are at least [`FEWEST`] and at most 200. `progress` hears the part that is done, from 0 to 1.
///
/// # Errors
/// Those of the executors.
pub fn measure(
    executors: &mut Executors,
    pass: &Pass,
    budget: Duration,
    progress: &mut dyn FnMut(f64),
) -> Result<Measurement> {
    // Comparing costs about as much as a few rounds.
    let compared = 0.3;
    let Executors { compute, classic } = executors;
    let both = Both::draw(compute, classic, pass, |done| {
        progress(compared * done as f64 / Both::STEPS as f64);
    })?;
    let (difference, images_equal) = (both.difference, both.same());
    drop(both);

    let mut by_compute = compute.prepare(pass)?;
    let mut by_classic = classic.prepare(pass)?;
    for _ in 0..WARM_UP {
        by_compute.execute()?;
        by_classic.execute()?;
    }
    let (mut compute_frames, mut classic_frames) = (Frames::default(), Frames::default());
    let started = Instant::now();
    let ratio = loop {
        compute_frames.time(|| Ok(by_compute.execute()?.total_ns))?;
        classic_frames.time(|| by_classic.execute())?;
        let rounds: Vec<_> =
            compute_frames.wall.iter().copied().zip(classic_frames.wall.iter().copied()).collect();
        let ratio = Ratio::new(&rounds);
        let used = started.elapsed().as_secs_f64() / budget.as_secs_f64().max(1e-9);
        let by_rounds = rounds.len() as f64 / FEWEST as f64;
        progress(compared + (1.0 - compared) * used.min(by_rounds).min(1.0));
        let sure = |ratio: Ratio| ratio.interval.is_some_and(|[from, to]| to < from * (1.0 + SURE));
        let enough = used >= 1.0 && rounds.len() >= FEWEST
            || rounds.len() >= ENOUGH_ROUNDS && ratio.is_some_and(sure);
        if enough || rounds.len() >= MOST_ROUNDS {
            break ratio;
        }
    };
    // Two prepared passes at a time are enough.
    drop((by_compute, by_classic));
    let stages = stages(compute, pass)?;
    let verdict = match ratio {
        _ if !images_equal => Verdict::Invalid,
        Some(ratio) => Verdict::new(ratio.value, ratio.interval),
        None => Verdict::Ambiguous,
    };
    Ok(Measurement {
        counts: Counts::new(pass)?,
        difference,
        images_equal,
        rounds: compute_frames.wall.len(),
        compute: compute_frames.summary(),
        classic: classic_frames.summary(),
        stages,
        ratio,
        verdict,
    })
}

/// Frames of one executor, in milliseconds each.
#[derive(Default)]
struct Frames {
    wall: Vec<f64>,
    device: Vec<f64>,
    cpu: Vec<f64>,
}

impl Frames {
    /// Times one frame, which returns the device's nanoseconds.
    fn time(&mut self, frame: impl FnOnce() -> Result<u64>) -> Result<()> {
        let cpu = process_cpu_ms();
        let started = Instant::now();
        let device_ns = frame()?;
        self.wall.push(started.elapsed().as_secs_f64() * 1e3);
        if let (Some(before), Some(after)) = (cpu, process_cpu_ms()) {
            self.cpu.push((after - before).max(0.0));
        }
        if device_ns > 0 {
            self.device.push(device_ns as f64 / 1e6);
        }
        Ok(())
    }

    fn summary(&self) -> Side {
        let middle = |samples: &[f64]| (!samples.is_empty()).then(|| Summary::new(samples).median);
        Side {
            frame: Summary::new(&self.wall),
            device_ms: middle(&self.device),
            cpu_ms: middle(&self.cpu),
        }
    }
}

/// Times the stages of `pass`.
fn stages(compute: &mut compute::Renderer, pass: &Pass) -> Result<Vec<StageTime>> {
    compute.time_stages(true);
    let prepared = compute.prepare(pass);
    compute.time_stages(false);
    let mut prepared = prepared?;
    prepared.execute()?;
    let frames = (0..STAGE_FRAMES)
        .map(|_| prepared.execute().map(|timings| by_stage(&timings)))
        .collect::<Result<Vec<_>>>()?;
    let mut stages = frames.first().cloned().unwrap_or_default();
    for (number, stage) in stages.iter_mut().enumerate() {
        // A recording runs as it is: every frame has the same stages.
        let times: Vec<f64> =
            frames.iter().filter_map(|frame| Some(frame.get(number)?.ms)).collect();
        stage.ms = Summary::new(&times).median;
    }
    Ok(stages)
}

/// Sums a frame's dispatches by stage, in the order of first appearance.
fn by_stage(timings: &Timings) -> Vec<StageTime> {
    let mut stages: Vec<StageTime> = Vec::new();
    for (label, ns) in &timings.stages {
        // A stage that runs a user's shader has the shader's name behind its own.
        let name = label.split(' ').next().unwrap_or(label);
        let ms = *ns as f64 / 1e6;
        match stages.iter_mut().find(|stage| stage.stage == name) {
            Some(stage) => {
                stage.ms += ms;
                stage.dispatches += 1;
            }
            None => stages.push(StageTime { stage: name.into(), dispatches: 1, ms }),
        }
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_are_summed_by_stage_whatever_the_shader() {
        let stages =
            [("clear", 1_000_000), ("vertex a.vert", 2_000_000), ("vertex b.vert", 500_000)];
        let stages = stages.map(|(label, ns)| (label.to_string(), ns)).to_vec();
        let of = |stage: &str, dispatches, ms| StageTime { stage: stage.into(), dispatches, ms };
        let timings = Timings { total_ns: 0, stages };
        assert_eq!(by_stage(&timings), [of("clear", 1, 1.0), of("vertex", 2, 2.5)]);
    }
}
