//! Shards, computed apart, as the one map that they are parts of.
//!
//! Parts are looked at first, all of them: which runs they are of, and whether they are finished. Their records are read
//! once, batch by batch, and go to the map's own `records.bin`, which gets its name when all are there. Tables and figures
//! are made of them as of any map's, the manifest last. Up to then a map that was in the folder stays as it was.
//!
//! ```no_run
//! use std::path::{Path, PathBuf};
//!
//! use rattlemap::store::folder::Folder;
//! use rattlemap::store::merge::{Parts, Progress};
//!
//! // The shards of a map, in any order.
//! let shards: Vec<PathBuf> = (1..=4).map(|i| format!("out/s.shard-{i}-of-4").into()).collect();
//! let parts = Parts::open(&shards)?;
//! let out = Path::new("out/s");
//! parts.refuse(out)?;
//! let folder = Folder::open(out, false)?;
//! // False ends it, with the folder as it was.
//! let gathered = parts.gather(&folder, |Progress { done, of }| {
//!     println!("{done} of {of} runs");
//!     true
//! })?;
//! let merged = gathered.write(&folder)?;
//! println!("{}", merged.files.join(", "));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod part;

pub use error::{MergeError, Missing, Unfinished};

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::findings::effect;
use crate::map::plan::{Plan, count_classes};
use crate::map::scene::{Scene, Start};
use crate::map::shard::Shard;
use crate::record::{Record, RecordStore, Records};
use crate::show::cells::{Cells, Survey};
use crate::show::provenance::Provenance;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::map::{self, Merged as Origin, Run};
use crate::store::record_file::{Identity, RECORDS, RecordFile};
use crate::store::{in_memory, map_json, unfinished};
use part::{Begun, Part, Seen};

/// Records that are written together: as many as a batch of the file has at most.
const BATCH: usize = 1 << 16;

/// Most batches that wait to be written: each has 12 MB.
const MOST_BATCHES: usize = 8;

/// How far the merging is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Runs whose records have been read.
    pub done: usize,
    /// All of them.
    pub of: usize,
}

/// All shards of one map, each finished, none of their records read yet.
#[derive(Debug)]
pub struct Parts {
    /// In the order of the shards.
    parts: Vec<Part>,
    scene: Scene,
    identity: Identity,
}

impl Parts {
    /// Looks at the folders of shards, in any order.
    ///
    /// # Errors
    /// [`MergeError`] if they are not all shards of one map, each once and finished.
    pub fn open(folders: &[PathBuf]) -> Result<Parts, MergeError> {
        let (mut parts, mut begun) = (Vec::new(), Vec::new());
        for folder in folders {
            match Seen::at(folder)? {
                Seen::Finished(part) => parts.push(*part),
                Seen::Unfinished(part) => begun.push(part),
            }
        }
        require_one_run(&parts, &begun)?;
        let scene = parts.first().map(|part| part.manifest.scene(&part.folder)).transpose()?;
        require_all(&parts, &begun, scene.as_ref())?;
        let (Some(first), Some(scene)) = (parts.first(), scene) else { return Err(MergeError::Nothing) };
        let identity = first.identity.clone().of_shard(None);
        if !identity.is_of(&scene) {
            return Err(first.damaged(format!("the scene in its manifest is not that of its {RECORDS}")));
        }
        parts.sort_by_key(|part| part.shard);
        Ok(Parts { parts, scene, identity })
    }

    /// The map's scene; of title and files, in which shards may differ, those of the part that was named first.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// How many shards there are.
    pub fn count(&self) -> usize {
        self.parts.len()
    }

    /// Refuses to write the map over one of its shards.
    ///
    /// # Errors
    /// [`MergeError::IsPart`].
    pub fn refuse(&self, out: &Path) -> Result<(), MergeError> {
        let Ok(whole) = out.canonicalize() else { return Ok(()) };
        let is_same = |part: &&Part| part.folder.canonicalize().is_ok_and(|part| part == whole);
        match self.parts.iter().find(is_same) {
            Some(part) => Err(MergeError::IsPart { part: part.folder.clone() }),
            None => Ok(()),
        }
    }

