//! `rattlemap map` of a scene with a sample of starts: the shares of attractors.

use std::time::Instant;

use anyhow::anyhow;

use super::arguments::Map;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::progress::Progress;
use super::say;
use crate::job::engine_choice;
use crate::job::error::JobError;
use crate::job::map::MapJob;
use crate::map::shares::{self, Names, SharesError, Watch};
use crate::store::folder::Folder;
use crate::store::shares::{DoneCells, SharesRun, names, write};

/// Number of attractors that the summary lists.
const LISTED: usize = 6;

/// Runs the starts of all cells, and writes the files.
pub(crate) fn run(arguments: &Map, job: &MapJob<'_>) -> Result<(), Failure> {
    let (options, out) = (&arguments.run, arguments.out());
    let refused = [
        (arguments.shard.is_some(), "--shard"),
        (arguments.dry_run, "--dry-run"),
        (arguments.json, "--json"),
    ];
    if let Some((_, option)) = refused.into_iter().find(|(is_given, _)| *is_given) {
        return Err(Failure::Usage(anyhow!(
            "{option}: maps of shares (start.sample) do not have this option"
        )));
    }
    job.check(Some(&out))?;
    let plan = job.plan()?;
    let interrupt = Interrupt::listen(options.quiet)?;
    let folder = Folder::open(&out, options.force || arguments.resume)?;
    folder.prepare(names())?;
    let chosen = pollster::block_on(engine_choice::open(&plan, &job.engine)).map_err(JobError::from)?;
    let mut engine = chosen.engine;
    let named = [engine.name(), engine.precision()];
    let (mut file, mut cells) = DoneCells::open(&folder, (job.scene, named), arguments.resume)?;
    let mut is_done = vec![false; plan.cell_count()];
    cells.iter().for_each(|cell| is_done[cell.cell as usize] = true);
    let progress = Progress::new(plan.cell_count(), cells.len(), "cells", options.quiet);
    let clock = Instant::now();
    let mut done = |new: &[shares::CellShares]| {
        file.add(new)?;
        cells.extend_from_slice(new);
        progress.report(cells.len(), plan.cell_count());
        Ok(())
    };
    let watch = Watch { done: &mut done, halt: interrupt.raised() };
    let is_finished = shares::run(job.scene, &plan, &mut engine, |id| is_done[id as usize], watch);
    let is_finished = is_finished.map_err(|error| match error {
        SharesError::Engine(error) => JobError::Failed(error.to_string()),
        SharesError::Store(error) => JobError::Failed(error.to_string()),
    })?;
    if !is_finished {
        let (done, count, path) = (cells.len(), plan.cell_count(), folder.path().display());
        let text =
            format!("interrupted; {done} of {count} cells are in {path}, and --resume computes the others");
        return Err(interrupt.failure(text));
    }
    cells.sort_by_key(|cell| cell.cell);
    let of = Names::of(&cells, plan.counts()[0]);
    let elapsed = clock.elapsed();
    let run = SharesRun { engine: named, sets: job.sets, elapsed };
    let files = write(&folder, (job.scene, &plan), &cells, &of, &run)?;
    let starts: u64 = cells.iter().map(|cell| u64::from(cell.count)).sum();
    let several = cells.iter().filter(|cell| cell.attractors.len() > 1).count();
    let mut lines = vec![format!(
        "{} cells, {starts} starts in {:.1} s; {several} cells have several attractors",
        cells.len(),
        elapsed.as_secs_f64()
    )];
    lines.extend(of.list.iter().take(LISTED).map(|name| {
        format!("{:>6.2} % of all starts: {} ({} cells)", 100.0 * name.share, name.text(), name.cells)
    }));
    lines.extend(
        of.list
            .len()
            .checked_sub(LISTED)
            .filter(|more| *more > 0)
            .map(|more| format!("and {more} more attractors; share_attractors.csv lists them")),
    );
    progress.finish(&format!("{}\n{}: {}", lines.join("\n"), say::path(folder.path()), files.join(", ")));
    if !options.quiet {
        say::removed(&folder);
    }
    Ok(())
}
