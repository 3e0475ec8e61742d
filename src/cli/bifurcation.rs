//! `rattlemap bifurcation`: how the attractor changes along one axis.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::anyhow;
use rattlemap_dynamics::orbit::Class;

use super::arguments::Bifurcation;
use super::interrupt::Interrupt;
use super::progress::Progress;
use crate::cli::say;
use crate::findings::hysteresis::{self, Hysteresis};
use crate::job::error::{Failure, fail_if};
use crate::job::scene_file;
use crate::map::{bifurcation, plan, scene};
use crate::store;
use crate::store::folder::Folder;

pub(crate) fn run(ask: &Bifurcation) -> Result<(), Failure> {
    let (along, out) = (ask.along(), ask.out());
    let (along, purpose) = (along.as_ref(), scene::Purpose::Bifurcation);
    let ask = &scene_file::with_figures(&ask.run, purpose, along)?;
    let scene = scene_file::load_along(&ask.scene, &ask.set, purpose, along)?;
    plan::check_line(&scene)?;
    let interrupt = Interrupt::listen(ask.quiet)?;
    let folder = Folder::open(&out, ask.force)?;
    folder.refuse_links(store::bifurcation::names())?;
    let cells = scene.line();
    let count = bifurcation::column_count(cells.len(), scene.start());
    let progress = Progress::new(count, 0, "columns", ask.quiet);
    let clock = Instant::now();
    let ended = AtomicUsize::new(0);
    let report = |done| {
        ended.fetch_max(done, Ordering::Relaxed);
        progress.report(done, count);
    };
    let (start, settings, halt) = (scene.start(), scene.orbit_settings(), interrupt.raised());
    let columns = bifurcation::run_until(&cells, start, &settings, &report, halt)?;
    // A signal may come with the last column.
    let Some(columns) = columns.filter(|_| !interrupt.is_raised()) else {
        let (ended, all, path) = (ended.into_inner(), count, folder.path().display());
        let words = anyhow!(
            "interrupted after {ended} of {all} columns, and none is kept; nothing was written to {path}"
        );
        return Err(interrupt.failure(words));
    };
    let asked = store::bifurcation::DiagramArguments { sets: &ask.set, along };
    let elapsed = clock.elapsed();
    let files = store::bifurcation::write(&folder, &scene, asked, &columns, elapsed)?;
    let [periodic, chaotic, undecided, failed] =
        plan::count_classes(columns.iter().map(|column| column.class));
    let classes = format!(
        "{count} columns in {:.3} s: {periodic} periodic, {chaotic} chaotic, {undecided} undecided, {failed} failed",
        elapsed.as_secs_f64()
    );
    let name = &scene.axes()[0].parameter().name;
    let differing = hysteresis::hysteresis(&columns).map(|found| format!("{}\n", told(&found, name)));
    let files = format!("{}: {}", say::path(folder.path()), files.join(", "));
    progress.finish(&format!("{classes}\n{}{files}", differing.unwrap_or_default()));
    let all_failed = columns.iter().all(|column| column.class == Class::Failed);
    fail_if(all_failed, "every column failed; the status column says why")
}

/// Ranges that a message names; the manifest has all.
const NAMED: usize = 6;

/// Where the two passes disagree.
fn told(found: &Hysteresis, name: &str) -> String {
    let Hysteresis { columns, differing, ranges, by_pattern, pattern_ranges } = found;
    let by_class = match differing {
        0 => format!("up and down have the same class and period in all {columns} columns"),
        _ => format!(
            "up and down differ by class or period in {differing} of {columns} columns, at {name} = {}",
            listed(ranges)
        ),
    };
    match by_pattern {
        0 => by_class,
        _ => {
            format!(
                "{by_class}\nby pattern alone they differ in {by_pattern}, at {name} = {}",
                listed(pattern_ranges)
            )
        }
    }
}

fn listed(ranges: &[[f64; 2]]) -> String {
    let range = |[first, last]: &[f64; 2]| match first == last {
        true => format!("{first:?}"),
        false => format!("{first:?} to {last:?}"),
    };
    let mut list: Vec<String> = ranges.iter().take(NAMED).map(range).collect();
    if ranges.len() > NAMED {
        list.push(format!("and {} more", ranges.len() - NAMED));
    }
    list.join(", ")
}
