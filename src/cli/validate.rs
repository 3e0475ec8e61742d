//! `rattlemap validate`: computes a sample of a finished map's cells again.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use crate::cli::arguments::Validate;
use crate::cli::console::Console;
use crate::cli::failure::Failure;
use crate::cli::interrupt::Interrupt;
use crate::cli::say;
use crate::job::observer::Observer;
use crate::job::validate::{SampleLanes, ValidateJob};
use crate::validate::{HORIZON, HalfMesh, Judge, Kind, StratumResult, Validation};

/// Reads the map, computes the sample again, and writes the comparison.
pub(crate) fn run(arguments: &Validate) -> Result<(), Failure> {
    let (clock, quiet) = (Instant::now(), arguments.quiet);
    let interrupt = Interrupt::listen(quiet)?;
    let console = Console::new(quiet, "cells replayed", false);
    let Validate { folder, samples, seed, .. } = arguments;
    let job = ValidateJob::open(folder, *samples as usize, *seed, &console)?;
    let (dir, count) = (job.folder().path(), job.sample_count());
    console.note(&format!("computing {count} cells of the map again, on a graphics device if there is one"));
    let path = dir.display();
    let nothing = format!("none of {count} cells was replayed, and nothing was written to {path}");
    interrupt.ends_at_once(nothing, job.folder().leaver());
    let stopped = |replayed: usize| {
        let text =
            format!("interrupted after {replayed} of {count} cells, and nothing was written to {path}");
        interrupt.failure(text)
    };
    let lanes = job.run_lanes(interrupt.raised());
    if !interrupt.wait_for(None) {
        return Err(stopped(0));
    }
    let lanes = lanes?;
    console.note(&format!("replaying {count} cells without early stops: each may take its whole budget"));
    console.progress(0, count);
    let replayed = AtomicUsize::new(0);
    let report = |done| {
        replayed.fetch_max(done, Ordering::Relaxed);
        console.progress(done, count);
    };
    let validation = job
        .replay(&lanes, &report, interrupt.raised())
        .ok_or_else(|| stopped(replayed.load(Ordering::Relaxed)))?;
    let files = job.write(&lanes, &validation, clock.elapsed())?;
    let summary = summary(&validation, &lanes);
    console.finish(&format!("{summary}\n{}: {}", say::path(dir), files.join(", ")));
    Ok(job.require_valid(&validation, &files)?)
}

/// One line per stratum with its rates, then other results.
fn summary(validation: &Validation, lanes: &SampleLanes) -> String {
    let mut lines: Vec<String> =
        validation.strata.iter().filter(|stratum| stratum.sampled > 0).map(rates).collect();
    let judge = match validation.judge {
        Judge::Reference => "the event-driven reference, without early stops".to_owned(),
        Judge::Lanes => {
            let device = lanes.device().map_or("a device".to_owned(), say::quoted);
            format!("lanes in f64 on {device}, and the reference")
        }
        Judge::Independent => "DOP853 with event location, and the reference".to_owned(),
    };
    lines.push(format!("judge: {judge}"));
    let [same, count] = validation.again;
    if count > 0 {
        lines.push(format!("same engine again: {same} of {count} records are the same to the bit"));
    }
    if let Some(states) = &validation.states {
        let (off, compared) = (states.off.len(), states.compared);
        let rate = states.rate().text();
        lines.push(format!("states after {HORIZON} periods: {off} of {compared} lanes are wrong ({rate})"));
    }
    if let Some(half) = &validation.half_mesh {
        let HalfMesh { classes, periods, words, patterns } = half;
        lines.push(format!(
            "half the mesh_speed changes the class of {} of {} meshing {}; among {} cycles it changes the period of {}, the word \
             of {}, the pattern of {}",
            classes.count,
            classes.among,
            validation.counted(),
            periods.among,
            periods.count,
            words.count,
            patterns.count
        ));
    }
    if validation.filled > 0 {
        let (filled, runs) = (validation.filled, validation.runs);
        lines.push(format!("{filled} of {runs} were filled, not integrated; they are not replayed"));
    }
    lines.extend(lanes.note.as_ref().map(say::quoted));
    lines.join("\n")
}

/// Number of differing cells of a stratum, by kind.
fn rates(stratum: &StratumResult) -> String {
    let differing = stratum.differing();
    let kinds: Vec<String> = Kind::ALL
        .into_iter()
        .filter(|&kind| kind != Kind::Unexplained && stratum.rate(kind).count > 0)
        .map(|kind| format!("{} {}", kind.name(), stratum.rate(kind).count))
        .collect();
    let kinds = if kinds.is_empty() { String::new() } else { format!("; {}", kinds.join(", ")) };
    let unexplained = stratum.rate(Kind::Unexplained);
    format!(
        "{}: {} of {} cells differ ({}); unexplained {} ({}){kinds}",
        stratum.stratum.name(),
        differing.count,
        stratum.sampled,
        differing.text(),
        unexplained.count,
        unexplained.text()
    )
}