    /// Reads all records and writes them to a folder; `go_on` is told of progress, and false ends it.
    ///
    /// # Errors
    /// [`MergeError`], with the folder as it was.
    pub fn gather(
        self,
        folder: &Folder,
        go_on: impl FnMut(Progress) -> bool,
    ) -> Result<Gathered, MergeError> {
        let clock = Instant::now();
        let runs = self.scene.run_count();
        if u32::try_from(runs).is_err() {
            return Err(MergeError::TooLarge { runs });
        }
        let plan = Plan::new(&self.scene);
        plan.check()?;
        let path = folder.path().join(RECORDS);
        let mut gathering = Gathering::new(&plan, RecordFile::create_aside(&path, &self.identity)?, go_on);
        let read = gathering.read(&self.parts).and_then(|()| gathering.finish());
        let Gathering { file, records, warnings, .. } = gathering;
        if let Err(error) = read {
            file.discard();
            return Err(error);
        }
        map::begin(folder, &self.scene)?;
        file.put_in_place(&path)?;
        unfinished::keep_elapsed(folder, self.elapsed())?;
        Ok(Gathered { parts: self, plan, records, warnings, reading: clock.elapsed() })
    }

    /// How long all parts were integrated, one after the other.
    fn elapsed(&self) -> Duration {
        self.sum(|part| part.manifest.elapsed_seconds)
    }

    fn sum(&self, seconds: impl Fn(&Part) -> f64) -> Duration {
        Duration::try_from_secs_f64(self.parts.iter().map(seconds).sum()).unwrap_or_default()
    }
}

/// Refuses parts of different runs.
fn require_one_run(parts: &[Part], begun: &[Begun]) -> Result<(), MergeError> {
    let finished = parts.iter().map(|part| (&part.folder, &part.identity));
    let begun = begun.iter().filter_map(|begun| Some((&begun.folder, begun.identity.as_ref()?)));
    let all: Vec<(&PathBuf, &Identity, Shard)> =
        finished.chain(begun).filter_map(|(at, identity)| Some((at, identity, identity.shard()?))).collect();
    let Some(&(first, identity, of_first)) = all.first() else { return Ok(()) };
    let own = || first.clone();
    let whole = identity.clone().of_shard(None);
    for (nth, &(part, identity, shard)) in all.iter().enumerate() {
        let tell = |mine: &str, theirs: &str| format!("is {mine} in the first and {theirs} in the other");
        let differences = whole.differing(&identity.clone().of_shard(None), tell);
        if !differences.is_empty() {
            return Err(MergeError::OtherRun { first: own(), part: part.clone(), differences });
        }
        if shard.count() != of_first.count() {
            return Err(MergeError::OtherCount { first: own(), of_first, part: part.clone(), shard });
        }
        if let Some(&(first, ..)) = all[..nth].iter().find(|(_, _, other)| *other == shard) {
            return Err(MergeError::Twice { shard, first: first.clone(), part: part.clone() });
        }
    }
    Ok(())
}

/// Refuses to go on where shards are missing or unfinished.
fn require_all(parts: &[Part], begun: &[Begun], scene: Option<&Scene>) -> Result<(), MergeError> {
    let of_begun = |begun: &Begun| begun.identity.as_ref().and_then(Identity::shard);
    let there: Vec<Shard> =
        parts.iter().map(|part| part.shard).chain(begun.iter().filter_map(of_begun)).collect();
    let Some(first) = parts.first() else {
        let unfinished: Vec<Unfinished> = begun.iter().map(|begun| begun.unfinished(None)).collect();
        return match unfinished.is_empty() {
            true => Err(MergeError::Nothing),
            false => Err(MergeError::Incomplete { missing: Vec::new(), unfinished }),
        };
    };
    let missing: Vec<Missing> = Shard::all(first.shard.count())
        .filter(|shard| !there.contains(shard))
        .map(|shard| Missing { shard, command: first.manifest.command(shard, None) })
        .collect();
    if missing.is_empty() && begun.is_empty() {
        return Ok(());
    }
    let countable = scene.filter(|scene| !begun.is_empty() && u32::try_from(scene.run_count()).is_ok());
    let plan = countable.map(Plan::new);
    let of = plan.as_ref().map(|plan| (first, plan));
    let unfinished = begun.iter().map(|begun| begun.unfinished(of)).collect();
    Err(MergeError::Incomplete { missing, unfinished })
}

