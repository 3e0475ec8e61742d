//! The command line: one file per command. Each command parses its arguments, calls `job` or `store`, and prints.

pub(crate) mod arguments;
pub mod bench;
mod bifurcation;
mod check;
mod compare;
mod completions;
mod console;
mod devices;
pub mod failure;
mod interrupt;
mod map;
mod merge;
mod models;
mod orbit;
mod progress;
pub(crate) mod say;
mod stdout;
mod validate;

use std::ffi::OsString;
use std::process::ExitCode;

use arguments::{Bench, Cli, Command, parsed_from};

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
    let result = match cli.command {
        Command::Map(arguments) => map::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Bifurcation(arguments) => bifurcation::run(&arguments),
        Command::Models(arguments) => models::run(&arguments),
        Command::Devices => devices::run(),
        Command::Validate(arguments) => validate::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Bench(Bench::Engines(arguments)) => bench::run(&arguments),
    };
    result.map_or_else(|failure| failure.print(), |()| 0)
}
