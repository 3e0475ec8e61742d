//! `rattlemap validate`: computes a sample of a finished map's cells again.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use crate::cli::arguments::{JudgeChoice, Validate};
use crate::cli::console::Console;
use crate::cli::failure::Failure;
use crate::cli::interrupt::Interrupt;
use crate::cli::say;
use crate::job::observer::Observer;
use crate::job::validate::ValidateJob;
use crate::validate::Judge;

/// Reads the map, computes the sample again, and writes the comparison.
pub(crate) fn run(arguments: &Validate) -> Result<(), Failure> {
    let (clock, quiet) = (Instant::now(), arguments.quiet);
    let interrupt = Interrupt::listen(quiet)?;
    let console = Console::new(quiet, "cells replayed", false);
    let Validate { folder, samples, seed, chaos_periods, .. } = arguments;
    let job = ValidateJob::open(folder, *samples as usize, *seed, *chaos_periods, &console)?;
    let (dir, count, followed) = (job.folder().path(), job.sample_count(), job.followed_count());
    console.note(&format!(
        "computing {count} different cells of the map again, on a graphics device if there is one"
    ));
    let path = dir.display();
    let nothing = format!("none of {count} cells was replayed, and nothing was written to {path}");
    interrupt.ends_at_once(nothing, job.folder().leaver());
    let stopped = |replayed: usize| {
        let text = format!(
            "interrupted after {replayed} of {} cells, and nothing was written to {path}",
            count + followed
        );
        interrupt.failure(text)
    };
    let judge = arguments.judge.map(|judge| match judge {
        JudgeChoice::Lanes => Judge::Lanes,
        JudgeChoice::Solver => Judge::Independent,
    });
    let lanes = job.run_lanes(judge, &console, interrupt.raised());
    if !interrupt.wait_for(None) {
        return Err(stopped(0));
    }
    let lanes = lanes?;
    console.note(&format!("replaying {count} cells without early stops: each may take its whole budget"));
    if followed > 0 {
        console.note(&format!("then following {followed} chaotic cells for {chaos_periods} further periods"));
    }
    console.progress(0, count + followed);
    let replayed = AtomicUsize::new(0);
    let report = |done| {
        replayed.store(done, Ordering::Relaxed);
        console.progress(done, count + followed);
    };
    let validation = job
        .replay(&lanes, &report, interrupt.raised())
        .ok_or_else(|| stopped(replayed.load(Ordering::Relaxed)))?;
    let validated = job.validated(&lanes, &validation);
    let files = job.write(&validated, clock.elapsed())?;
    let mut lines: Vec<String> =
        validated.rates().into_iter().chain(validated.remarks()).map(say::quoted).collect();
    lines.push(format!("{}: {}", say::path(dir), files.join(", ")));
    // The error of a map that fails says the same.
    lines.extend(validation.faults().is_empty().then(|| validated.verdict()));
    console.finish(&lines.join("\n"));
    Ok(job.require_valid(&validation, &files)?)
}
