//! `rattlemap bifurcation`: how the attractor changes along one axis.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::anyhow;
use rattlemap_dynamics::orbit::Class;

use super::arguments::Bifurcation;
use super::error::{Failure, fail_if};
use super::interrupt::Interrupt;
use super::progress::Progress;
use super::{say, scene_file};
use crate::map::{bifurcation, plan, scene};
use crate::output::{self, Folder};

pub(crate) fn run(ask: &Bifurcation) -> Result<(), Failure> {
    let ask = &scene_file::with_figures(&ask.run, scene::Purpose::Bifurcation)?;
    let scene = scene_file::load(&ask.scene, &ask.set, scene::Purpose::Bifurcation)?;
    plan::check_line(&scene)?;
    let interrupt = Interrupt::listen(ask.quiet)?;
    let folder = Folder::open(&ask.out(), ask.force)?;
    folder.refuse_links(output::bifurcation::NAMES)?;
    let cells = scene.line();
    let progress = Progress::new(cells.len(), 0, "columns", ask.quiet);
    let clock = Instant::now();
    let ended = AtomicUsize::new(0);
    let report = |done| {
        ended.fetch_max(done, Ordering::Relaxed);
        progress.report(done, cells.len());
    };
    let (start, settings, halt) = (scene.start(), scene.orbit_settings(), interrupt.raised());
    let Some(columns) = bifurcation::run_until(&cells, start, &settings, &report, halt)? else {
        let (ended, all, path) = (ended.into_inner(), cells.len(), folder.path().display());
        let words = anyhow!(
            "interrupted after {ended} of {all} columns, and none is kept; nothing was written to {path}"
        );
        return Err(interrupt.failure(words));
    };
    let files = output::bifurcation::write(&folder, &scene, &ask.set, &columns, clock.elapsed())?;
    progress.finish(&format!("{}: {}", say::path(folder.path()), files.join(", ")));
    let all_failed = columns.iter().all(|column| column.class == Class::Failed);
    fail_if(all_failed, "every column failed; the status column says why")
}
