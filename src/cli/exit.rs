//! The fixed exit codes, which scripts can rely on.

use crate::error::Error;
use std::process::ExitCode;

/// How a run ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All was done (0).
    Done,
    /// The pictures, or the expected and the found, differ (1).
    Differ,
    /// No device can be used (3); said by verbs that report devices rather than need one.
    NoDevice,
}

/// The command line makes no sense.
pub const USAGE: u8 = 2;

/// An internal error: the code that a Rust program ends with after a panic.
pub const INTERNAL: u8 = 101;

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        ExitCode::from(match outcome {
            Outcome::Done => 0,
            Outcome::Differ => 1,
            Outcome::NoDevice => 3,
        })
    }
}

/// The code that an error ends with.
pub fn code(error: &Error) -> u8 {
    match error {
        Error::Usage(_) => USAGE,
        Error::Device(_) => 3,
        Error::Input { .. } | Error::Shader { .. } | Error::Io { .. } => 4,
        Error::Lost(_) => 5,
        Error::Capacity { .. } | Error::Full(_) => 6,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_has_its_code() {
        let io = Error::Io { path: "x".into(), source: std::io::Error::other("y") };
        let capacity = Error::Capacity {
            what: String::new(),
            wanted: 2,
            limit_of: String::new(),
            limit: 1,
            advice: String::new(),
        };
        for (error, expected) in [
            (Error::Usage(String::new()), 2),
            (Error::Device(String::new()), 3),
            (Error::input("x", "y"), 4),
            (Error::shader("x", "y"), 4),
            (io, 4),
            (Error::Lost(String::new()), 5),
            (capacity, 6),
            (Error::Full(String::new()), 6),
        ] {
            assert_eq!(code(&error), expected, "{error:?}");
        }
    }
}
