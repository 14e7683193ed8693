//! An interrupted run ends its results properly: a user who presses Ctrl-C after an hour keeps the results
//! of that hour.
//!
//! A thread handles the signals. It ends the results and then the process, whatever the other threads are
//! doing: a frame may take seconds, and the user should not have to wait for it. The process dies of the
//! signal, as its caller expects.

use super::results::Results;
use crate::error::{Error, Result};
use signal_hook::{
    consts::{SIGINT, SIGTERM},
    iterator::Signals,
    low_level::emulate_default_handler,
};
use std::{
    io::{self, Read},
    path::Path,
    process::{Child, Command, Output, Stdio},
    sync::{Mutex, MutexGuard, PoisonError},
};
use tempfile::TempDir;

/// The work that an interrupted run has to end.
struct Unfinished {
    results: Option<Results>,
    /// The process that is being waited for.
    child: Option<Child>,
    /// A temporary folder.
    folder: Option<TempDir>,
}

static UNFINISHED: Mutex<Unfinished> =
    Mutex::new(Unfinished { results: None, child: None, folder: None });

fn unfinished() -> MutexGuard<'static, Unfinished> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on, a signal ends `results`.
///
/// # Errors
/// [`Error::Io`] if the system does not let signals be taken.
pub fn watch(results: Results) -> Result<()> {
    unfinished().results = Some(results);
    let mut signals = Signals::new([SIGINT, SIGTERM])
        .map_err(|source| Error::Io { path: "taking signals".into(), source })?;
    std::thread::spawn(move || {
        for signal in &mut signals {
            end(signal);
        }
    });
    Ok(())
}

fn end(signal: i32) {
    // The lock is held until the process is gone, so that no row is written behind the end.
    let mut unfinished = unfinished();
    if let Some(child) = &mut unfinished.child {
        // Killing fails if the process has ended meanwhile, which is fine.
        let _ = child.kill();
        let _ = child.wait();
    }
    unfinished.folder = None;
    let said = match unfinished.results.as_mut().map(Results::interrupted) {
        Some(Ok(said)) => said,
        Some(Err(error)) => error.to_string(),
        None => "interrupted".into(),
    };
    super::messages::line(format_args!("tilewright: {said}"));
    let _ = emulate_default_handler(signal);
}

/// Does something with the results.
///
/// # Errors
/// Those of `what`.
pub fn with<R>(what: impl FnOnce(&mut Results) -> Result<R>) -> Result<R> {
    match unfinished().results.as_mut() {
        Some(results) => what(results),
        None => Err(Error::Usage("no results were begun".into())),
    }
}

/// Runs `command` to its end, as [`Command::output`] does; a signal ends it too.
///
/// # Errors
/// Those of the system.
pub fn output(command: &mut Command) -> io::Result<Output> {
    let mut child =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    let (out, err) = (child.stdout.take(), child.stderr.take());
    unfinished().child = Some(child);
    // Both pipes are read at once: a child may block on either.
    let stderr = std::thread::spawn(move || drained(err));
    let stdout = drained(out);
    let stderr = stderr.join().unwrap_or_else(|_| Ok(Vec::new()));
    let child = unfinished().child.take();
    let mut child = child.ok_or_else(|| io::Error::other("the process is gone"))?;
    Ok(Output { status: child.wait()?, stdout: stdout?, stderr: stderr? })
}

fn drained(pipe: Option<impl Read>) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    if let Some(mut pipe) = pipe {
        pipe.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// A temporary folder that is removed at the end of the run, also if the run is interrupted.
pub struct Folder(std::path::PathBuf);

impl Folder {
    /// An empty one.
    ///
    /// # Errors
    /// Those of the system.
    pub fn new() -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().to_path_buf();
        unfinished().folder = Some(folder);
        Ok(Self(path))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        unfinished().folder = None;
    }
}
