//! Whether the machine was quiet while a row was measured.
//!
//! The same scene can take 31 ms or 687 ms, depending on what else the machine does. Three things are
//! watched, since none of them sees everything:
//!
//! * how much of the processors *other programs* used meanwhile, time that a hypervisor took included;
//! * whether a fixed piece of work of the device (the *calibration*) takes longer than it did at best: that
//!   shows clocks that change, and machines that do not tell what else they do;
//! * how much the frames of one executor vary.
//!
//! What goes over its limit becomes a reason, and a row with a reason has the verdict BUSY. Its figures
//! stay. The load average is written down and is no reason: it remembers a minute that is over, and counts
//! the benchmark's own threads.

use super::{
    clock::{Processors, load_average},
    limits::Calibration,
    run::{Measurement, Rounds},
    statistics::spread,
};
use crate::{error::Result, vk::Gpu};

/// Part of all processors that other programs may use. An idle system's own work stays below it.
const MOST_OTHERS: f64 = 0.05;
/// How many times its best time the calibration may take.
const MOST_DRIFT: f64 = 1.15;
/// Calibrations before the first row: one alone may be slow itself, and is then no best.
const CALIBRATIONS: usize = 8;
/// The interquartile range of frame times, relative to their median. Frames of a millisecond vary by a
/// tenth on a quiet machine.
const MOST_SPREAD: f64 = 0.25;
/// Load average for each processor above which a run starts with a warning.
const MOST_LOAD: f64 = 0.5;

/// What the machine did while a row was measured. `None` is what the system does not tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quiet {
    /// Load average of the last minute, before the row.
    pub load_average: Option<f64>,
    /// Part of all processors that other programs used, 0 to 1.
    pub others: Option<f64>,
    /// Milliseconds of the calibration before and after the row.
    pub calibration_ms: [f64; 2],
    /// The longer of the two / the shortest of the run.
    pub drift: f64,
    /// Interquartile range / median of the warm frames of compute and of classic.
    pub spread: [f64; 2],
    /// The same of the frames in which everything changes, if there are any.
    pub changing_spread: Option<[f64; 2]>,
}

impl Quiet {
    /// Why the figures of the warm frames cannot be trusted; empty on a quiet machine.
    pub fn reasons(&self) -> Vec<String> {
        self.reasons_with(self.spread)
    }

    /// Why the figures of the frames in which everything changes cannot be trusted.
    pub fn changing_reasons(&self) -> Vec<String> {
        self.reasons_with(self.changing_spread.unwrap_or_default())
    }

    fn reasons_with(&self, spreads: [f64; 2]) -> Vec<String> {
        let mut reasons = Vec::new();
        if let Some(others) = self.others.filter(|part| *part > MOST_OTHERS) {
            reasons.push(format!(
                "other programs used {:.0} % of the processors",
                (others * 100.0).ceil()
            ));
        }
        if self.drift > MOST_DRIFT {
            reasons
                .push(format!("a fixed piece of work took {:.2} times its best time", self.drift));
        }
        for (name, spread) in ["compute", "classic"].iter().zip(spreads) {
            if spread > MOST_SPREAD {
                reasons.push(format!(
                    "the middle half of {name}'s frames spreads over {:.0} % of their median",
                    (spread * 100.0).ceil()
                ));
            }
        }
        reasons
    }
}

/// Watches the machine, row by row.
pub struct Watch {
    calibration: Calibration,
    best_ms: f64,
    started: Started,
}

/// How things were when a row began.
#[derive(Default)]
struct Started {
    load_average: Option<f64>,
    processors: Option<Processors>,
    calibration_ms: f64,
}

