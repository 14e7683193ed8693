//! Whether a module is valid SPIR-V for Vulkan 1.3, by SPIRV-Tools' validator.
//!
//! Drivers rely on valid modules and crash on others. The validator is the program `spirv-val`:
//! a process of its own, because a module from anywhere may be the one that the validator itself stumbles
//! over. It takes about 5 ms; a driver takes ten times as long to compile the module.

use super::module::Outcome;
use std::{
    io::{ErrorKind, Read as _, Write as _},
    process::{Child, ChildStderr, Command, Stdio},
    time::{Duration, Instant},
};

/// After so long the validator is taken to hang.
const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes of the validator's messages that are kept.
const SAID_BYTES: u64 = 4096;
/// Characters of the validator's sentence that a user sees: a name in it may be as long as a module.
const SENTENCE_CHARS: usize = 500;

/// Checks the module.
///
/// # Errors
/// The validator's sentence, or how to get a validator.
pub(super) fn validate(words: &[u32]) -> Outcome<()> {
    let mut command = Command::new("spirv-val");
    // The engine asks every device for scalar block layout.
    command.args(["--target-env", "vulkan1.3", "--scalar-block-layout", "-"]);
    validate_by(command, words)
}

fn validate_by(mut command: Command, words: &[u32]) -> Outcome<()> {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| match error.kind() {
            ErrorKind::NotFound => "shaders are validated before a driver sees them, and there is no \
                `spirv-val` in PATH: install spirv-tools (Debian, Ubuntu, Fedora) or the Vulkan SDK. \
                SPIR-V that is known to be valid can be taken unchecked: \
                `Shader::from_spirv_unchecked`"
                .into(),
            _ => format!("spirv-val does not start: {error}"),
        })?;
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
    let (stdin, stderr) = (child.stdin.take(), child.stderr.take());
    // Pipes are short: one thread writes, and one reads, while this one looks at the clock.
    let (valid, said) = std::thread::scope(|threads| {
        threads.spawn(|| {
            // A validator that has seen enough closes its input.
            stdin.map(|mut stdin| stdin.write_all(&bytes))
        });
        let said = threads.spawn(|| stderr.map_or_else(String::new, beginning));
        let valid = wait(&mut child);
        (valid, said.join().unwrap_or_default())
    });
    if valid? { Ok(()) } else { Err(sentence(&said)) }
}

/// The beginning of what the validator says, all of which is read.
fn beginning(mut stderr: ChildStderr) -> String {
    let mut said = Vec::new();
    let _ = stderr.by_ref().take(SAID_BYTES).read_to_end(&mut said);
    let _ = std::io::copy(&mut stderr, &mut std::io::sink());
    String::from_utf8_lossy(&said).into_owned()
}

/// Whether the validator is content.
fn wait(child: &mut Child) -> Outcome<bool> {
    let begin = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status.success()),
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
    let message = message.trim();
    let (message, more) = match message.char_indices().nth(SENTENCE_CHARS) {
        Some((end, _)) => (&message[..end], "…"),
        None => (message, ""),
    };
    format!("not valid SPIR-V for Vulkan 1.3, says spirv-val: {message}{more}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn a_long_message_is_read_to_its_end_and_cut_short() {
        let long = shell("head -c 300000 /dev/zero | tr '\\0' x >&2; exit 1");
        let text = validate_by(long, &[7; 100_000]).unwrap_err();
        assert!(text.ends_with("xxx…") && text.len() < 1000, "{} bytes", text.len());
        let slow = shell("head -c 300000 /dev/zero >&2; cat > /dev/null");
        validate_by(slow, &[7; 100_000]).unwrap();
    }

    #[test]
    fn without_a_validator_the_message_fits_any_shader() {
        let text = validate_by(Command::new("no-such-spirv-val"), &[]).unwrap_err();
        assert!(text.starts_with("shaders are validated") && text.contains("install"), "{text}");
    }
}