/// Records on their way from the parts to the map.
struct Gathering<'p, G> {
    plan: &'p Plan,
    file: RecordFile,
    go_on: G,
    /// By run: the one place where all are.
    records: RecordStore,
    /// A bit for each run that has come.
    come: Vec<u64>,
    done: usize,
    /// What is to be written next.
    waiting: Vec<(u32, Record)>,
    warnings: Vec<String>,
}

impl<'p, G: FnMut(Progress) -> bool> Gathering<'p, G> {
    fn new(plan: &'p Plan, file: RecordFile, go_on: G) -> Self {
        let runs = plan.run_count();
        Gathering {
            plan,
            file,
            go_on,
            records: RecordStore::new(runs, plan.reads_strobes()),
            come: vec![0; runs.div_ceil(64)],
            done: 0,
            waiting: Vec::new(),
            warnings: Vec::new(),
        }
    }

    fn read(&mut self, parts: &[Part]) -> Result<(), MergeError> {
        for part in parts {
            let before = self.done;
            let mut failed = None;
            let read = part.read(|batch| match self.take(batch) {
                Ok(is_good) => is_good,
                Err(error) => {
                    failed = Some(error);
                    false
                }
            });
            if let Some(error) = failed {
                return Err(error);
            }
            let damage = read?;
            let (count, expected) = (self.done - before, part.shard.run_count(self.plan));
            if count != expected {
                let told = damage.map_or(String::new(), |damage| format!("{damage}: "));
                return Err(part.damaged(format!("{told}{count} of {expected} runs are there")));
            }
            // Nothing is missing: it stands behind the last batch.
            let warning = |damage| format!("{}: {damage}; all {count} runs are there", part.folder.display());
            self.warnings.extend(damage.map(warning));
        }
        Ok(())
    }

    /// Takes up a batch; false if it is not of this map, or has what came before.
    fn take(&mut self, batch: &[(u32, Record)]) -> Result<bool, MergeError> {
        if !(self.go_on)(Progress { done: self.done, of: self.records.count() }) {
            return Err(MergeError::Stopped);
        }
        if !self.plan.admits(batch) {
            return Ok(false);
        }
        for &(id, record) in batch {
            let (place, bit) = (id as usize, 1 << (id % 64));
            let Some(bits) = self.come.get_mut(place / 64).filter(|bits| **bits & bit == 0) else {
                return Ok(false);
            };
            if place >= self.records.count() {
                return Ok(false);
            }
            *bits |= bit;
            self.records.put(place, &record);
        }
        self.done += batch.len();
        if self.plan.policy().follows() {
            // They are written row by row, in the end: who goes on takes up each row after the one before.
            return Ok(true);
        }
        self.waiting.extend_from_slice(batch);
        // Those of a core each are compressed side by side.
        if self.waiting.len() >= BATCH * rayon::current_num_threads().min(MOST_BATCHES) {
            self.file.append(&std::mem::take(&mut self.waiting))?;
        }
        Ok(true)
    }

