//! The commands, each a pipeline: ask, check, compute, write.

pub(crate) mod arguments;
pub mod bench;
mod bifurcation;
mod check;
mod compare;
mod completions;
mod devices;
mod environment;
mod interrupt;
mod map;
mod merge;
mod models;
mod orbit;
mod progress;
pub(crate) mod say;
pub(crate) mod stdout;
mod validate;

use std::ffi::OsString;
use std::process::ExitCode;

use arguments::{Bench, Cli, Command, parsed_from};

pub use arguments::parsed;
pub use environment::missing_variable;
pub use map::open_engine;
pub use progress::Progress;
pub use say::note;

/// Runs the command that the process was started with, and says how it ended.
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// Runs the command of these arguments, the program's name first, and returns the exit code.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match parsed_from::<Cli>(arguments) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let done = match cli.command {
        Command::Map(ask) => map::run(&ask),
        Command::Merge(ask) => merge::run(&ask),
        Command::Orbit(ask) => orbit::run(&ask),
        Command::Bifurcation(ask) => bifurcation::run(&ask),
        Command::Models(ask) => models::run(&ask),
        Command::Devices => devices::run(),
        Command::Validate(ask) => validate::run(&ask),
        Command::Compare(ask) => compare::run(&ask),
        Command::Check(ask) => check::run(&ask),
        Command::Completions(ask) => completions::run(&ask),
        Command::Bench(Bench::Engines(ask)) => bench::run(&ask),
    };
    done.map_or_else(|failure| failure.told(), |()| 0)
}
