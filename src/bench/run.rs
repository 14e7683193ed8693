//! One pass by both executors, compared and then timed.
//!
//! The pictures are compared first, by the rules of [`crate::compare`]: times of different pictures mean
//! nothing. Then both passes are prepared, warmed up, and executed in rounds, in one process. In each round
//! both executors draw one frame, and they take turns in who begins, so that a disturbance that lasts longer
//! than a frame disturbs both alike. The host times a frame from its submission until it has ended
//! and its timestamps can be read. Copying the picture to the host is part of neither frame.
//!
//! Compute's stages are timed in frames of their own, since each timestamp costs a barrier.

use super::{
    clock::process_cpu_ms,
    counts::Counts,
    stages::{Stages, stages},
    statistics::{MIN_SAMPLES, Ratio, Summary, Verdict},
};
use crate::{
    classic,
    compare::{Both, Difference},
    compute,
    error::Result,
    pass::Pass,
    vk::Gpu,
};
use std::time::{Duration, Instant};

/// The most rounds: more of them gain nothing.
pub const MAX_ROUNDS: usize = 200;
/// The fewest rounds after which a ratio may count as precise enough.
const ENOUGH_ROUNDS: usize = 15;
/// The widest interval of a ratio that is precise enough, relative to its lower end.
const MAX_INTERVAL_WIDTH: f64 = 0.01;

/// The two executors. They keep their kernels and pipelines from pass to pass.
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

/// How a row is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// So many rounds. `None`: at least [`MIN_SAMPLES`] and at most [`MAX_ROUNDS`], until the ratio is known
    /// within a hundredth or `budget` has passed.
    pub rounds: Option<usize>,
    /// Frames that each executor draws before the first round: drivers compile kernels at their first use.
    pub warm_up: usize,
    /// How long the rounds of a row go on.
    pub budget: Duration,
    /// Whether frames are measured in which everything changes.
    pub changing: bool,
}

/// The time that one executor takes for a frame.
#[derive(Clone, Debug, Default)]
pub struct Side {
    /// Milliseconds from submission to end.
    pub frame: Summary,
    /// The milliseconds of each round, in their order.
    pub samples: Vec<f64>,
    /// Milliseconds by the device's own clock; `None` if it has none.
    pub device_ms: Option<f64>,
    /// Milliseconds of all the process's threads together, a driver's included; `None` where the
    /// system does not say.
    pub cpu_ms: Option<f64>,
}

/// The result of the rounds.
#[derive(Clone, Debug)]
pub struct Rounds {
    /// Compute's frames.
    pub compute: Side,
    /// Classic's frames.
    pub classic: Side,
    /// Classic time / compute time.
    pub ratio: Option<Ratio>,
}

impl Rounds {
    /// The verdict on the ratio, if the pictures are equal and the machine was quiet.
    pub fn verdict(&self) -> Verdict {
        self.ratio.map_or(Verdict::Ambiguous, |ratio| Verdict::new(ratio.value, ratio.interval))
    }
}

/// Everything that was measured of a pass.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// The counts of the pass.
    pub counts: Counts,
    /// By how much the pictures differ.
    pub difference: Difference,
    /// Whether they count as the same.
    pub images_equal: bool,
    /// Frames of a pass that stays as it is.
    pub warm: Rounds,
    /// Frames in which everything changes, if they were asked for.
    pub changing: Option<Rounds>,
    /// Compute's stages.
    pub stages: Stages,
}

