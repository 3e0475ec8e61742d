//! The folder of a shard: its records, and a manifest.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::Value;

use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::record::Record;
use crate::record::classify::{classify, status};
use crate::show::names;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::map::{
    IntegrationObject, ListObject, MadeObject, MapTimings, ResumedObject, integration,
};
use crate::store::manifest::{AxisObject, Head, MANIFEST, ModelObject, StartObject, start};
use crate::store::map::{self, Run};
use crate::store::record_file::{Identity, RECORDS};
use crate::store::unfinished;
use rattlemap_dynamics::orbit::{Class, Status};

/// Counts over the records of a shard. As in a map, only the first of several starts of a cell is counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of cells that are periodic, chaotic, undecided, failed.
    pub classes: [usize; 4],
    statuses: BTreeMap<u32, usize>,
    /// Number of integrated forcing periods, over all runs.
    pub periods: u64,
}

impl Tally {
    /// Adds the records of a batch.
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
        names::CLASSES.into_iter().zip(self.classes).collect()
    }

    fn statuses(&self) -> BTreeMap<&'static str, usize> {
        let count = |status: Status| self.statuses.get(&status.code()).copied().unwrap_or(0);
        Status::ALL.iter().map(|&status| (names::status(status), count(status))).collect()
    }
}

/// A finished shard.
#[derive(Clone, Copy, Debug)]
pub struct FinishedShard<'a> {
    /// The shard.
    pub shard: Shard,
    /// The scene of the map.
    pub scene: &'a Scene,
    /// The cells of the map.
    pub plan: &'a Plan,
    /// Engine and times.
    pub run: &'a Run<'a>,
    /// Counts over its records.
    pub tally: &'a Tally,
}

/// The manifest of a shard: the fields of a map's manifest that do not need the records of other shards.
#[derive(Serialize)]
struct ShardManifest<'a> {
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
    /// Number of cells of the map.
    cells: usize,
    /// Number of runs of the shard. All fields below describe the shard.
    runs: usize,
    classes: BTreeMap<&'static str, usize>,
    statuses: BTreeMap<&'static str, usize>,
    periods: u64,
    elapsed_seconds: f64,
    resumed_cells: usize,
    timings: MapTimings,
    files: &'a [FileEntry],
}

/// Writes the files of a finished shard other than its records, and the manifest last. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, finished: &FinishedShard<'_>) -> Result<Vec<String>, OutputError> {
    let clock = Instant::now();
    let FinishedShard { scene, .. } = finished;
    let mut files = map::write_copies(folder, scene, &|_| true)?;
    let listed: Vec<&str> = files.iter().map(String::as_str).chain([RECORDS]).collect();
    let listed = inventory::entries(folder, &listed)?;
    inventory::write_manifest(folder, &manifest(finished, clock.elapsed(), &listed))?;
    files.extend([RECORDS, MANIFEST].map(str::to_owned));
    unfinished::clear(folder)?;
    Ok(files)
}

fn manifest<'a>(
    finished: &FinishedShard<'a>,
    writing: Duration,
    files: &'a [FileEntry],
) -> ShardManifest<'a> {
    let FinishedShard { shard, scene, plan, run, tally } = *finished;
    ShardManifest {
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
        elapsed_seconds: (run.elapsed_before + run.elapsed).as_secs_f64(),
        resumed_cells: run.resumed_cells,
        timings: MapTimings::of(run, writing),
        files,
    }
}

/// The object that `map --shard --json` prints. Scripts depend on its fields.
#[derive(Serialize)]
struct ShardObject<'a> {
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

/// Seconds that each phase of this run took.
#[derive(Serialize)]
struct SecondsObject {
    open: f64,
    integrate: f64,
}

/// Returns the object for a shard whose files were written to a folder.
///
/// # Errors
/// [`OutputError`] if a result cannot be put into JSON.
pub fn object(folder: &Path, files: &[String], finished: &FinishedShard<'_>) -> Result<Value, OutputError> {
    let FinishedShard { shard, plan, run, tally, .. } = *finished;
    let object = ShardObject {
        folder: folder.to_string_lossy().into_owned(),
        files,
        shard,
        made: MadeObject::of(run),
        cells: plan.cell_count(),
        runs: shard.run_count(plan),
        classes: tally.classes(),
        statuses: tally.statuses(),
        periods: tally.periods,
        resumed: ResumedObject::of(run),
        seconds: SecondsObject { open: run.opening.as_secs_f64(), integrate: run.elapsed.as_secs_f64() },
    };
    Ok(serde_json::to_value(object)?)
}
