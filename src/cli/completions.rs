//! `rattlemap completions`: prints completion scripts for shells, and the man page.

use std::io;

use clap::CommandFactory;
use clap_mangen::Man;

use super::arguments::{Cli, Completions};
use super::failure::Failure;
use super::stdout::print;

/// Prints a script for a shell, or the man page.
pub(crate) fn run(arguments: &Completions) -> Result<(), Failure> {
    let mut command = Cli::command();
    let mut text = Vec::new();
    match arguments.target.shell() {
        Some(shell) => clap_complete::generate(shell, &mut command, "rattlemap", &mut text),
        None => {
            command.build();
            page(&command, &mut text).map_err(anyhow::Error::from)?;
        }
    }
    print(&String::from_utf8_lossy(&text))
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
