//! Running the binary.

use std::{
    io::Read,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// After how long a run counts as hanging. No run of the suite takes a hundredth of it on a quiet machine,
/// so that a busy one changes no result.
const HANGS: Duration = Duration::from_secs(30 * 60);

/// The results of a run.
#[derive(Debug)]
pub struct Run {
    /// The exit code; `None` if a signal ended it, also the one sent after the time limit.
    pub code: Option<i32>,
    pub stdout: Vec<u8>,
    pub stderr: String,
    pub timed_out: bool,
}

/// The tool on the driver under test, with validation on.
pub fn command() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tilewright"));
    command
        .env("TILEWRIGHT_VALIDATION", "1")
        .env("TILEWRIGHT_DEVICE", &crate::common::device_under_test().uuid)
        .env_remove("TILEWRIGHT_LOG");
    command
}

/// Runs the tool with `arguments`.
pub fn run<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Run {
    finish(command().args(arguments))
}

/// Runs `command` to its end, or until it counts as hanging.
pub fn finish(command: &mut Command) -> Run {
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    // Both pipes are drained while waiting, so that a full one cannot block the child.
    let drain = |mut pipe: Box<dyn Read + Send>| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            pipe.read_to_end(&mut bytes).map(|_| bytes)
        })
    };
    let stdout = drain(Box::new(child.stdout.take().expect("piped")));
    let stderr = drain(Box::new(child.stderr.take().expect("piped")));
    let started = Instant::now();
    let mut timed_out = false;
    let status = loop {
        if let Some(status) = child.try_wait().expect("the child can be waited for") {
            break status;
        }
        if started.elapsed() > HANGS && !timed_out {
            timed_out = true;
            child.kill().expect("the child can be killed");
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    Run {
        code: status.code(),
        stdout: stdout.join().expect("no panic").expect("readable"),
        stderr: text(stderr.join().expect("no panic").expect("readable")),
        timed_out,
    }
}

impl Run {
    /// Panics with all that was said unless the run ended with `code` and without a message of the
    /// validation layer.
    #[track_caller]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}", self.stderr);
        assert!(!self.stderr.contains("internal error"), "{}", self.stderr);
        assert!(!self.has_validation_message(), "{}", self.stderr);
        self
    }

    /// Panics unless standard error contains each of `parts`.
    #[track_caller]
    pub fn saying(self, parts: &[&str]) -> Self {
        for part in parts {
            assert!(self.stderr.contains(part), "`{part}` is missing in: {}", self.stderr);
        }
        self
    }

    pub fn has_validation_message(&self) -> bool {
        self.stderr.contains("Vulkan error:") || self.stderr.contains("Vulkan warning:")
    }

    pub fn stdout_text(&self) -> &str {
        std::str::from_utf8(&self.stdout).expect("standard output is text")
    }

    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.stdout)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.stdout)))
    }
}

/// A decoded PNG.
pub struct Png {
    pub size: (u32, u32),
    pub rgba: Vec<u8>,
    pub text: Vec<(String, String)>,
}

/// Decodes an 8-bit RGBA PNG.
pub fn decode(bytes: &[u8]) -> Png {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let mut rgba = vec![0; reader.output_buffer_size().expect("it fits into memory")];
    let info = reader.next_frame(&mut rgba).expect("whole");
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgba, png::BitDepth::Eight));
    let text = &reader.info().uncompressed_latin1_text;
    let text = text.iter().map(|chunk| (chunk.keyword.clone(), chunk.text.clone())).collect();
    Png { size: (info.width, info.height), rgba, text }
}

/// Names of the entries of `folder`.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect()
}

/// The folder of glTF and OBJ scenes; without it the case does not run, and says so.
pub fn scenes(case: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TILEWRIGHT_SCENES").filter(|folder| !folder.is_empty());
    if folder.is_none() {
        crate::did_not_run(case, "TILEWRIGHT_SCENES, a folder of glTF and OBJ scenes");
    }
    folder.map(PathBuf::from)
}
