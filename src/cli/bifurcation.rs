//! `rattlemap bifurcation`: computes how the motion changes along one axis.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rattlemap_dynamics::number::significant;
use rattlemap_dynamics::orbit::Class;

use super::arguments::{Bifurcation, figures};
use super::failure::{Failure, fail_if};
use super::interrupt::Interrupt;
use super::progress::Progress;
use crate::cli::say;
use crate::findings::hysteresis::{self, Hysteresis};
use crate::job::scene_file::SceneFile;
use crate::map::branches::{self, Branches};
use crate::map::scene::Purpose;
use crate::map::{bifurcation, plan};
use crate::store;
use crate::store::bifurcation::DiagramArguments;
use crate::store::folder::Folder;
use crate::store::inventory::figure_formats;

/// Largest number of ranges that a message lists; the manifest lists all.
const LISTED_RANGES: usize = 6;

/// Computes every column, and writes the diagram.
pub(crate) fn run(arguments: &Bifurcation) -> Result<(), Failure> {
    let (along, options) = (arguments.along(), &arguments.run);
    let along = along.as_ref();
    let file = SceneFile { purpose: Purpose::Bifurcation, along, ..SceneFile::map(&options.scene) };
    let (out, figures) = (arguments.out(), figures(&options.format));
    let stored = if figures.is_empty() { Vec::new() } else { figure_formats(&out, "bifurcation") };
    let sets = file.with_formats([options.set.clone(), options.figure.sets()].concat(), &figures, &stored)?;
    let scene = file.load(&sets)?;
    plan::check_line(&scene)?;
    let interrupt = Interrupt::listen(options.quiet)?;
    let folder = Folder::open(&out, options.force)?;
    folder.prepare(store::bifurcation::names())?;
    let cells = scene.line();
    let count = bifurcation::column_count(cells.len(), scene.start());
    let progress = Progress::new(count, 0, "columns", options.quiet);
    let clock = Instant::now();
    let ended = AtomicUsize::new(0);
    let report = |done| {
        ended.fetch_max(done, Ordering::Relaxed);
        progress.report(done, count);
    };
    let (start, settings, halt) = (scene.start(), scene.orbit_settings(), interrupt.raised());
    let columns = bifurcation::run_until(&cells, start, &settings, &report, halt)?;
    // A signal may arrive during the last column.
    let Some(columns) = columns.filter(|_| !interrupt.is_raised()) else {
        let (ended, path) = (ended.into_inner(), folder.path().display());
        return Err(interrupt.failure(format!(
            "interrupted after {ended} of {count} columns; nothing was written to {path}"
        )));
    };
    let name = &scene.axes()[0].parameter().name;
    let branches =
        arguments.branches.then(|| branches::branches(&cells, &columns, name, halt)).transpose()?;
    let elapsed = clock.elapsed();
    let files = store::bifurcation::write(
        &folder,
        &scene,
        DiagramArguments { sets: &sets, along },
        (&columns, branches.as_ref()),
        elapsed,
    )?;
    let classes = say::classes(plan::count_classes(columns.iter().map(|column| column.class)));
    let hysteresis = hysteresis::hysteresis(&columns).map(|found| format!("{}\n", described(&found, name)));
    progress.finish(&format!(
        "{count} columns in {:.3} s: {classes}\n\
         {}{}{}: {}",
        elapsed.as_secs_f64(),
        hysteresis.unwrap_or_default(),
        branches.as_ref().map_or(String::new(), |branches| followed(branches, name)),
        say::path(folder.path()),
        files.join(", ")
    ));
    if !options.quiet {
        say::removed(&folder);
    }
    let all_failed = columns.iter().all(|column| column.class == Class::Failed);
    fail_if(all_failed, "the motion failed in every column; `status` in bifurcation_columns.csv says why")
}

/// Describes the branches that were followed.
fn followed(branches: &Branches, name: &str) -> String {
    let count = branches.rows.last().map_or(0, |row| row.branch);
    let special = branches.rows.iter().filter(|row| row.special.is_some()).count();
    let end = |(branch, value, reason): &(usize, f64, String)| {
        format!("branch {branch} ends at {name} = {}: {reason}\n", significant(*value))
    };
    let ends: String = branches.ends.iter().map(end).collect();
    format!("{count} branches with {special} special points\n{ends}")
}

/// Describes where the two passes differ.
fn described(found: &Hysteresis, name: &str) -> String {
    let Hysteresis { columns, differing, ranges, .. } = found;
    let by_class = match differing {
        0 => format!("up and down have the same class and period in all {columns} columns"),
        _ => format!(
            "up and down differ by class or period in {differing} of {columns} columns, at {name} = {}",
            listed(ranges)
        ),
    };
    let by = [
        ("pattern", found.by_pattern, &found.pattern_ranges),
        ("quantities", found.by_quantity, &found.quantity_ranges),
    ];
    let others = by.into_iter().filter(|(_, count, _)| *count > 0).map(|(what, count, ranges)| {
        format!("\nup and down differ only by {what} in {count} columns, at {name} = {}", listed(ranges))
    });
    [by_class].into_iter().chain(others).collect()
}

fn listed(ranges: &[[f64; 2]]) -> String {
    let range = |[first, last]: &[f64; 2]| match first == last {
        true => significant(*first),
        false => format!("{} to {}", significant(*first), significant(*last)),
    };
    let mut list: Vec<String> = ranges.iter().take(LISTED_RANGES).map(range).collect();
    if ranges.len() > LISTED_RANGES {
        list.push(format!("and {} more", ranges.len() - LISTED_RANGES));
    }
    list.join(", ")
}
