//! `tilewright completions` and `tilewright man`: both are generated from the definitions of the command line.

use super::{
    args::{CompletionsArgs, ManArgs, Typed},
    exit::Outcome,
    output::write_stdout,
};
use crate::error::{Error, Result};
use clap::{Command, CommandFactory};

/// Prints the completions for a shell.
///
/// # Errors
/// [`Error::Io`] if standard output takes no more.
pub fn completions(args: &CompletionsArgs) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Typed::command(), "tilewright", &mut script);
    write_stdout(&script).map(|()| Outcome::Done)
}

/// Prints a page of the manual.
///
/// # Errors
/// [`Error::Usage`] for a verb that is not there; [`Error::Io`] if standard output takes no more.
pub fn man(args: &ManArgs) -> Result<Outcome> {
    let mut root = Typed::command().disable_help_subcommand(true);
    // Only a built command knows the full names of its verbs and the options that all of them share.
    root.build();
    let mut command = &root;
    for verb in &args.verbs {
        let found = command.find_subcommand(verb);
        command = found.ok_or_else(|| {
            let known: Vec<_> = command.get_subcommands().map(Command::get_name).collect();
            Error::Usage(match known.is_empty() {
                true => format!("`{}` has no verb `{verb}`", command.get_name()),
                false => format!("there is no verb `{verb}`, only {}", known.join(", ")),
            })
        })?;
    }
    let name = command.get_display_name().unwrap_or("tilewright").to_owned();
    let page = clap_mangen::Man::new(command.clone()).title(name);
    let mut text = Vec::new();
    page.render(&mut text).map_err(|source| Error::Io { path: "the page".into(), source })?;
    write_stdout(&text).map(|()| Outcome::Done)
}
