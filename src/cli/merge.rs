//! `rattlemap merge`: combines the shards of a map.

use super::arguments::Merge;
use super::failure::{Failure, fail_if};
use super::interrupt::Interrupt;
use super::progress;
use super::say;
use super::stdout::print_json;
use crate::job::error::JobError;
use crate::job::size;
use crate::store;
use crate::store::folder::Folder;
use crate::store::merge::{MergeError, Parts, Progress};
use rattlemap_dynamics::orbit::Class;

/// Gathers the records of all shards, and writes the map.
pub(crate) fn run(arguments: &Merge) -> Result<(), Failure> {
    let interrupt = Interrupt::listen(arguments.quiet)?;
    interrupt.ends_at_once(format!("nothing was written to {}", arguments.out.display()), || {});
    let parts = Parts::open(&arguments.parts)?;
    parts.refuse(&arguments.out)?;
    size::check_merge(parts.scene(), Some(&arguments.out))?;
    // A folder without results may be replaced. A run that was killed at its start leaves one.
    let folder = Folder::open(&arguments.out, arguments.force || !Folder::holds_results(&arguments.out))?;
    folder.prepare(store::map::names_of(parts.scene()))?;
    let (shards, out) = (parts.count(), arguments.out.display());
    let runs = parts.scene().run_count().max(1) as usize;
    let progress = progress::Progress::new(runs, 0, "runs", arguments.quiet);
    let continues = |Progress { done, of }| {
        progress.report(done, of);
        !interrupt.is_raised()
    };
    interrupt.wait_for(Some("a batch is read"));
    let gathered = parts.gather(&folder, continues).map_err(|error| match error {
        MergeError::Stopped => interrupt.failure(format!("interrupted; nothing was written to {out}")),
        error => JobError::from(error).into(),
    })?;
    let runs = gathered.run_count();
    let again = arguments.again();
    interrupt.ends_at_once(
        format!("all {runs} runs are stored in {out}; write the tables and figures with: {again}"),
        || {},
    );
    let merged = gathered.write(&folder)?;
    for warning in &merged.warnings {
        say::note(format_args!("warning: {warning}"));
    }
    let [reading, writing] = merged.times.map(|time| time.as_secs_f64());
    progress.finish(&format!(
        "{runs} runs of {shards} shards, read in {reading:.3} s; files written in {writing:.3} s\n\
         {}\n\
         {}: {}",
        say::classes(merged.classes),
        say::path(folder.path()),
        merged.files.join(", ")
    ));
    if !arguments.quiet {
        say::removed(&folder);
    }
    if arguments.json {
        print_json(&merged.object)?;
    }
    let failed = merged.classes[Class::Failed.index()];
    let all_failed = failed > 0 && failed == merged.classes.iter().sum::<usize>();
    fail_if(all_failed, "every cell failed; the status column says why")
}
