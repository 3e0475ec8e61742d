//! What does a large map cost beside its motions: time, memory, disk?
//!
//! Nothing of it is integrated but a small map of the same plane. Its records are stretched over the large one, and their
//! numbers changed from cell to cell, so that they compress no better than those of lanes do. They are written as
//! shards, in the folders that `map --shard` makes, and merged by what `merge` calls.

mod phase;
mod stretched;

use std::path::{Path, PathBuf};

use rattlemap::gpu::Constants;
use rattlemap::job;
use rattlemap::job::Processor;
use rattlemap::job::error::JobError;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene, SceneError};
use rattlemap::map::schedule::Schedule;
use rattlemap::map::shard::Shard;
use rattlemap::model::GearPair;
use rattlemap::record::Record;
use rattlemap::store::error::OutputError;
use rattlemap::store::folder::{Folder, FolderError};
use rattlemap::store::map::{Provenance, Run};
use rattlemap::store::merge::{MergeError, Parts};
use rattlemap::store::record_file::{Identity, RECORDS, RecordFile, RecordFileError};
use rattlemap::store::shard::{self, FinishedShard, Tally};
use rattlemap_dynamics::flow::Flow;
use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

pub use phase::{Phase, Taken};
pub use stretched::Stretched;

/// Records that are written together: about as many as a fast card ends in a second.
const BATCH: usize = 1 << 20;

/// What is measured.
#[derive(Clone, Copy, Debug)]
pub struct Ask {
    /// Cells along each axis.
    pub counts: [u32; 2],
    /// Of the small map that is integrated.
    pub small: u32,
    /// Shards.
    pub shards: u32,
    /// Whether every quantity is asked for.
    pub all: bool,
}

/// Why it cannot be measured.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "each says what it is")]
pub enum ScaleError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Map(#[from] JobError),
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Records(#[from] RecordFileError),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error(transparent)]
    Merge(#[from] MergeError),
}

/// A file and its size.
#[derive(Clone, Debug, Serialize)]
pub struct Size {
    /// Its name; of shards how many there are.
    pub file: String,
    /// Bytes of all.
    pub bytes: u64,
    /// The same per cell.
    pub per_cell: f64,
}

/// The scene of `e_omega`.
fn scene(counts: [u32; 2], all: bool) -> Result<Scene, SceneError> {
    let builder = Scene::builder(GearPair::paper(0.5));
    let builder = builder.axis("e", 0.0..=1.0, counts[0]).axis("omega", 1.0..=12.0, counts[1]);
    let everything = [
        Quantity::Class,
        Quantity::Lyapunov,
        Quantity::Impacts,
        Quantity::Mesh,
        Quantity::Symmetric,
        Quantity::Word,
        Quantity::Pattern,
    ];
    if all { builder.quantities(&everything).build() } else { builder.build() }
}

/// Writes the shards into folders beside each other; what that took, and what a shard does before its first cell.
///
/// # Errors
/// [`ScaleError`].
pub fn write_shards(ask: Ask, dir: &Path) -> Result<(Vec<PathBuf>, Vec<Taken>), ScaleError> {
    let small = job::run(&scene([ask.small; 2], ask.all)?, Processor::Cpu)?;
    let scene = scene(ask.counts, ask.all)?;
    let stretched = Stretched::new(&small, ask.counts.map(|count| count as usize));
    let phase = Phase::begin("plan");
    let plan = Plan::new(&scene);
    plan.check().map_err(JobError::from)?;
    let mut taken = vec![phase.end()];
    let phase = Phase::begin("schedule of a shard");
    drop(Schedule::of(&plan, Shard::all(ask.shards).next()));
    taken.push(phase.end());
    let all = || (0..plan.flow_count() as u32).into_par_iter().map(|flow| plan.oscillator(flow));
    let phase = Phase::begin("constants of all lanes");
    let constants: Vec<_> = all().map(|oscillator| Constants::new(&oscillator, None)).collect();
    taken.push(phase.end());
    drop(constants);
    let phase = Phase::begin("flows of all cells");
    let flows: Vec<_> = all().map(|oscillator| Flow::new(&oscillator)).collect();
    taken.push(phase.end());
    drop(flows);
    let phase = Phase::begin("shards");
    let own = Identity::new("cpu", "f64", "event-driven reference", scene.identity());
    let folders: Result<Vec<PathBuf>, ScaleError> = Shard::all(ask.shards)
        .map(|of| {
            let folder = Folder::open(&dir.join(format!("shard-{}-of-{}", of.index(), of.count())), true)?;
            let mut file = RecordFile::create(&folder.path().join(RECORDS), &own.clone().of_shard(Some(of)))?;
            let mut tally = Tally::default();
            for ids in of.runs(&plan).chunks(BATCH) {
                let batch: Vec<(u32, Record)> =
                    ids.par_iter().map(|&id| (id, stretched.record(id))).collect();
                file.append(&batch)?;
                tally.take(&plan, &batch);
            }
            let made = Provenance { engine: "cpu", precision: "f64", device: "event-driven reference" };
            let run = Run::new(made, &[], "none: the records are made up");
            shard::write(
                &folder,
                &FinishedShard { shard: of, scene: &scene, plan: &plan, run: &run, tally: &tally },
            )?;
            Ok(folder.path().to_owned())
        })
        .collect();
    taken.push(phase.end());
    Ok((folders?, taken))
}

/// Merges the shards; what each phase took, and the files.
///
/// # Errors
/// [`ScaleError`].
pub fn merge(shards: &[PathBuf], out: &Path) -> Result<(Vec<Taken>, Vec<String>), ScaleError> {
    let folder = Folder::open(out, true)?;
    let phase = Phase::begin("look at shards");
    let parts = Parts::open(shards)?;
    let mut taken = vec![phase.end()];
    let phase = Phase::begin("gather records");
    let gathered = parts.gather(&folder, |_| true)?;
    taken.push(phase.end());
    let phase = Phase::begin("write files");
    let merged = gathered.write(&folder)?;
    taken.push(phase.end());
    Ok((taken, merged.files))
}
