//! Time, memory and disk space of a large map, without its integration.
//!
//! Only a small map of the same plane is integrated. Its records are stretched over the large map, and their numbers change
//! from cell to cell, so that they compress no better than those of lanes. They are written as shards, into folders like
//! those of `map --shard`, and merged as by `merge`.

mod stretched;

use std::path::{Path, PathBuf};

use anyhow::Result;
use rattlemap::gpu::Constants;
use rattlemap::job;
use rattlemap::job::Processor;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene};
use rattlemap::map::schedule::Schedule;
use rattlemap::map::shard::Shard;
use rattlemap::model::GearPair;
use rattlemap::record::Record;
use rattlemap::store::folder::Folder;
use rattlemap::store::map::{Provenance, Run};
use rattlemap::store::merge::Parts;
use rattlemap::store::record_file::{Identity, RECORDS, RecordFile};
use rattlemap::store::shard::{self, FinishedShard, Tally};
use rattlemap_dynamics::motion::Flow;
use rayon::prelude::*;
use serde::Serialize;

use crate::phase::{self, Cost};

pub use stretched::Stretched;

/// Number of records that are written together: about as many as a fast card computes in a second.
const BATCH: usize = 1 << 20;

/// Sizes of a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Number of cells along each axis.
    pub counts: [u32; 2],
    /// Number of cells along each axis of the small map.
    pub small: u32,
    /// Number of shards.
    pub shards: u32,
    /// Whether every quantity is requested.
    pub all: bool,
}

/// The size of a file.
#[derive(Clone, Debug, Serialize)]
pub struct FileSize {
    /// Name of the file, or of the shards' files with their number.
    pub file: String,
    /// Number of bytes.
    pub bytes: u64,
    /// Number of bytes per cell.
    pub per_cell: f64,
}

/// Returns a scene like `scenes/e_omega.toml`.
fn scene(counts: [u32; 2], all: bool) -> Result<Scene> {
    use Quantity::{Class, Impacts, Lyapunov, Mesh, Pattern, Symmetric, Word};
    let builder = Scene::builder(GearPair::paper(0.5));
    let builder = builder.axis("e", 0.0..=1.0, counts[0]).axis("omega", 1.0..=12.0, counts[1]);
    let everything = [Class, Lyapunov, Impacts, Mesh, Symmetric, Word, Pattern];
    Ok(if all { builder.quantities(&everything) } else { builder }.build()?)
}

/// Writes the shards into folders in `dir`. Returns the folders and the cost of each phase, among them what a shard does
/// before its first cell.
///
/// # Errors
/// If a file cannot be read or written.
pub fn write_shards(sizes: Sizes, dir: &Path) -> Result<(Vec<PathBuf>, Vec<Cost>)> {
    let small = job::run(&scene([sizes.small; 2], sizes.all)?, Processor::Cpu)?;
    let scene = scene(sizes.counts, sizes.all)?;
    let stretched = Stretched::new(&small, sizes.counts.map(|count| count as usize));
    let mut costs = Vec::new();
    let plan = phase::run("plan", &mut costs, || {
        let plan = Plan::new(&scene);
        plan.check().map(|()| plan)
    })?;
    phase::run("schedule of a shard", &mut costs, || {
        drop(Schedule::of(&plan, Shard::all(sizes.shards).next()));
    });
    let all = || (0..plan.flow_count() as u32).into_par_iter().map(|flow| plan.oscillator(flow));
    drop(phase::run("constants of all lanes", &mut costs, || -> Vec<_> {
        all().map(|oscillator| Constants::new(&oscillator, None)).collect()
    }));
    drop(phase::run("flows of all cells", &mut costs, || -> Vec<_> {
        all().map(|oscillator| Flow::new(&oscillator)).collect()
    }));
    let own = Identity::new("cpu", "f64", "event-driven reference", scene.identity());
    let write = |of: Shard| -> Result<PathBuf> {
        let folder = Folder::open(&dir.join(format!("shard-{}-of-{}", of.index(), of.count())), true)?;
        let mut file = RecordFile::create(&folder.path().join(RECORDS), &own.clone().of_shard(Some(of)))?;
        let mut tally = Tally::default();
        for ids in of.runs(&plan).chunks(BATCH) {
            let batch: Vec<(u32, Record)> = ids.par_iter().map(|&id| (id, stretched.record(id))).collect();
            file.append(&batch)?;
            tally.take(&plan, &batch);
        }
        let device = "event-driven reference";
        let engine = Provenance { engine: "cpu", precision: "f64", device, commit: "unknown" };
        let run = Run::new(engine, &[], "none: the records are invented");
        shard::write(
            &folder,
            &FinishedShard { shard: of, scene: &scene, plan: &plan, run: &run, tally: &tally },
        )?;
        Ok(folder.path().to_owned())
    };
    let folders: Result<_> =
        phase::run("shards", &mut costs, || Shard::all(sizes.shards).map(write).collect());
    Ok((folders?, costs))
}

/// Merges the shards. Returns the cost of each phase and the names of the files.
///
/// # Errors
/// If a file cannot be read or written.
pub fn merge(shards: &[PathBuf], out: &Path) -> Result<(Vec<Cost>, Vec<String>)> {
    let folder = Folder::open(out, true)?;
    let mut costs = Vec::new();
    let parts = phase::run("look at shards", &mut costs, || Parts::open(shards))?;
    let gathered = phase::run("gather records", &mut costs, || parts.gather(&folder, |_| true))?;
    let merged = phase::run("write files", &mut costs, || gathered.write(&folder))?;
    Ok((costs, merged.files))
}
