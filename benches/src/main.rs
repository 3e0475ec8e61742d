//! The instruments' program: `cargo run --release -p rattlemap-bench -- --help`.

mod arguments;
mod commands;

use std::process::ExitCode;

use arguments::{Cli, Instrument};
use commands::{scale, stress, work_precision};

fn main() -> ExitCode {
    let cli = match rattlemap::cli::parsed::<Cli>() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let done = match cli.instrument {
        Instrument::WorkPrecision(ask) => work_precision::run(&ask),
        Instrument::Stress(ask) => stress::run(&ask),
        Instrument::Scale(ask) => scale::run(&ask),
    };
    done.map_or_else(|failure| failure.report(), |()| ExitCode::SUCCESS)
}
