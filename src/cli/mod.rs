//! The command-line tool, in two layers: `args` parses the command line, `plan` decides what will be done.
//!
//! | file | concept |
//! |---|---|
//! | `args` | the command line as it was typed: flags, their values, the help |
//! | `plan` | the work to do: every check that needs no device, before any work |
//! | `render`, `parity`, `bench`, `conform`, `devices`, `doctor` | the verbs |
//! | `generated` | completions for shells and the manual, from the definitions in `args` |
//! | `device` | opening the requested device, and naming it |
//! | `output` | files that appear whole or not at all; standard output |
//! | `messages` | everything that is written to standard error |
//! | `exit` | the exit codes |
//!
//! Data goes to standard output, messages to standard error. A run that can fail early fails early: the
//! command line is checked first, then the outputs, then the device, and only then is a scene read.

mod args;
mod bench;
mod conform;
mod device;
mod devices;
mod doctor;
mod exit;
mod generated;
mod messages;
mod output;
mod parity;
mod picture;
mod plan;
mod render;
mod scene_view;

use crate::error::Result;
use args::{ConformArgs, ConformSubject, Typed, Verb};
use clap::Parser;
use exit::Outcome;
use std::{io::Write, process::ExitCode};

/// Runs the tool on the process's arguments.
pub fn run() -> ExitCode {
    messages::install();
    crate::shader::keep_compiled(crate::cache_folder());
    // The hook has said what happened; unwinding ends here, so that nothing else is printed.
    std::panic::catch_unwind(|| match Typed::try_parse() {
        Ok(typed) => {
            messages::set_quiet(typed.quiet);
            finish(dispatch(typed.verb))
        }
        Err(message) => {
            let printed = message.print().and_then(|()| std::io::stdout().flush());
            match message.use_stderr() {
                true => ExitCode::from(exit::USAGE),
                false => finish(output::printed(printed).map(|()| Outcome::Done)),
            }
        }
    })
    .unwrap_or(ExitCode::from(exit::INTERNAL))
}

fn dispatch(verb: Verb) -> Result<Outcome> {
    match verb {
        Verb::Render(args) => render::run(&args),
        Verb::Parity(args) => parity::run(&args),
        Verb::Bench(args) => bench::run(&args),
        Verb::Conform(ConformArgs { subject: ConformSubject::Shaders(args) }) => {
            conform::shaders(&args)
        }
        Verb::Devices(args) => devices::run(&args),
        Verb::Doctor(args) => doctor::run(&args),
        Verb::Completions(args) => generated::completions(&args),
        Verb::Man(args) => generated::man(&args),
    }
}

fn finish(result: Result<Outcome>) -> ExitCode {
    match result {
        Ok(outcome) => outcome.into(),
        Err(error) => {
            messages::line(format_args!("tilewright: {error}"));
            ExitCode::from(exit::code(&error))
        }
    }
}
