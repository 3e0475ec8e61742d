//! The command line of the instruments.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand};
use rattlemap_bench::work_precision::measure::Method;

/// Instruments of rattlemap: run time against error, cost of the host.
///
/// Each writes tables (CSV), figures (PNG) and manifest.json to a folder of its own.
#[derive(Debug, Parser)]
#[command(version, bin_name = "rattlemap-bench", arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) instrument: Instrument,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Instrument {
    WorkPrecision(WorkPrecision),
    HostCost(HostCost),
    Machines(Machines),
}

/// Error of strobe states and event times against run time per period, for every method
///
/// All methods integrate the same cells: lanes in f32 and f64, classical Runge-Kutta in WGSL and on one core,
/// DOP853 and the reference. Methods run alternately. Writes work_precision.csv, figures for the worst
/// cell, the median cell and event times, cells.json for other programs (benches/peers) and manifest.json. Prints the
/// ratios of run time at equal error. Takes minutes and needs an idle machine.
#[derive(Debug, Args)]
pub(crate) struct WorkPrecision {
    #[command(flatten)]
    pub(crate) run: Options,

    /// Methods to measure, comma-separated, such as lane-f64,rk4-core [default: all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = |text: &str| named(&Method::ALL, text))]
    pub(crate) methods: Vec<Method>,

    /// Number of rounds that are timed
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) rounds: u32,

    /// Copies of each cell's lanes on a device [default: as many as fill it]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) copies: Option<u32>,

    /// Results of other programs for the same cells, written by benches/peers/run.sh, to draw and compare
    #[arg(long, value_name = "CSV")]
    pub(crate) peers: Option<PathBuf>,
}

fn named<T: Copy>(all: &[(T, &'static str)], text: &str) -> Result<T, String> {
    let found = all.iter().find(|(_, name)| *name == text).map(|(item, _)| *item);
    let names: Vec<&str> = all.iter().map(|(_, name)| *name).collect();
    found.ok_or_else(|| format!("it must be one of {}", names.join(", ")))
}

/// Time that a map costs the host, by phase, and the work that a device receives
///
/// All motions of the map end after one forcing period, so that lanes cost next to nothing. Prints wall time, processor time of
/// all threads and that of the main thread for each phase, per million cells, and the device's dispatches, submissions and
/// waits. Writes host_cost.csv, and the map into a folder of its own. manifest.json there has the time of each file.
///
/// Without --gpu, the processor's engine then computes the same cells alone. Row `lanes` is its time. Row `host` is the sum of all
/// phases minus `lanes`.
#[derive(Debug, Args)]
pub(crate) struct HostCost {
    #[command(flatten)]
    pub(crate) run: Options,

    /// Number of cells along the first axis
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub(crate) columns: u32,

    /// Number of cells along the second axis
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub(crate) rows: u32,

    /// Request every quantity instead of class and exponent
    #[arg(long)]
    pub(crate) all: bool,

    /// Compute lanes on the best graphics device, in f32, instead of the reference on the processor
    #[arg(long)]
    pub(crate) gpu: bool,
}

/// Time of the reference on a chain of masses, whose cells other programs read
///
/// Integrates a chain of four masses with two gaps on one core. Writes machines.json: the machine, the starts and results of its
/// cells, and the time per forcing period of a cell.
#[derive(Debug, Args)]
pub(crate) struct Machines {
    #[command(flatten)]
    pub(crate) run: Options,
}

/// Options of all instruments.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Folder for the results [default: out/bench/<instrument>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Replace the files of an earlier run; without it a folder that is not empty is refused
    #[arg(long)]
    pub(crate) force: bool,

    /// Use tiny sizes, to check that everything works; the figures mean nothing
    #[arg(long)]
    pub(crate) quick: bool,

    /// Print only errors
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl Options {
    /// Returns the folder for the results.
    pub(crate) fn out(&self, instrument: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out/bench").join(instrument))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