    /// Writes what is left.
    fn finish(&mut self) -> Result<(), MergeError> {
        if self.plan.policy().follows() {
            let [columns, rows] = self.plan.counts();
            let is_down = self.plan.policy() == Start::Down;
            let row = |nth: usize| if is_down { rows - 1 - nth } else { nth };
            let mut ids = (0..rows).flat_map(|nth| row(nth) * columns..(row(nth) + 1) * columns);
            loop {
                let next = ids.by_ref().take(BATCH);
                let batch: Vec<(u32, Record)> = next.map(|id| (id as u32, self.records.record(id))).collect();
                if batch.is_empty() {
                    break;
                }
                self.file.append(&batch)?;
            }
        } else if !self.waiting.is_empty() {
            self.file.append(&std::mem::take(&mut self.waiting))?;
        }
        Ok(())
    }
}

/// A map whose records are all there: in its folder, and here.
#[derive(Debug)]
pub struct Gathered {
    parts: Parts,
    plan: Plan,
    records: RecordStore,
    warnings: Vec<String>,
    reading: Duration,
}

/// A map that was merged.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The files in its folder.
    pub files: Vec<String>,
    /// Cells that are periodic, chaotic, undecided, failed.
    pub classes: [usize; 4],
    /// What `map --json` prints of the map, with the number of `shards`.
    pub object: Value,
    /// Damage in shards that cost no record.
    pub warnings: Vec<String>,
    /// Time to read and keep the records, and to write the files.
    pub times: [Duration; 2],
}

impl Gathered {
    /// How many runs the map has.
    pub fn run_count(&self) -> usize {
        self.plan.run_count()
    }

    /// The map as its folder would tell it.
    ///
    /// # Errors
    /// [`MergeError::Output`] if something cannot be put into its form.
    pub fn told(&self) -> Result<in_memory::Map, MergeError> {
        self.with_cells(in_memory::map)
    }

    /// Writes tables, figures and report, and the manifest last, into the folder that has the records.
    ///
    /// # Errors
    /// [`MergeError::Output`] if a file cannot be written; the records are there then.
    pub fn write(self, folder: &Folder) -> Result<Merged, MergeError> {
        let clock = Instant::now();
        let (files, object, classes, writing) = self.with_cells(|cells, run| {
            let files = map::write(folder, cells, run)?;
            let writing = clock.elapsed();
            let object = map_json::object(folder.path(), &files, cells, run, writing)?;
            Ok((files, object, count_classes(cells.classes()), writing))
        })?;
        Ok(Merged { files, classes, object, warnings: self.warnings, times: [self.reading, writing] })
    }

    /// Hands over the finished map: its cells, and who computed them.
    fn with_cells<T>(
        &self,
        take: impl FnOnce(&Cells<'_>, &Run<'_>) -> Result<T, OutputError>,
    ) -> Result<T, MergeError> {
        let Gathered { parts, plan, records, .. } = self;
        let first = &parts.parts[0].manifest;
        let survey = Survey::of(plan, records, None);
        let cells = Cells::new(&parts.scene, plan, records).surveyed(&survey);
        let processor = parts.processors();
        let made = Provenance { engine: &first.engine, precision: &first.precision, device: &first.device };
        // Adapters and cards are told by each part's own manifest.
        let run = Run {
            opening: parts.sum(|part| part.manifest.timings.open),
            elapsed: parts.elapsed(),
            lane_grid: parts.lane_grid(),
            without_effect: effect::names(plan, records, made.precision),
            merged: Some(Origin {
                shards: parts.parts[0].shard.count(),
                sources: &first.sources,
                target: &first.target,
            }),
            ..Run::new(made, &first.set, &processor)
        };
        Ok(take(&cells, &run)?)
    }
}

impl Parts {
    /// The host's processors of all parts, each once.
    fn processors(&self) -> String {
        let mut names: Vec<&str> = Vec::new();
        for part in &self.parts {
            let name = part.manifest.processor.as_str();
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names.join("; ")
    }

    /// The least and the most steps of lanes over all parts.
    fn lane_grid(&self) -> Option<[u32; 2]> {
        let grids = self.parts.iter().filter_map(|part| part.manifest.lane_grid());
        grids.reduce(|[least, most], [low, high]| [least.min(low), most.max(high)])
    }
}
