//! The folder of `stress`: a table per part, figures, and the manifest.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::time::Duration;

use serde::Serialize;

use super::{Report, Verdict, figures, fuzz};
use rattlemap::show::error::WriteError;
use rattlemap::store::error::OutputError;
use rattlemap::store::folder::Folder;
use rattlemap::store::inventory::{self, FileEntry};
use rattlemap::store::manifest::{Head, MANIFEST};
use rattlemap_dynamics::model::{GearPair, Model};

/// All that a folder may hold: what an earlier run left goes before anything is written.
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

/// How a report was made.
#[derive(Clone, Copy, Debug)]
pub struct Made<'a> {
    /// `quick` or `full`.
    pub size: &'a str,
    /// Seed of everything random.
    pub seed: u64,
    /// What the lanes ran on.
    pub device: &'a str,
    /// How long it took.
    pub elapsed: Duration,
}

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

impl<'a> From<&'a Verdict> for VerdictObject<'a> {
    fn from(Verdict { part, holds, sentence }: &'a Verdict) -> Self {
        VerdictObject { part, holds: *holds, sentence }
    }
}

/// Writes tables and figures, and the manifest last: a folder that has one is complete.
/// Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, report: &Report, made: &Made<'_>) -> Result<Vec<&'static str>, OutputError> {
    folder.remove(&FILES)?;
    let mut files = Vec::new();
    let mut file = |name: &'static str, write: &dyn Fn(&mut BufWriter<File>) -> Result<(), WriteError>| {
        files.push(name);
        folder.replace(name, write)
    };
    let device = made.device;
    if let Some(found) = &report.long_runs {
        file("long_runs.csv", &|out| rows(out, found))?;
        file("long_runs.png", &|out| figures::long_runs(out, device, found))?;
    }
    if let Some(found) = &report.impacts {
        file("impacts.csv", &|out| rows(out, found))?;
    }
    if let Some(found) = &report.grazing {
        file("grazing.csv", &|out| rows(out, found))?;
        file("grazing.png", &|out| figures::grazing(out, device, found))?;
    }
    if let Some(found) = &report.chatter {
        file("chatter.csv", &|out| rows(out, found))?;
    }
    if let Some(found) = &report.stiffness {
        file("stiffness.csv", &|out| rows(out, found))?;
        file("stiffness.png", &|out| figures::stiffness(out, device, found))?;
    }
    if let Some(found) = &report.grid {
        file("grid_swings.csv", &|out| rows(out, &found.swings))?;
        file("grid_motions.csv", &|out| rows(out, &found.motions))?;
        file("grid.png", &|out| figures::grid(out, device, &found.swings))?;
    }
    if let Some(found) = &report.work {
        file("work.csv", &|out| rows(out, found))?;
    }
    if let Some(found) = &report.fuzz {
        file("fuzz.csv", &|out| rows(out, &found.counts))?;
        file("fuzz_mismatches.csv", &|out| mismatches(out, &found.mismatches))?;
    }
    let listed = inventory::entries(folder, &files)?;
    files.push(MANIFEST);
    let manifest = Manifest {
        head: Head::of("stress"),
        size: made.size,
        seed: made.seed,
        device: made.device,
        threads: rayon::current_num_threads(),
        elapsed_seconds: made.elapsed.as_secs_f64(),
        verdicts: report.verdicts.iter().map(VerdictObject::from).collect(),
        files: &listed,
    };
    inventory::write_manifest(folder, &manifest)?;
    Ok(files)
}

/// One line per row, under the names of its fields.
fn rows<R: Serialize>(out: impl Write, rows: &[R]) -> Result<(), WriteError> {
    let mut writer = csv::Writer::from_writer(out);
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    Ok(writer.flush()?)
}

/// Cells that differ from the reference: what they are, in what, and why.
fn mismatches(out: impl Write, mismatches: &[fuzz::Mismatch]) -> Result<(), WriteError> {
    let mut writer = csv::Writer::from_writer(out);
    let names = GearPair::PARAMETERS.iter().map(|parameter| &*parameter.name);
    let header = std::iter::once("engine").chain(names);
    writer.write_record(header.chain(["x1", "v1", "x2", "v2", "differences", "kind"]))?;
    for mismatch in mismatches {
        let values = (0..GearPair::PARAMETERS.len()).map(|index| mismatch.pair.value(index));
        let numbers = values.chain(mismatch.start).map(|number| format!("{number:?}"));
        let told = mismatch.differences.iter().map(|difference| {
            let side = |value| serde_json::to_string(value).unwrap_or_default().replace('"', "");
            let field = difference.field.name();
            format!("{field}: {} for {}", side(&difference.record), side(&difference.judge))
        });
        let told: Vec<String> = told.collect();
        writer.write_record(
            std::iter::once(mismatch.engine.name().to_owned())
                .chain(numbers)
                .chain([told.join("; "), mismatch.kind.name().to_owned()]),
        )?;
    }
    Ok(writer.flush()?)
}
