//! The command line: one file per command. Each command parses its arguments, calls `job` or `store`, and prints.

pub(crate) mod arguments;
pub mod bench;
mod bifurcation;
mod check;
mod compare;
mod completions;
mod console;
mod curves;
mod devices;
mod explore;
pub mod failure;
mod interrupt;
mod map;
mod merge;
mod models;
mod orbit;
mod progress;
pub(crate) mod say;
mod shares;
mod stdout;
mod validate;

use std::ffi::OsString;
use std::process::ExitCode;
#[cfg(unix)]
use std::sync::Arc;

#[cfg(unix)]
use anyhow::Context;
use anyhow::anyhow;

use arguments::{Bench, Cli, Command, parsed_from};
use failure::Failure;

use crate::job::processor;

pub use arguments::parsed;
pub use progress::Progress;
pub use say::note;

/// Runs the command of the process's arguments, and returns its exit code.
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// Runs the command of these arguments, which begin with the program's name, and returns its exit code.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match parsed_from::<Cli>(arguments) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let result = prepare(&cli.command).and_then(|()| match cli.command {
        Command::Map(arguments) => map::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Bifurcation(arguments) => bifurcation::run(&arguments),
        Command::Models(arguments) => models::run(&arguments),
        Command::Explore(arguments) => explore::run(&arguments),
        Command::Devices => devices::run(),
        Command::Validate(arguments) => validate::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Curves(arguments) => curves::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Bench(Bench::Engines(arguments)) => bench::run(&arguments),
    });
    result.map_or_else(|failure| failure.print(), |()| 0)
}

/// Prepares the process for limits that a shell can set (`ulimit`), so that they lead to error messages.
fn prepare(command: &Command) -> Result<(), Failure> {
    // Without a handler, a file that becomes too large ends the process. With one, writing fails.
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .context("cannot listen for signals")?;
    if matches!(command, Command::Models(_) | Command::Devices | Command::Completions(_)) {
        return Ok(());
    }
    processor::start_threads().map_err(|error| Failure::Run(anyhow!(error)))
}
