//! `work-precision`: measures the methods, writes the files and prints the ratios.

use anyhow::Context;
use rattlemap::store::folder::Folder;
use rattlemap_bench::work_precision::cells::subjects;
use rattlemap_bench::work_precision::measure::{Curve, Method, ONE_CORE, Thoroughness, measure};
use rattlemap_bench::work_precision::output::{FILES, Run, write};
use rattlemap_bench::work_precision::points::{self, Point};
use rattlemap_bench::work_precision::ratio::sentences;

use crate::arguments::WorkPrecision;
use rattlemap::cli::Progress;
use rattlemap::cli::failure::{Failure, fail_if};
use rattlemap::job::processor::{cores, name};

/// Number of cells of each kind.
const CELLS: usize = 5;

/// Shortest time, in seconds, that a method on a core runs in one round.
const LEAST_SECONDS: f64 = 0.1;

pub(crate) fn run(arguments: &WorkPrecision) -> Result<(), Failure> {
    let peers = match &arguments.peers {
        Some(path) => points::read(path).map_err(Failure::Usage)?,
        None => Vec::new(),
    };
    let dir = arguments.run.out("work-precision");
    let folder = Folder::open(&dir, arguments.run.force)?;
    folder.remove(&FILES)?;
    let quick = arguments.run.quick;
    let subjects = subjects(if quick { 1 } else { CELLS });
    let all = Method::ALL.map(|(method, _)| method);
    let methods = if arguments.methods.is_empty() { &all[..] } else { &arguments.methods[..] };
    let how = Thoroughness {
        rounds: if quick { 1 } else { arguments.rounds as usize },
        copies: if quick { Some(1) } else { arguments.copies.map(|copies| copies as usize) },
        quick,
        least_seconds: if quick { 0.0 } else { LEAST_SECONDS },
    };
    let progress = Progress::new(1, 0, "runs", arguments.run.quiet);
    let curves = measure(&subjects, methods, how, &|done, all| progress.report(done, all))
        .context("the device for lanes failed")?;
    let ours: Vec<Point> = curves.iter().map(|curve: &Curve| curve.point.clone()).collect();
    let all: Vec<Point> = ours.iter().chain(&peers).cloned().collect();
    let ratios = sentences(&all);
    let is_measured = |name: &&str| ours.iter().any(|point| point.method == *name);
    let omitted: Vec<&str> = methods.iter().map(|m| m.name()).filter(|name| !is_measured(name)).collect();
    let adapter = ours.iter().find(|point| point.device != ONE_CORE);
    let run = Run {
        processor: &name().unwrap_or_else(|| "processor".to_owned()),
        cores: cores(),
        adapter: adapter.map_or("no device", |point| &point.device),
        rounds: how.rounds,
        quick,
        ratios: &ratios,
    };
    write(&folder, &run, &subjects, &curves, &peers)?;
    let mut text = summary(&all, &ratios);
    if !omitted.is_empty() {
        text += &format!("\nnot measured, because no adapter has double precision: {}", omitted.join(", "));
    }
    progress.finish(&format!("{text}\n{}: {}", dir.display(), FILES.join(", ")));
    fail_if(ours.is_empty(), "nothing was measured, because no adapter has double precision")
}

fn summary(points: &[Point], ratios: &[String]) -> String {
    let mut lines = vec![format!(
        "{:<14} {:>8} {:>12} {:>19} {:>9} {:>9} {:>9} {:>9}",
        "method", "setting", "us/period", "fastest - slowest", "worst", "median", "events", "cores"
    )];
    lines.extend(points.iter().map(|p| {
        let setting = match (p.steps, p.tolerance) {
            (Some(steps), _) => steps.to_string(),
            (None, Some(tolerance)) => format!("{tolerance:.0e}"),
            (None, None) => "-".to_owned(),
        };
        let cores = p.cores.map_or_else(|| "device".to_owned(), |cores| cores.to_string());
        let spread = format!("{:.3} - {:.3}", 1e6 * p.fastest, 1e6 * p.slowest);
        format!(
            "{:<14} {setting:>8} {:>12.3} {spread:>19} {:>9.1e} {:>9.1e} {:>9.1e} {cores:>9}",
            p.method,
            1e6 * p.seconds_per_lane_period,
            p.state_error_worst,
            p.state_error_median,
            p.event_error_worst
        )
    }));
    lines.extend(ratios.iter().cloned());
    lines.join("\n")
}
