//! The command-line tool; all of it is in [`tilewright::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    tilewright::cli::run()
}