/// Compares and times `pass`. `progress` hears the part that is done, from 0 to 1.
///
/// # Errors
/// Those of the executors.
pub fn measure(
    executors: &mut Executors,
    pass: &Pass,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Result<Measurement> {
    // Comparing costs about as much as a few rounds.
    let compared = 0.3;
    let warm_until = if settings.changing { 0.65 } else { 1.0 };
    let Executors { compute, classic } = executors;
    let both = Both::draw(compute, classic, pass, |done| {
        progress(compared * done as f64 / Both::STEPS as f64);
    })?;
    let (difference, images_equal) = (both.difference, both.same());
    drop(both);

    let warm = {
        let mut by_compute = compute.prepare(pass)?;
        let mut by_classic = classic.prepare(pass)?;
        rounds(
            settings,
            &mut || Frame::of(|| Ok(by_compute.execute()?.total_ns)),
            &mut || Frame::of(|| by_classic.execute()),
            &mut |part| progress(compared + (warm_until - compared) * part),
        )?
    };
    let changing = match settings.changing {
        true => Some(super::changing::rounds_of(executors, pass, settings, &mut |part| {
            progress(warm_until + (1.0 - warm_until) * part);
        })?),
        false => None,
    };
    let stages = stages(&mut executors.compute, pass, warm.compute.frame.median)?;
    let counts = Counts::new(pass)?;
    Ok(Measurement { counts, difference, images_equal, warm, changing, stages })
}

/// Rounds of one frame by each of the two, which take turns in who begins.
pub(super) fn rounds(
    settings: &Settings,
    compute: &mut dyn FnMut() -> Result<Frame>,
    classic: &mut dyn FnMut() -> Result<Frame>,
    progress: &mut dyn FnMut(f64),
) -> Result<Rounds> {
    for _ in 0..settings.warm_up {
        compute()?;
        classic()?;
    }
    let (mut by_compute, mut by_classic) = (Vec::new(), Vec::new());
    let started = Instant::now();
    loop {
        if by_compute.len() % 2 == 0 {
            by_compute.push(compute()?);
            by_classic.push(classic()?);
        } else {
            by_classic.push(classic()?);
            by_compute.push(compute()?);
        }
        let ratio = || {
            let of_both = by_compute.iter().zip(&by_classic);
            Ratio::new(
                &of_both.map(|(compute, classic)| (compute.ms, classic.ms)).collect::<Vec<_>>(),
            )
        };
        let count = by_compute.len();
        // A ratio sorts all rounds: it is made in each of them only where it decides how many there are.
        let done = match settings.rounds {
            Some(rounds) => count as f64 / rounds as f64,
            None => done(count, started.elapsed(), settings.budget, ratio()),
        };
        progress(done.min(1.0));
        if done >= 1.0 {
            let ratio = ratio();
            return Ok(Rounds { compute: side(&by_compute), classic: side(&by_classic), ratio });
        }
    }
}

/// The part of the rounds that is done, 1 once there are enough.
fn done(rounds: usize, elapsed: Duration, budget: Duration, ratio: Option<Ratio>) -> f64 {
    let is_precise = |ratio: Ratio| {
        ratio.interval.is_some_and(|[from, to]| to < from * (1.0 + MAX_INTERVAL_WIDTH))
    };
    if rounds >= MAX_ROUNDS || rounds >= ENOUGH_ROUNDS && ratio.is_some_and(is_precise) {
        return 1.0;
    }
    let used = elapsed.as_secs_f64() / budget.as_secs_f64().max(1e-9);
    used.min(rounds as f64 / MIN_SAMPLES as f64)
}

/// The times of one frame.
pub(super) struct Frame {
    ms: f64,
    /// 0 if the device has no clock.
    device_ns: u64,
    cpu_ms: Option<f64>,
}

impl Frame {
    /// Times `frame`, which returns the device's nanoseconds.
    pub(super) fn of(frame: impl FnOnce() -> Result<u64>) -> Result<Self> {
        let cpu = process_cpu_ms();
        let started = Instant::now();
        let device_ns = frame()?;
        let ms = started.elapsed().as_secs_f64() * 1e3;
        let cpu_ms = cpu.zip(process_cpu_ms()).map(|(before, after)| (after - before).max(0.0));
        Ok(Self { ms, device_ns, cpu_ms })
    }
}

fn side(frames: &[Frame]) -> Side {
    let middle = |samples: Vec<f64>| (!samples.is_empty()).then(|| Summary::new(&samples).median);
    let samples: Vec<f64> = frames.iter().map(|frame| frame.ms).collect();
    let device = frames.iter().filter(|frame| frame.device_ns > 0);
    Side {
        frame: Summary::new(&samples),
        samples,
        device_ms: middle(device.map(|frame| frame.device_ns as f64 / 1e6).collect()),
        cpu_ms: middle(frames.iter().filter_map(|frame| frame.cpu_ms).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    fn settings(rounds: Option<usize>, warm_up: usize) -> Settings {
        Settings { rounds, warm_up, budget: Duration::ZERO, changing: false }
    }

    #[test]
    fn the_two_take_turns_in_who_begins() {
        let order = RefCell::new(String::new());
        let frame = |name| {
            order.borrow_mut().push(name);
            Ok(Frame { ms: 1.0, device_ns: 0, cpu_ms: None })
        };
        let found =
            rounds(&settings(Some(3), 1), &mut || frame('k'), &mut || frame('c'), &mut |_| {});
        let found = found.unwrap();
        assert_eq!(*order.borrow(), "kc kc ck kc".replace(' ', ""));
        assert_eq!((found.compute.samples.len(), found.classic.samples.len()), (3, 3));
        assert_eq!((found.compute.device_ms, found.compute.cpu_ms), (None, None));
    }

    /// As many as `--rounds` may ask for: the ratio is made once, at the end.
    #[test]
    fn a_hundred_thousand_rounds_have_their_ratio() {
        let frame = |ms| Ok(Frame { ms, device_ns: 0, cpu_ms: None });
        let settings = settings(Some(100_000), 0);
        let found = rounds(&settings, &mut || frame(1.0), &mut || frame(2.0), &mut |_| {}).unwrap();
        assert_eq!(found.compute.samples.len(), 100_000);
        assert_eq!(found.ratio, Some(Ratio { value: 2.0, interval: Some([2.0, 2.0]) }));
    }

    #[test]
    fn without_a_number_there_are_rounds_enough_for_an_interval() {
        let frame = || Ok(Frame { ms: 1.0, device_ns: 0, cpu_ms: None });
        let found =
            rounds(&settings(None, 0), &mut || frame(), &mut || frame(), &mut |_| {}).unwrap();
        assert_eq!(found.compute.samples.len(), MIN_SAMPLES);
        let ratio = Ratio { value: 1.0, interval: Some([0.999, 1.001]) };
        let second = Duration::from_secs(1);
        assert!(done(ENOUGH_ROUNDS, Duration::ZERO, second, Some(ratio)) >= 1.0);
        assert!(done(ENOUGH_ROUNDS - 1, Duration::ZERO, second, Some(ratio)) < 1.0);
        assert!(done(MAX_ROUNDS, Duration::ZERO, second, None) >= 1.0);
    }
}
