//! Everything that is written to standard error: the device, warnings, progress, faults.
//!
//! A closed or full standard error must not end a run, so lines are written without the macros that
//! panic. Progress is drawn on a terminal only; `indicatif` hides it anywhere else.

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::{
    fmt::Display,
    io::{self, Write},
    sync::{
        LazyLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

/// All progress of the process, so that a line can be written between its redraws.
static PROGRESS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Whether `--quiet` was given.
static QUIET: AtomicBool = AtomicBool::new(false);

/// With `quiet`, progress and notes are no longer shown. Warnings and errors still are: a user who wants less
/// noise still has to know that a picture is not the requested one.
pub fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
    if quiet {
        PROGRESS.set_draw_target(ProgressDrawTarget::hidden());
    }
}

/// Writes one line: a warning, an error or a result.
pub fn line(text: impl Display) {
    around(|| {
        let _ = writeln!(io::stderr(), "{text}");
    });
}

/// Writes one line about the work in progress, unless `--quiet` was given.
pub fn note(text: impl Display) {
    if !QUIET.load(Ordering::Relaxed) {
        line(text);
    }
}

/// Calls `what` between two drawings of the progress, so that a terminal shows its output undisturbed.
pub fn around<R>(what: impl FnOnce() -> R) -> R {
    PROGRESS.suspend(what)
}

/// A spinner with a description of the work; it disappears on drop.
pub fn working_on(what: impl Display) -> Working {
    let bar = PROGRESS.add(ProgressBar::new_spinner());
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} ({elapsed})") {
        bar.set_style(style);
    }
    bar.set_message(what.to_string());
    bar.enable_steady_tick(Duration::from_millis(120));
    Working(bar)
}

/// A bar over `steps` steps; it disappears on drop.
pub fn progress(what: impl Display, steps: u64) -> Working {
    let bar = PROGRESS.add(ProgressBar::new(steps));
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} ({eta} left)") {
        bar.set_style(style);
    }
    bar.set_message(what.to_string());
    Working(bar)
}

/// Progress that is being shown.
pub struct Working(ProgressBar);

impl Working {
    /// Says how many steps are done.
    pub fn done(&self, steps: u64) {
        self.0.set_position(steps);
    }

    /// Replaces the description of the work.
    pub fn say(&self, what: impl Display) {
        self.0.set_message(what.to_string());
    }

    /// Sets the number of steps, if it was not known at the start.
    pub fn out_of(&self, steps: u64) {
        self.0.set_length(steps);
    }
}

impl Drop for Working {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Prints the library's warnings and errors as lines; `TILEWRIGHT_LOG` sets another level.
struct Logger;

impl log::Log for Logger {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::max_level()
            && metadata.target().split("::").next() == Some(env!("CARGO_CRATE_NAME"))
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            line(format_args!("{}: {}", record.level().as_str().to_lowercase(), record.args()));
        }
    }

    fn flush(&self) {}
}

/// Installs the logger and the panic hook.
pub fn install() {
    let typed = std::env::var("TILEWRIGHT_LOG").unwrap_or_default();
    let level = typed.parse();
    if log::set_logger(&Logger).is_ok() {
        log::set_max_level(*level.as_ref().unwrap_or(&log::LevelFilter::Warn));
    }
    if level.is_err() && !typed.is_empty() {
        log::warn!(
            "TILEWRIGHT_LOG=`{typed}` is not a level; the levels are off, error, warn, info, debug and trace"
        );
    }
    std::panic::set_hook(Box::new(|panic| {
        line(format_args!(
            "tilewright: internal error: {panic}\n\
             This is a fault of tilewright {}, not of your input; please report it with the command \
             line and the file.",
            env!("CARGO_PKG_VERSION")
        ));
    }));
}
