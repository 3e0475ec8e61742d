//! The folder of a shard: its records, and a manifest.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};

use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::record::Record;
use crate::record::classify::{classify, status};
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::map::{described_engine, integration, run_and_scene, timings};
use crate::store::manifest::{self, MANIFEST, joined};
use crate::store::map::{self, Run};
use crate::store::map_json::resumed;
use crate::store::record_file::RECORDS;
use crate::store::unfinished;
use rattlemap_dynamics::orbit::{Class, Status};

/// Counts over the records of a shard. As in a map, only the first of several starts of a cell is counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of cells of each class.
    pub classes: [usize; Class::NAMES.len()],
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
        Class::NAMES.into_iter().zip(self.classes).collect()
    }

    fn statuses(&self) -> BTreeMap<&'static str, usize> {
        let count = |status: Status| self.statuses.get(&status.code()).copied().unwrap_or(0);
        Status::ALL.iter().map(|&status| (status.name(), count(status))).collect()
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
    let timings = timings(finished.run, clock.elapsed(), folder.writing_times());
    inventory::write_manifest(folder, &manifest(finished, timings, &listed))?;
    files.extend([RECORDS, MANIFEST].map(str::to_owned));
    unfinished::clear(folder)?;
    Ok(files)
}

/// Returns the manifest of a shard: the fields of a map's manifest that do not need the records of other shards.
fn manifest(finished: &FinishedShard<'_>, timings: Value, files: &[FileEntry]) -> Value {
    let FinishedShard { shard, scene, run, .. } = *finished;
    joined([
        run_and_scene("map", Some(shard), run, scene),
        json!({ "start": manifest::start(scene), "integration": integration(scene, run.lane_grid) }),
        counts(finished),
        json!({
            "elapsed_seconds": (run.elapsed_before + run.elapsed).as_secs_f64(),
            "resumed_cells": run.resumed_cells,
            "timings": timings,
            "files": files,
        }),
    ])
}

/// Counts the cells of the map and, for the shard, runs, classes, statuses and forcing periods.
fn counts(finished: &FinishedShard<'_>) -> Value {
    let FinishedShard { shard, plan, tally, .. } = *finished;
    json!({
        "cells": plan.cell_count(),
        "runs": shard.run_count(plan),
        "classes": tally.classes(),
        "statuses": tally.statuses(),
        "periods": tally.periods,
    })
}

/// Returns the object that `map --shard --json` prints for a shard whose files were written to a folder. Scripts depend
/// on its fields.
pub fn object(folder: &Path, files: &[String], finished: &FinishedShard<'_>) -> Value {
    let FinishedShard { shard, run, .. } = *finished;
    joined([
        json!({ "folder": folder.to_string_lossy(), "files": files, "shard": shard }),
        described_engine(run),
        counts(finished),
        json!({
            "resumed": resumed(run),
            "seconds": { "open": run.opening.as_secs_f64(), "integrate": run.elapsed.as_secs_f64() },
        }),
    ])
}
