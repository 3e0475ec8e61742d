//! The instruments' command line.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand};
use rattlemap_bench::stress::Part;
use rattlemap_bench::work_precision::measure::Method;

/// Instruments of rattlemap: numerical stress, run time against error.
///
/// Each writes tables (CSV), figures (PNG) and manifest.json to a folder of its own.
#[derive(Debug, Parser)]
#[command(version, bin_name = "rattlemap-bench", arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) instrument: Instrument,
}

/// What is measured.
#[derive(Debug, Subcommand)]
pub(crate) enum Instrument {
    WorkPrecision(WorkPrecision),
    Stress(Stress),
    Scale(Scale),
}

/// Error of strobe states and event times against run time per period, for every method
///
/// Lanes in f32 and f64, classical Runge-Kutta in WGSL and on one core, semi-implicit Euler,
/// DOP853 and the reference integrate the same cells; methods take turns. Writes
/// work_precision.csv, a figure each for the worst and the median cell and for event times,
/// cells.json for programs outside (benches/peers) and manifest.json, and prints the ratios of
/// run time at equal error. Takes minutes, and wants an idle machine.
#[derive(Debug, Args)]
pub(crate) struct WorkPrecision {
    #[command(flatten)]
    pub(crate) run: Options,

    /// Methods to measure, comma-separated, such as lane-f64,rk4-core; all unless given
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = method)]
    pub(crate) methods: Vec<Method>,

    /// Times that everything is measured
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) rounds: u32,

    /// Copies of each cell's lanes on a device; as many as fill it unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) copies: Option<u32>,

    /// Results of other programs on the same cells, made by benches/peers/run.sh, to draw and compare
    #[arg(long, value_name = "CSV")]
    pub(crate) peers: Option<PathBuf>,
}

fn method(text: &str) -> Result<Method, String> {
    let names = Method::ALL.map(Method::name);
    let named = Method::ALL.into_iter().find(|method| method.name() == text);
    named.ok_or_else(|| format!("it must be one of {}", names.join(", ")))
}

/// Long runs, impacts, grazing, chatter, stiff meshing, coarse grids and random parameters on every engine
#[derive(Debug, Args)]
pub(crate) struct Stress {
    #[command(flatten)]
    pub(crate) run: Options,

    /// Run this part, and others named so; all unless given. fuzz, random parameters, takes longest
    #[arg(long = "part", value_name = "NAME", value_parser = part)]
    pub(crate) parts: Vec<Part>,
}

fn part(text: &str) -> Result<Part, String> {
    let names = Part::ALL.map(Part::name);
    let named = Part::ALL.into_iter().find(|part| part.name() == text);
    named.ok_or_else(|| format!("it must be one of {}", names.join(", ")))
}

/// Seconds, memory and disk that a large map takes beside its motions, in shards that are merged
///
/// A small map is integrated on the processor; its records, stretched and changed a little, are those of the large one.
/// Writes the shards, merges them, and writes seconds and largest memory by phase to scale.csv, sizes of files to
/// files.csv. 10^7 cells take a minute or two, and some 3 GB of disk.
#[derive(Debug, Args)]
pub(crate) struct Scale {
    #[command(flatten)]
    pub(crate) run: Options,

    /// Cells along the first axis
    #[arg(long, value_name = "N", default_value_t = 3162, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub(crate) columns: u32,

    /// And along the second
    #[arg(long, value_name = "N", default_value_t = 3163, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub(crate) rows: u32,

    /// Shards that it is dealt out to
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) shards: u32,

    /// Times that they are put together
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub(crate) rounds: u32,

    /// Ask for every quantity; class and exponent alone unless given
    #[arg(long)]
    pub(crate) all: bool,
}

/// Where measurements go, and how thorough they are.
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Where to write [default: out/bench/<what is measured>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Replace the files of an earlier run; without it a folder that is not empty is refused
    #[arg(long)]
    pub(crate) force: bool,

    /// Tiny sizes: does everything work? The figures mean nothing
    #[arg(long)]
    pub(crate) quick: bool,

    /// Say nothing unless something is wrong
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl Options {
    /// The folder to write to.
    pub(crate) fn out(&self, what: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out/bench").join(what))
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
