//! The folder of `stress`: tables, figures, and the manifest.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::time::Duration;

use serde::Serialize;

use super::{Verdict, fuzz};
use rattlemap::show::error::WriteError;
use rattlemap::store::error::OutputError;
use rattlemap::store::folder::Folder;
use rattlemap::store::inventory::{self, FileEntry};
use rattlemap::store::manifest::{Head, MANIFEST};
use rattlemap_dynamics::model::{GearPair, Model};

/// All files that a run may write. Those of an earlier run are removed before anything is written.
const FILES: [&str; 15] = [
    MANIFEST,
    "long_runs.csv",
    "long_runs.png",
    "impacts.csv",
    "grazing.csv",
    "grazing.png",
    "chatter.csv",
    "stiffness.csv",
    "stiffness.png",
    "grid_swings.csv",
    "grid_motions.csv",
    "grid.png",
    "work.csv",
    "fuzz.csv",
    "fuzz_mismatches.csv",
];

#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    size: &'a str,
    seed: u64,
    device: &'a str,
    threads: usize,
    elapsed_seconds: f64,
    verdicts: Vec<VerdictObject<'a>>,
    files: &'a [FileEntry],
}

#[derive(Serialize)]
struct VerdictObject<'a> {
    part: &'a str,
    holds: bool,
    sentence: &'a str,
}

impl<'a> From<&'a (&'static str, Verdict)> for VerdictObject<'a> {
    fn from((part, Verdict { holds, sentence }): &'a (&'static str, Verdict)) -> Self {
        VerdictObject { part, holds: *holds, sentence }
    }
}

/// The files of a run.
#[derive(Debug)]
pub struct Files<'a> {
    folder: &'a Folder,
    names: Vec<&'static str>,
}

impl<'a> Files<'a> {
    /// Removes the files of an earlier run.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn new(folder: &'a Folder) -> Result<Files<'a>, OutputError> {
        folder.remove(&FILES)?;
        Ok(Files { folder, names: Vec::new() })
    }

    pub(super) fn write(
        &mut self,
        name: &'static str,
        write: &dyn Fn(&mut BufWriter<File>) -> Result<(), WriteError>,
    ) -> Result<(), OutputError> {
        self.names.push(name);
        self.folder.replace(name, write)
    }

    /// Writes a table with one line per row. Its columns have the names of the rows' fields.
    pub(super) fn table<R: Serialize>(&mut self, name: &'static str, rows: &[R]) -> Result<(), OutputError> {
        self.write(name, &|out| crate::write_rows(out, rows))
    }

    /// Writes the manifest, the last file: a folder that has one is complete. Returns the names of all files.
    ///
    /// # Errors
    /// If the manifest cannot be written.
    pub fn finish(
        mut self,
        (size, seed): (&str, u64),
        device: &str,
        elapsed: Duration,
        verdicts: &[(&'static str, Verdict)],
    ) -> Result<Vec<&'static str>, OutputError> {
        let files = &inventory::entries(self.folder, &self.names)?;
        let manifest = Manifest {
            head: Head::of("stress"),
            size,
            seed,
            device,
            threads: rayon::current_num_threads(),
            elapsed_seconds: elapsed.as_secs_f64(),
            verdicts: verdicts.iter().map(VerdictObject::from).collect(),
            files,
        };
        inventory::write_manifest(self.folder, &manifest)?;
        self.names.push(MANIFEST);
        Ok(self.names)
    }
}

/// Writes the cells that differ from the reference: engine, parameters, start, differences and explanation.
pub(super) fn mismatches(out: impl Write, mismatches: &[fuzz::Mismatch]) -> Result<(), WriteError> {
    let mut writer = csv::Writer::from_writer(out);
    let names = GearPair::PARAMETERS.iter().map(|parameter| &*parameter.name);
    let header = std::iter::once("engine").chain(names);
    writer.write_record(header.chain(["x1", "v1", "x2", "v2", "differences", "kind"]))?;
    for mismatch in mismatches {
        let values = (0..GearPair::PARAMETERS.len()).map(|index| mismatch.pair.value(index));
        let numbers = values.chain(mismatch.start[..4].iter().copied()).map(|number| format!("{number:?}"));
        let difference = |difference: &rattlemap::validate::Difference| {
            let side = |value| serde_json::to_string(value).unwrap_or_default().replace('"', "");
            let field = difference.field.name();
            format!("{field}: {} for {}", side(&difference.record), side(&difference.judge))
        };
        let differences: Vec<String> = mismatch.differences.iter().map(difference).collect();
        let last = [differences.join("; "), mismatch.kind.name().to_owned()];
        writer.write_record([mismatch.engine.name().to_owned()].into_iter().chain(numbers).chain(last))?;
    }
    Ok(writer.flush()?)
}
