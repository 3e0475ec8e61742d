//! The program `rattlemap-bench`: `cargo run --release -p rattlemap-bench -- --help`.

mod arguments;
mod commands;

use std::process::ExitCode;

use arguments::{Cli, Instrument};
use commands::{host_cost, machines, work_precision};

fn main() -> ExitCode {
    let cli = match rattlemap::cli::parsed::<Cli>() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let result = match cli.instrument {
        Instrument::WorkPrecision(arguments) => work_precision::run(&arguments),
        Instrument::HostCost(arguments) => host_cost::run(&arguments),
        Instrument::Machines(arguments) => machines::run(&arguments),
    };
    result.map_or_else(|failure| failure.report(), |()| ExitCode::SUCCESS)
}
