//! `work-precision`: cells, methods in turns, files, ratios.

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

/// Cells of every kind.
const CELLS: usize = 5;

/// Least time, in seconds, that a method on a core is timed for in one round.
const LEAST_SECONDS: f64 = 0.1;

pub(crate) fn run(ask: &WorkPrecision) -> Result<(), Failure> {
    let peers = match &ask.peers {
        Some(path) => points::read(path).map_err(Failure::Usage)?,
        None => Vec::new(),
    };
    let dir = ask.run.out("work-precision");
    let folder = Folder::open(&dir, ask.run.force)?;
    folder.remove(&FILES)?;
    let quick = ask.run.quick;
    let subjects = subjects(if quick { 1 } else { CELLS });
    let methods = if ask.methods.is_empty() { &Method::ALL[..] } else { &ask.methods[..] };
    let how = Thoroughness {
        rounds: if quick { 1 } else { ask.rounds as usize },
        copies: if quick { Some(1) } else { ask.copies.map(|copies| copies as usize) },
        quick,
        least_seconds: if quick { 0.0 } else { LEAST_SECONDS },
    };
    let progress = Progress::new(1, 0, "runs", ask.run.quiet);
    let curves = measure(&subjects, methods, how, &|done, all| progress.report(done, all))
        .context("cannot measure lanes")?;
    let ours: Vec<Point> = curves.iter().map(|curve: &Curve| curve.point.clone()).collect();
    let all: Vec<Point> = ours.iter().chain(&peers).cloned().collect();
    let ratios = sentences(&all);
    let measured = |method: &&Method| ours.iter().any(|point| point.method == method.name());
    let left_out: Vec<&str> = methods.iter().filter(|m| !measured(m)).map(|m| m.name()).collect();
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
    let mut said = summary(&all, &ratios);
    if !left_out.is_empty() {
        said += &format!("\nleft out, no adapter has double precision: {}", left_out.join(", "));
    }
    progress.finish(&format!("{said}\n{}: {}", dir.display(), FILES.join(", ")));
    fail_if(ours.is_empty(), "nothing was measured: no adapter has double precision")
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
