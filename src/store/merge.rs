//! Merges the shards of a map into the map.
//!
//! [`Parts::open`] checks that the folders contain all shards of one map, each once and finished. [`Parts::gather`] reads
//! the records once, batch by batch, and writes them to a new `records.bin`, which replaces that of the folder when it is
//! complete. [`MapRecords::write`] then writes tables, figures and the manifest as for any map. An existing map in the
//! folder is unchanged until all records are there.
//!
//! ```no_run
//! use rattlemap::store::folder::Folder;
//! use rattlemap::store::merge::{Parts, Progress};
//!
//! // The shards of a map, in any order.
//! let parts = Parts::open(&["s.shard-1-of-2".into(), "s.shard-2-of-2".into()])?;
//! parts.refuse("out/s".as_ref())?;
//! let folder = Folder::open("out/s".as_ref(), false)?;
//! // Returning false stops the merge and leaves the folder as it was.
//! let records = parts.gather(&folder, |Progress { done, of }| {
//!     println!("{done} of {of} runs");
//!     true
//! })?;
//! println!("{}", records.write(&folder)?.files.join(", "));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;

pub use error::MergeError;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::findings::effect;
use crate::map::plan::{Plan, count_classes};
use crate::map::scene::{Scene, Start};
use crate::map::shard::Shard;
use crate::record::{RecordStore, Records};
use crate::show::cells::{Cells, Survey};
use crate::show::provenance::Provenance;
use crate::store::error::OutputError;
use crate::store::finished_map::{FinishedMap, FinishedMapError, StoredManifest};
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry, Finding};
use crate::store::manifest::OWN_COMMIT;
use crate::store::map::{self, Run, ShardOrigin};
use crate::store::record_file::{Extent, Identity, RECORDS, RecordFile, RecordFileError};
use crate::store::run_records::Work;
use crate::store::{in_memory, map_json, unfinished};
use rattlemap_dynamics::orbit::Class;

/// Number of records that are written together: the largest batch of a record file.
const BATCH: usize = 1 << 16;

/// Largest number of batches in memory that wait to be written; each takes 25 MB.
const MOST_BATCHES: usize = 8;

/// Largest number of missing shards that a message names.
const NAMED_SHARDS: usize = 10;

/// Progress of a merge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of runs whose records have been read.
    pub done: usize,
    /// Number of all runs.
    pub of: usize,
}

/// The finished shards of one map.
#[derive(Debug)]
pub struct Parts {
    /// In the order of the shards.
    parts: Vec<Part>,
    scene: Scene,
    identity: Identity,
}

/// The folder of a finished shard.
#[derive(Debug)]
struct Part {
    map: FinishedMap,
    shard: Shard,
    /// Identity in the record file.
    identity: Identity,
}

impl Parts {
    /// Checks the folders of shards, in any order, and reads their manifests.
    ///
    /// # Errors
    /// [`MergeError`] unless they are all shards of one map, each once and finished.
    pub fn open(folders: &[PathBuf]) -> Result<Parts, MergeError> {
        let mut parts = folders.iter().map(|folder| Part::open(folder)).collect::<Result<Vec<_>, _>>()?;
        let first = parts.first().ok_or(MergeError::Nothing)?;
        require_one_run(&parts)?;
        let scene = first.map.scene()?;
        let runs = scene.run_count();
        if u32::try_from(runs).is_err() {
            return Err(MergeError::TooLarge { runs });
        }
        let plan = Plan::new(&scene);
        let impossible = |reason| MergeError::Impossible { part: first.map.folder().to_owned(), reason };
        first.shard.check(&plan).map_err(impossible)?;
        require_all(&parts)?;
        let identity = first.identity.clone().of_shard(None);
        if !identity.is_of(&scene) {
            return Err(first.damaged(format!("the scene in its manifest is not that of its {RECORDS}")));
        }
        parts.sort_by_key(|part| part.shard);
        Ok(Parts { parts, scene, identity })
    }

    /// The map's scene. Shards may differ in title and files; the scene has those of the part that was named first.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of shards.
    pub fn count(&self) -> usize {
        self.parts.len()
    }

