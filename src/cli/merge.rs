//! `rattlemap merge`: the shards of a map in, the map out.

use std::path::Path;
use std::sync::atomic::Ordering;

use anyhow::anyhow;

use super::arguments::Merge;
use super::interrupt::Interrupt;
use super::progress;
use super::say;
use super::stdout::print_json;
use crate::job::capacity;
use crate::job::error::{Failure, fail_if};
use crate::store;
use crate::store::folder::Folder;
use crate::store::merge::{MergeError, MergedMap, Parts, Progress};

/// Looks at all shards, gathers their records, writes the map.
pub(crate) fn run(ask: &Merge) -> Result<(), Failure> {
    let interrupt = Interrupt::listen(ask.quiet)?;
    let parts = Parts::open(&ask.parts)?;
    parts.refuse(&ask.out)?;
    capacity::fits_merged(parts.scene(), Some(&ask.out))?;
    // A run that ended before it kept anything has left nothing else.
    let folder = Folder::open(&ask.out, ask.force || !Folder::holds_results(&ask.out))?;
    folder.refuse_links(store::map::names())?;
    let (shards, out) = (parts.count(), ask.out.display());
    let progress = progress::Progress::new(parts.scene().run_count().max(1) as usize, 0, "runs", ask.quiet);
    let go_on = |Progress { done, of }| {
        progress.report(done, of);
        !interrupt.raised().load(Ordering::Relaxed)
    };
    interrupt.wait_for(Some("a batch is read"));
    let gathered = parts.gather(&folder, go_on).map_err(|error| match error {
        MergeError::Stopped => interrupt.failure(anyhow!("interrupted, and nothing was written to {out}")),
        error => error.into(),
    })?;
    let (runs, again) = (gathered.run_count(), ask.again());
    interrupt.ends_at_once(format!("all {runs} runs are in {out}; make its files with: {again}"), || {});
    let merged = gathered.write(&folder)?;
    for warning in &merged.warnings {
        say::note(format_args!("warning: {warning}"));
    }
    progress.finish(&told(&merged, shards, runs, folder.path()));
    if ask.json {
        print_json(&merged.object)?;
    }
    let [periodic, chaotic, undecided, failed] = merged.classes;
    let all_failed = failed > 0 && periodic + chaotic + undecided == 0;
    fail_if(all_failed, "every cell failed; the status column says why")
}

fn told(merged: &MergedMap, shards: usize, runs: usize, folder: &Path) -> String {
    let [periodic, chaotic, undecided, failed] = merged.classes;
    let [reading, writing] = merged.times.map(|time| time.as_secs_f64());
    format!(
        "{runs} runs of {shards} shards, read in {reading:.3} s; files written in {writing:.3} s\n\
         {periodic} periodic, {chaotic} chaotic, {undecided} undecided, {failed} failed\n\
         {}: {}",
        say::path(folder),
        merged.files.join(", ")
    )
}