impl Watch {
    /// Makes the calibration.
    ///
    /// # Errors
    /// [`Error::Full`](crate::Error::Full) without memory for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let mut calibration = Calibration::new(gpu)?;
        let best_ms = shortest(|| calibration.run())?;
        Ok(Self { calibration, best_ms, started: Started::default() })
    }

    /// A row begins.
    ///
    /// # Errors
    /// [`Error::Lost`](crate::Error::Lost).
    pub fn start(&mut self) -> Result<()> {
        let calibration_ms = self.calibrate()?;
        self.started =
            Started { load_average: load_average(), processors: Processors::now(), calibration_ms };
        Ok(())
    }

    /// The row that began last was measured.
    ///
    /// # Errors
    /// [`Error::Lost`](crate::Error::Lost).
    pub fn end(&mut self, measured: &Measurement) -> Result<Quiet> {
        let processors = Processors::now();
        let calibration_ms = [self.started.calibration_ms, self.calibrate()?];
        let others = self.started.processors.zip(processors);
        Ok(Quiet {
            load_average: self.started.load_average,
            others: others.and_then(|(before, after)| after.others_since(before)),
            calibration_ms,
            drift: calibration_ms[0].max(calibration_ms[1]) / self.best_ms.max(1e-9),
            spread: spreads(&measured.warm),
            changing_spread: measured.changing.as_ref().map(spreads),
        })
    }

    fn calibrate(&mut self) -> Result<f64> {
        let ms = self.calibration.run()?;
        self.best_ms = self.best_ms.min(ms);
        Ok(ms)
    }
}

fn spreads(rounds: &Rounds) -> [f64; 2] {
    [&rounds.compute, &rounds.classic].map(|side| spread(&side.samples))
}

/// The shortest of [`CALIBRATIONS`].
fn shortest(mut calibrate: impl FnMut() -> Result<f64>) -> Result<f64> {
    (0..CALIBRATIONS).try_fold(f64::INFINITY, |best, _| Ok(best.min(calibrate()?)))
}

/// A sentence on a machine that is busy before anything is measured.
pub fn busy_already() -> Option<String> {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    load_average().and_then(|load| warning(load, cores))
}

fn warning(load: f64, cores: usize) -> Option<String> {
    (load > MOST_LOAD * cores as f64).then(|| {
        format!(
            "the machine was busy in the last minute (load average {load:.1} on {cores} processors): \
             figures need a quiet one"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_disturbance_is_a_reason() {
        let quiet =
            Quiet { others: Some(0.01), drift: 1.02, spread: [0.1, 0.2], ..Quiet::default() };
        assert_eq!(quiet.reasons(), [""; 0]);
        assert_eq!(Quiet { others: None, ..quiet.clone() }.reasons(), [""; 0]);
        for (busy, said) in [
            (Quiet { others: Some(0.341), ..quiet.clone() }, "other programs used 35 %"),
            (Quiet { drift: 1.8, ..quiet.clone() }, "1.80 times its best"),
            (Quiet { spread: [0.4, 0.1], ..quiet.clone() }, "compute's frames spreads over 40 %"),
            (Quiet { spread: [0.1, 0.5], ..quiet.clone() }, "classic's frames spreads over 50 %"),
        ] {
            let reasons = busy.reasons();
            assert!(reasons.len() == 1 && reasons[0].contains(said), "{reasons:?}");
        }
    }

    #[test]
    fn the_frames_of_each_line_vary_for_themselves() {
        let quiet = Quiet { drift: 1.0, spread: [0.1, 0.1], ..Quiet::default() };
        let changing = Quiet { changing_spread: Some([0.1, 0.7]), ..quiet.clone() };
        assert_eq!(changing.reasons(), [""; 0]);
        let reasons = changing.changing_reasons();
        assert!(reasons.len() == 1 && reasons[0].contains("classic's frames spreads over 70 %"));
        let warm = Quiet { spread: [0.7, 0.1], changing_spread: Some([0.1, 0.1]), ..quiet.clone() };
        assert_eq!((warm.reasons().len(), warm.changing_reasons().len()), (1, 0));
        // What disturbs the machine disturbs both.
        let both = Quiet { drift: 1.8, ..quiet };
        assert_eq!((both.reasons().len(), both.changing_reasons().len()), (1, 1));
    }

    #[test]
    fn a_slow_first_calibration_is_not_the_best() {
        let mut times = [9.0, 9.5, 4.0, 4.2].into_iter().chain(std::iter::repeat(4.1));
        assert_eq!(shortest(|| Ok(times.next().unwrap())).unwrap(), 4.0);
    }

    #[test]
    fn a_load_is_held_against_the_number_of_processors() {
        assert!(warning(3.0, 2).unwrap().contains("load average 3.0 on 2 processors"));
        assert_eq!(warning(3.0, 16), None);
    }
}