    /// Refuses to write the map into the folder of one of its shards.
    ///
    /// # Errors
    /// [`MergeError::IsPart`].
    pub fn refuse(&self, out: &Path) -> Result<(), MergeError> {
        let Ok(whole) = out.canonicalize() else { return Ok(()) };
        let is_same = |part: &&Path| part.canonicalize().is_ok_and(|part| part == whole);
        match self.parts.iter().map(|part| part.map.folder()).find(is_same) {
            Some(part) => Err(MergeError::IsPart { part: part.to_owned() }),
            None => Ok(()),
        }
    }

    /// Reads all records and writes them to a folder. `go_on` is called with the progress; the merge stops if it returns
    /// false.
    ///
    /// # Errors
    /// [`MergeError`]. While records are read, the folder is unchanged.
    pub fn gather(
        self,
        folder: &Folder,
        go_on: impl FnMut(Progress) -> bool,
    ) -> Result<MapRecords, MergeError> {
        let clock = Instant::now();
        let plan = Plan::new(&self.scene);
        plan.check()?;
        let path = folder.path().join(RECORDS);
        let mut file = RecordFile::create_aside(&path, &self.identity)?;
        let (records, warnings) = match self.copy_records(&plan, &mut file, go_on) {
            Ok(copied) => copied,
            Err(error) => {
                file.discard();
                return Err(error);
            }
        };
        map::begin(folder, &self.scene)?;
        file.put_in_place(&path)?;
        unfinished::store_elapsed(folder, self.elapsed())?;
        Ok(MapRecords { parts: self, plan, records, warnings, reading: clock.elapsed() })
    }

    /// Copies the records of all parts to a file. Returns them, and warnings about damage behind the last record of a part.
    fn copy_records(
        &self,
        plan: &Plan,
        file: &mut RecordFile,
        mut go_on: impl FnMut(Progress) -> bool,
    ) -> Result<(RecordStore, Vec<String>), MergeError> {
        let mut records = RecordStore::new(plan.run_count(), plan.reads_strobes());
        let (mut warnings, mut waiting, mut done) = (Vec::new(), Vec::new(), 0);
        let follows = plan.policy().follows();
        // A batch for each core, because the cores compress them in parallel.
        let enough = BATCH * rayon::current_num_threads().min(MOST_BATCHES);
        for part in &self.parts {
            let mut work = Work::without_records(plan, Some(part.shard));
            let mut failed = None;
            let read = RecordFile::read(&part.records(), &part.identity, work.order(), |batch| {
                if !go_on(Progress { done, of: records.count() }) {
                    failed = Some(MergeError::Stopped);
                    return false;
                }
                if !work.replay(batch) {
                    return false;
                }
                records.put_all(batch);
                done += batch.len();
                if !follows {
                    waiting.extend_from_slice(batch);
                }
                if waiting.len() >= enough {
                    failed = file.append(&std::mem::take(&mut waiting)).err().map(MergeError::from);
                }
                failed.is_none()
            });
            if let Some(error) = failed {
                return Err(error);
            }
            let Extent { count, damage, .. } =
                read.map_err(|error| fault(error, |what| part.damaged(what)))?;
            if !work.schedule.is_finished() {
                let damage = damage.map_or(String::new(), |damage| format!("{damage}: "));
                let expected = part.shard.run_count(plan);
                return Err(part.damaged(format!("{damage}{count} of {expected} runs are there")));
            }
            let folder = part.map.folder().display();
            warnings.extend(damage.map(|damage| format!("{folder}: {damage}; all {count} runs are there")));
        }
        if follows {
            // A resumed run takes up each row after the one before, so rows are written in order.
            let [columns, rows] = plan.counts();
            let is_down = plan.policy() == Start::Down;
            let row = |nth: usize| if is_down { rows - 1 - nth } else { nth };
            let mut ids = (0..rows).flat_map(|nth| row(nth) * columns..(row(nth) + 1) * columns).peekable();
            while ids.peek().is_some() {
                let next = ids.by_ref().take(BATCH);
                file.append(&next.map(|id| (id as u32, records.record(id))).collect::<Vec<_>>())?;
            }
        } else if !waiting.is_empty() {
            file.append(&waiting)?;
        }
        Ok((records, warnings))
    }

    /// Sum of the times that the parts were integrated.
    fn elapsed(&self) -> Duration {
        self.sum(|manifest| manifest.elapsed_seconds)
    }

