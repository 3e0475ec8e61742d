//! The commands, each a pipeline: ask, check, compute, write.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "these panic where nobody listens: see `say`")]

mod bench_command;
mod capacity;
mod cli;
mod devices_command;
mod engine_choice;
mod error;
mod map_command;
mod processor;
mod progress;
mod say;
mod scene_file;
mod validate_command;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use rattlemap::orbit::Class;
use rattlemap::output::{self, Folder};
use rattlemap::{bifurcation, orbit, scene};

use cli::{Cli, Command};
use error::{Failure, fail_if};
use progress::Progress;

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Map(ask) => map_command::run(&ask),
        Command::Orbit(ask) => run_orbit(&ask),
        Command::Bifurcation(ask) => run_bifurcation(&ask),
        Command::Devices => devices_command::run(),
        Command::Validate(ask) => validate_command::run(&ask),
        Command::Bench(ask) => bench_command::run(&ask),
    };
    done.map_or_else(|failure| failure.report(), |()| ExitCode::SUCCESS)
}

fn run_orbit(ask: &cli::Orbit) -> Result<(), Failure> {
    let pair = scene::single_cell(cli::DEFAULT_RESTITUTION, &ask.set)?;
    let folder = ask.out.as_ref().map(|dir| Folder::open(dir, ask.force)).transpose()?;
    let orbit = orbit::analyse(&pair, ask.start(), &ask.settings());
    output::orbit::print(&pair, &orbit, ask.json)?;
    let failed = orbit.class == Class::Failed;
    if let Some(folder) = folder {
        output::orbit::write(&folder, &pair, &orbit)?;
    }
    fail_if(failed, "the integration failed; `status` says why")
}

fn run_bifurcation(ask: &cli::Bifurcation) -> Result<(), Failure> {
    let ask = &ask.run;
    let scene = scene_file::load(&ask.scene, &ask.set, scene::Purpose::Bifurcation)?;
    let folder = Folder::open(&ask.out(), ask.force)?;
    let cells = scene.line();
    let progress = Progress::new(cells.len(), 0, "columns", ask.quiet);
    let clock = Instant::now();
    let report = |done| progress.report(done, cells.len());
    let columns = bifurcation::run(&cells, scene.start(), &scene.orbit_settings(), &report);
    let files = output::bifurcation::write(&folder, &scene, &ask.set, &columns, clock.elapsed())?;
    progress.finish(&format!("{}: {}", folder.path().display(), files.join(", ")));
    let all_failed = columns.iter().all(|column| column.class == Class::Failed);
    fail_if(all_failed, "every column failed; the status column says why")
}
