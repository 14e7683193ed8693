//! Whether a module is valid SPIR-V for Vulkan 1.3, by SPIRV-Tools' validator.
//!
//! Drivers rely on valid modules and crash on others. The validator is the program `spirv-val`:
//! a process of its own, because a module from anywhere may be the one that the validator itself stumbles
//! over. It takes about 5 ms; a driver takes ten times as long to compile the module.

use super::module::Outcome;
use std::{
    io::{ErrorKind, Read as _, Write as _},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

/// After so long the validator is taken to hang.
const PATIENCE: Duration = Duration::from_secs(60);

/// Checks the module.
///
/// # Errors
/// The validator's sentence, or how to get a validator.
pub(crate) fn validate(words: &[u32]) -> Outcome<()> {
    let mut child = Command::new("spirv-val")
        // The engine asks every device for scalar block layout.
        .args(["--target-env", "vulkan1.3", "--scalar-block-layout", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| match error.kind() {
            ErrorKind::NotFound => "SPIR-V from outside is validated before a driver sees it, and there \
                is no `spirv-val` in PATH: install spirv-tools (Debian, Ubuntu, Fedora) or the Vulkan \
                SDK. A module that is known to be valid can be taken unchecked: \
                `Shader::from_spirv_unchecked`"
                .into(),
            _ => format!("spirv-val does not start: {error}"),
        })?;
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
    if let Some(mut stdin) = child.stdin.take() {
        // A validator that has seen enough closes its input.
        let _ = stdin.write_all(&bytes);
    }
    let (valid, said) = wait(&mut child)?;
    if valid { Ok(()) } else { Err(sentence(&said)) }
}

/// Whether the validator accepts the module, and its message.
fn wait(child: &mut Child) -> Outcome<(bool, String)> {
    let begin = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => {
                let mut said = Vec::new();
                if let Some(mut stderr) = child.stderr.take() {
                    let _ = stderr.read_to_end(&mut said);
                }
                return Ok((status.success(), String::from_utf8_lossy(&said).into_owned()));
            }
            Ok(None) if begin.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_micros(500));
            }
            other => {
                let _ = child.kill();
                let _ = child.wait();
                let reason = other.err().map_or("no answer in a minute".into(), |e| e.to_string());
                return Err(format!("spirv-val: {reason}"));
            }
        }
    }
}

/// The validator's first message (`error: line 7: …`), without the listing behind it.
fn sentence(said: &str) -> String {
    let first = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it crashed on it");
    let message = first.strip_prefix("error: ").unwrap_or(first);
    // Of a binary, lines are numbers of instructions.
    let message = match message.split_once(": ") {
        Some((place, text)) if place.bytes().all(|b| b.is_ascii_digit()) => text,
        Some((place, text)) if place.starts_with("line ") => text,
        _ => message,
    };
    format!("not valid SPIR-V for Vulkan 1.3, says spirv-val: {}", message.trim())
}
