//! `rattlemap completions`: prints completion scripts for shells, and the man page.

use std::io;

use clap::builder::PossibleValuesParser;
use clap::{Arg, Command, CommandFactory, ValueHint};
use clap_mangen::Man;

use super::arguments::{Cli, Completions, parameters};
use super::failure::Failure;
use super::stdout::print;
use crate::model_file::BUILT_IN;

/// Prints a script for a shell, or the man page.
pub(crate) fn run(arguments: &Completions) -> Result<(), Failure> {
    let mut command = Cli::command();
    let mut text = Vec::new();
    match arguments.target.0 {
        Some(shell) => clap_complete::generate(shell, &mut with_values(command), "rattlemap", &mut text),
        None => {
            command.build();
            page(&command, &mut text).map_err(anyhow::Error::from)?;
        }
    }
    print(&String::from_utf8_lossy(&text))
}

/// Adds values that arguments are completed with, and that are not the only ones.
fn with_values(command: Command) -> Command {
    let of_argument = |argument: Arg| {
        let name = argument.get_value_names().filter(|_| argument.get_action().takes_values());
        let name = name.and_then(|names| names.first()).map(ToString::to_string);
        let sets = || parameters().into_iter().map(|name| format!("{name}="));
        match name.as_deref() {
            Some("DIR" | "OUT" | "PART" | "A" | "B") => argument.value_hint(ValueHint::DirPath),
            Some("SCENE" | "FILE") => argument.value_hint(ValueHint::FilePath),
            Some("NAME|FILE") => {
                argument.value_parser(PossibleValuesParser::new(BUILT_IN.iter().map(|(name, _)| *name)))
            }
            Some("NAME=VALUE") => argument.value_parser(PossibleValuesParser::new(sets())),
            Some("NAME") => argument.value_parser(PossibleValuesParser::new(parameters())),
            _ => argument,
        }
    };
    command.mut_subcommands(with_values).mut_args(of_argument)
}

/// Writes one page for the program and all of its commands.
fn page(program: &clap::Command, text: &mut Vec<u8>) -> io::Result<()> {
    let man = Man::new(program.clone());
    man.render_title(text)?;
    man.render_name_section(text)?;
    sections(program, text)
}

/// Writes the sections of a command and of its subcommands.
fn sections(command: &clap::Command, text: &mut Vec<u8>) -> io::Result<()> {
    let man = Man::new(command.clone());
    man.render_synopsis_section(text)?;
    man.render_description_section(text)?;
    man.render_options_section(text)?;
    if command.get_after_help().is_some() {
        man.render_extra_section(text)?;
    }
    command
        .get_subcommands()
        .filter(|below| below.get_name() != "help")
        .try_for_each(|below| sections(below, text))
}
