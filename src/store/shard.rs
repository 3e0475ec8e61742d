//! The folder of a shard: its records, and a manifest that says which part of which map they are.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::record::Record;
use crate::record::classify::{classify, status};
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::{AxisObject, Head, MANIFEST, ModelObject, StartObject, start};
use crate::store::map::{self, Run};
use crate::store::map_manifest::{IntegrationObject, ListObject, MadeObject, TimingsObject, integration};
use crate::store::record_file::Identity;
use crate::store::record_file::RECORDS;
use crate::store::unfinished;
use rattlemap_dynamics::orbit::{Class, Status};

/// What the records of a shard say, all together. Of a cell with several starts the first one is counted, as in a map.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Periodic, chaotic, undecided, failed.
    pub classes: [usize; 4],
    statuses: BTreeMap<u32, usize>,
    /// Forcing periods integrated, over all runs.
    pub periods: u64,
}

impl Tally {
    /// Counts these, too.
    pub fn take(&mut self, plan: &Plan, batch: &[(u32, Record)]) {
        for (id, record) in batch {
            self.periods += u64::from(record.periods_run);
            if (*id as usize) < plan.cell_count() {
                self.classes[classify(record).index()] += 1;
                *self.statuses.entry(status(record).code()).or_default() += 1;
            }
        }
    }

    /// Whether every cell failed.
    pub fn all_failed(&self) -> bool {
        let failed = self.classes[Class::Failed.index()];
        failed > 0 && failed == self.classes.iter().sum::<usize>()
    }

    fn classes(&self) -> BTreeMap<&'static str, usize> {
        Class::NAMES.into_iter().zip(self.classes).collect()
    }

    fn statuses(&self) -> BTreeMap<&'static str, usize> {
        let count = |status: Status| self.statuses.get(&status.code()).copied().unwrap_or(0);
        Status::ALL.iter().map(|&status| (status.name(), count(status))).collect()
    }
}

/// A finished shard.
#[derive(Clone, Copy, Debug)]
pub struct Finished<'a> {
    /// Which it is.
    pub shard: Shard,
    /// Its map.
    pub scene: &'a Scene,
    /// The same as cells.
    pub plan: &'a Plan,
    /// Who computed it, and in what time.
    pub run: &'a Run<'a>,
    /// What came of it.
    pub tally: &'a Tally,
}

/// What a map's manifest says, as far as a shard knows it.
#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    shard: Shard,
    #[serde(flatten)]
    made: MadeObject<'a>,
    processor: &'a str,
    sources: &'static str,
    target: &'static str,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    model: ModelObject,
    axes: Vec<AxisObject>,
    #[serde(skip_serializing_if = "Option::is_none")]
    list: Option<ListObject>,
    start: StartObject,
    integration: IntegrationObject,
    /// Of the map.
    cells: usize,
    /// Of the shard, as all that follows.
    runs: usize,
    classes: BTreeMap<&'static str, usize>,
    statuses: BTreeMap<&'static str, usize>,
    periods: u64,
    elapsed_seconds: f64,
    resumed_cells: usize,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

/// Writes what belongs to the records of a finished shard, and the manifest last: a folder that has one is complete.
/// Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, finished: &Finished<'_>) -> Result<Vec<String>, OutputError> {
    let clock = Instant::now();
    let Finished { scene, .. } = finished;
    let mut files = map::write_copies(folder, scene, &|_| true)?;
    let listed: Vec<&str> = files.iter().map(String::as_str).chain([RECORDS]).collect();
    let listed = inventory::entries(folder, &listed)?;
    inventory::write_manifest(folder, &manifest(finished, clock.elapsed(), &listed))?;
    files.extend([RECORDS, MANIFEST].map(str::to_owned));
    unfinished::clear(folder)?;
    Ok(files)
}

fn manifest<'a>(finished: &Finished<'a>, writing: Duration, files: &'a [FileEntry]) -> Manifest<'a> {
    let Finished { shard, scene, plan, run, tally } = *finished;
    let integrating = (run.elapsed_before + run.elapsed).as_secs_f64();
    Manifest {
        head: Head::of("map"),
        shard,
        made: MadeObject::of(run),
        processor: run.processor,
        sources: Identity::own_sources(),
        target: Identity::own_target(),
        title: scene.title(),
        scene: scene.text(),
        set: run.sets,
        model: ModelObject::of(scene.base()),
        axes: scene.axes().iter().map(AxisObject::from).collect(),
        list: scene.list().map(ListObject::from),
        start: start(scene),
        integration: integration(scene, run.lane_grid),
        cells: plan.cell_count(),
        runs: shard.run_count(plan),
        classes: tally.classes(),
        statuses: tally.statuses(),
        periods: tally.periods,
        elapsed_seconds: integrating,
        resumed_cells: run.resumed_cells,
        timings: TimingsObject {
            open: run.opening.as_secs_f64(),
            integrate: integrating,
            write: writing.as_secs_f64(),
        },
        files,
    }
}

/// `map --shard --json`: what a shard came to; its fields are a contract.
#[derive(Serialize)]
struct Object<'a> {
    folder: String,
    files: &'a [String],
    shard: Shard,
    #[serde(flatten)]
    made: MadeObject<'a>,
    cells: usize,
    runs: usize,
    classes: BTreeMap<&'static str, usize>,
    statuses: BTreeMap<&'static str, usize>,
    periods: u64,
    resumed: ResumedObject,
    seconds: SecondsObject,
}

#[derive(Serialize)]
struct ResumedObject {
    runs: usize,
    seconds: f64,
}

#[derive(Serialize)]
struct SecondsObject {
    open: f64,
    integrate: f64,
}

/// Prints to stdout what became of a shard whose folder has these files.
///
/// # Errors
/// [`OutputError`] if stdout cannot be written, unless its reader has closed it.
pub fn print(folder: &Path, files: &[String], finished: &Finished<'_>) -> Result<(), OutputError> {
    let Finished { shard, plan, run, tally, .. } = *finished;
    let object = Object {
        folder: folder.to_string_lossy().into_owned(),
        files,
        shard,
        made: MadeObject::of(run),
        cells: plan.cell_count(),
        runs: shard.run_count(plan),
        classes: tally.classes(),
        statuses: tally.statuses(),
        periods: tally.periods,
        resumed: ResumedObject { runs: run.resumed_cells, seconds: run.elapsed_before.as_secs_f64() },
        seconds: SecondsObject { open: run.opening.as_secs_f64(), integrate: run.elapsed.as_secs_f64() },
    };
    crate::store::stdout::print(&serde_json::to_string_pretty(&object)?)
}