    fn sum(&self, seconds: impl Fn(&StoredManifest) -> f64) -> Duration {
        let sum = self.parts.iter().map(|part| seconds(part.map.manifest())).sum();
        Duration::try_from_secs_f64(sum).unwrap_or_default()
    }

    /// Names of the processors of all parts, each once.
    fn processors(&self) -> String {
        let mut names: Vec<&str> = Vec::new();
        for part in &self.parts {
            let name = part.map.manifest().processor.as_str();
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names.join("; ")
    }

    /// The smallest and the largest number of steps of lanes over all parts.
    fn lane_grid(&self) -> Option<[u32; 2]> {
        let grids = self.parts.iter().filter_map(|part| part.map.manifest().lane_grid());
        grids.reduce(|[least, most], [low, high]| [least.min(low), most.max(high)])
    }
}

impl Part {
    /// Reads the manifest of a finished shard and checks its files. Records have checksums of their own and are read
    /// later.
    fn open(folder: &Path) -> Result<Part, MergeError> {
        let map = FinishedMap::open_part(folder).map_err(|error| match error {
            FinishedMapError::NoManifest { folder } => MergeError::NoShard { part: folder },
            error => error.into(),
        })?;
        let Some(shard) = map.manifest().shard else {
            return Err(MergeError::WholeMap { part: folder.to_owned() });
        };
        let damaged = |what| Err(damaged(&map, shard, what));
        if !folder.join(RECORDS).is_file() {
            return damaged(format!("{RECORDS} is missing"));
        }
        let identity = match Identity::read(&folder.join(RECORDS)) {
            Ok(Some(identity)) => identity,
            Ok(None) => return damaged(format!("{RECORDS} is empty")),
            Err(error) => return Err(fault(error, |what| self::damaged(&map, shard, what))),
        };
        let StoredManifest { engine, precision, device, sources, target, files, .. } = map.manifest();
        let in_manifest = [engine, precision, device, sources, target].map(String::as_str);
        if identity.shard() != Some(shard) || identity.in_manifest() != in_manifest {
            return damaged(format!("{RECORDS} does not belong to the manifest in its folder"));
        }
        let copies: Vec<FileEntry> = files.iter().filter(|file| file.name != RECORDS).cloned().collect();
        match inventory::check(folder, &copies).map(|found| found.into_iter().find(Finding::is_lost)) {
            Ok(None) => Ok(Part { shard, identity, map }),
            Ok(Some(finding)) => damaged(finding.to_string()),
            Err(error) => damaged(format!("it cannot be read ({error})")),
        }
    }

    fn records(&self) -> PathBuf {
        self.map.folder().join(RECORDS)
    }

