//! The library's one error type. Its variants differ in what the caller can do about the error.

use std::path::PathBuf;

/// The result of every fallible operation of the library.
pub type Result<T> = std::result::Result<T, Error>;

/// A fault, grouped by what the caller can do about it.
///
/// Messages say what failed, on which device or in which file, the limit and the wanted value, and
/// what to do next. The command-line tool maps each variant to one exit code.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The request contradicts itself or the documentation: fix the call (exit code 2).
    #[error("{0}")]
    Usage(String),
    /// No device, or a device without something that is required (exit code 3).
    #[error("{0}")]
    Device(String),
    /// A file that cannot be read or makes no sense (exit code 4).
    #[error("{}: {reason}", path.display())]
    Input {
        /// The file as the user named it.
        path: PathBuf,
        /// The fault, as a sentence without the file name.
        reason: String,
    },
    /// A shader that does not compile or uses a feature that is out of reach (exit code 4).
    #[error("shader `{shader}`: {reason}")]
    Shader {
        /// The shader's label.
        shader: String,
        /// The compiler's message, or the feature that is refused.
        reason: String,
    },
    /// The device was lost or did not answer in time (exit code 5).
    #[error("{0}")]
    Lost(String),
    /// Something does not fit: names the buffer or image, the size wanted and the limit (exit code 6).
    #[error("{what} needs {wanted} bytes, the limit of {limit_of} is {limit}: {advice}")]
    Capacity {
        /// Which buffer, image or allocation.
        what: String,
        /// Bytes wanted.
        wanted: u64,
        /// Whose limit it is (the device's name and the limit's name).
        limit_of: String,
        /// The limit in bytes.
        limit: u64,
        /// What to do next.
        advice: String,
    },
    /// As [`Error::Capacity`], for things that are not counted in bytes or whose size only the driver knows
    /// (exit code 6). Names the limit where there is one.
    #[error("{0}")]
    Full(String),
    /// The operating system refused a file operation on an output (exit code 4).
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
}

impl Error {
    /// An [`Error::Input`] for `path`.
    pub fn input(path: impl Into<PathBuf>, reason: impl std::fmt::Display) -> Self {
        Error::Input { path: path.into(), reason: reason.to_string() }
    }

    /// An [`Error::Shader`] for the shader labelled `shader`.
    pub fn shader(shader: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Error::Shader { shader: shader.into(), reason: reason.to_string() }
    }
}