    fn damaged(&self, what: String) -> MergeError {
        damaged(&self.map, self.shard, what)
    }
}

fn damaged(map: &FinishedMap, shard: Shard, what: String) -> MergeError {
    let command = map.manifest().shard_command(shard, Some(map.folder()));
    MergeError::Damaged { part: map.folder().to_owned(), what, command }
}

/// Converts the error of a part's record file. Damage is reported through `damaged`, with the command that mends it.
fn fault(error: RecordFileError, damaged: impl Fn(String) -> MergeError) -> MergeError {
    match error {
        RecordFileError::Damaged { at, what, .. } => {
            damaged(format!("{RECORDS} is damaged at byte {at}: {what}"))
        }
        other => other.into(),
    }
}

/// Refuses parts of different runs, and a shard that is named twice.
fn require_one_run(parts: &[Part]) -> Result<(), MergeError> {
    let whole = |part: &Part| part.identity.clone().of_shard(None);
    for (nth, part) in parts.iter().enumerate() {
        let describe = |mine: &str, theirs: &str| format!("is {mine} in the first and {theirs} in the other");
        let differences = whole(&parts[0]).differing(&whole(part), describe);
        let [first, part_at] = [&parts[0], part].map(|part| part.map.folder().to_owned());
        if !differences.is_empty() {
            return Err(MergeError::OtherRun { first, part: part_at, differences });
        }
        let (of_first, shard) = (parts[0].shard, part.shard);
        if shard.count() != of_first.count() {
            return Err(MergeError::OtherCount { first, of_first, part: part_at, shard });
        }
        if let Some(other) = parts[..nth].iter().find(|other| other.shard == shard) {
            return Err(MergeError::Twice { shard, first: other.map.folder().to_owned(), part: part_at });
        }
    }
    Ok(())
}

/// Refuses to merge if shards are missing, with the commands that compute them.
fn require_all(parts: &[Part]) -> Result<(), MergeError> {
    let present: HashSet<Shard> = parts.iter().map(|part| part.shard).collect();
    let (count, manifest) = (parts[0].shard.count(), parts[0].map.manifest());
    let missing: Vec<Shard> = Shard::all(count).filter(|shard| !present.contains(shard)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let command = |shard: &Shard| format!("{shard} (`{}`)", manifest.shard_command(*shard, None));
    let named: Vec<String> = missing.iter().take(NAMED_SHARDS).map(command).collect();
    let are = if missing.len() == 1 { "is" } else { "are" };
    let others = missing.len() - named.len();
    let others = if others > 0 { format!(" and {others} more") } else { String::new() };
    let named = named.join(", ");
    Err(MergeError::Incomplete(format!("{} of {count} shards {are} missing: {named}{others}", missing.len())))
}

/// All records of a map, in its folder and in memory.
#[derive(Debug)]
pub struct MapRecords {
    parts: Parts,
    plan: Plan,
    records: RecordStore,
    warnings: Vec<String>,
    reading: Duration,
}

/// Result of a merge.
#[derive(Clone, Debug)]
pub struct MergedMap {
    /// Names of the files in the folder.
    pub files: Vec<String>,
    /// Number of cells of each class.
    pub classes: [usize; Class::NAMES.len()],
    /// The object that `map --json` prints, with the number of `shards`.
    pub object: Value,
    /// Damage in record files behind the last record.
    pub warnings: Vec<String>,
    /// Time spent on records, and on tables and figures.
    pub times: [Duration; 2],
}

impl MapRecords {
    /// Number of runs of the map.
    pub fn run_count(&self) -> usize {
        self.plan.run_count()
    }

    /// Builds the manifest and the tables of the map in memory.
    ///
    /// # Errors
    /// [`MergeError::Output`] if a result cannot be formatted.
    pub fn in_memory(&self) -> Result<in_memory::Map, MergeError> {
        self.with_cells(in_memory::map)
    }

    /// Writes tables, figures, report and manifest into the folder of the records.
    ///
    /// # Errors
    /// [`MergeError::Output`] if a file cannot be written. The records stay in the folder.
    pub fn write(self, folder: &Folder) -> Result<MergedMap, MergeError> {
        let clock = Instant::now();
        let (files, object, classes, writing) = self.with_cells(|cells, run| {
            let files = map::write(folder, cells, run)?;
            let writing = clock.elapsed();
            let object = map_json::object(folder.path(), &files, cells, run, writing);
            Ok((files, object, count_classes(cells.classes()), writing))
        })?;
        Ok(MergedMap { files, classes, object, warnings: self.warnings, times: [self.reading, writing] })
    }

    /// Calls `take` with the cells and the computation of the map.
    fn with_cells<T>(
        &self,
        take: impl FnOnce(&Cells<'_>, &Run<'_>) -> Result<T, OutputError>,
    ) -> Result<T, MergeError> {
        let MapRecords { parts, plan, records, .. } = self;
        let first = parts.parts[0].map.manifest();
        let survey = Survey::of(plan, records, None);
        let cells = Cells::new(&parts.scene, plan, records).surveyed(&survey).computed_by(&first.engine);
        let processor = parts.processors();
        let made = Provenance { commit: OWN_COMMIT, ..first.provenance() };
        // Adapters and cards are in the manifests of the parts.
        let run = Run {
            opening: parts.sum(StoredManifest::opening_seconds),
            elapsed: parts.elapsed(),
            lane_grid: parts.lane_grid(),
            without_effect: effect::names(plan, records, made.precision),
            shards: Some(ShardOrigin {
                count: parts.parts[0].shard.count(),
                sources: &first.sources,
                target: &first.target,
            }),
            ..Run::new(made, &first.set, &processor)
        };
        Ok(take(&cells, &run)?)
    }
}
