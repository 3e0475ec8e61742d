//! The folder of `bench engines`: one table, one figure, the manifest.

use std::collections::BTreeMap;
use std::io::Write;

use serde::Serialize;

use super::figure;
use super::measure::{Run, SCENE, SampleCheck, Series};
use super::spread::Spread;
use crate::gpu::DeviceTimes;
use crate::job::processor;
use crate::map::scene::FigureStyle;
use crate::show::error::WriteError;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::{Head, MANIFEST};
use crate::validate::Kind;
use rattlemap_dynamics::orbit::Class;

const TABLE: &str = "engines.csv";
const FIGURE: &str = "engines.png";

/// Writes all files, the manifest last, and returns their names.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write(
    folder: &Folder,
    all: &[Series],
    budget_seconds: f64,
    style: &FigureStyle,
) -> Result<[&'static str; 3], OutputError> {
    inventory::clear_for(folder, [TABLE, FIGURE])?;
    folder.replace(TABLE, |out| write_table(out, all))?;
    folder.replace(FIGURE, |out| figure::write(out, style, all, &processor::described()))?;
    let files = inventory::entries(folder, &[TABLE, FIGURE])?;
    inventory::write_manifest(folder, &manifest(all, budget_seconds, &files))?;
    Ok([TABLE, FIGURE, MANIFEST])
}

/// A column of the table: its name and its value in one run. The table has the median of the runs.
type Column = (&'static str, fn(&Run) -> f64);

const COLUMNS: [Column; 7] = [
    ("prepare_s", |run| run.prepare),
    ("integrate_s", |run| run.integrate),
    ("device_s", |run| device(run, |times| times.busy)),
    ("device_share", Run::device_share),
    ("longest_dispatch_s", |run| device(run, |times| times.longest_dispatch)),
    ("idle_s", |run| device(run, |times| times.idle)),
    ("longest_gap_s", |run| device(run, |times| times.longest_gap)),
];

fn device(run: &Run, of: impl Fn(DeviceTimes) -> f64) -> f64 {
    run.device.map_or(f64::NAN, of)
}

/// Formats four significant digits; empty for NaN.
fn number(x: f64) -> String {
    let rounded = format!("{x:.3e}").parse::<f64>();
    rounded.ok().filter(|x| x.is_finite()).map_or(String::new(), |x| format!("{x:?}"))
}

/// Writes one row per engine and size.
fn write_table(out: impl Write, all: &[Series]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let head = ["engine", "precision", "device", "lanes", "runs"].into_iter();
    let rates = ["lane_periods_per_s", "lane_periods_per_s_low", "lane_periods_per_s_high"];
    let names = head.chain(COLUMNS.map(|(name, _)| name)).chain(rates).chain(Class::NAMES);
    table.write_record(names.chain(["cells_differing"]))?;
    for series in all {
        for point in &series.points {
            let target = &series.target;
            let mut row =
                vec![target.engine().to_owned(), target.precision.name().to_owned(), target.device.clone()];
            row.extend([point.lanes, point.runs.len()].map(|count| count.to_string()));
            row.extend(COLUMNS.map(|(_, of)| number(point.spread(of).median)));
            let Spread { median, low, high } = point.spread(Run::rate);
            row.extend([median, low, high].map(number));
            row.extend(point.counts().map(|count| count.to_string()));
            row.push(point.differing.map_or(String::new(), |count| count.to_string()));
            table.write_record(row)?;
        }
    }
    Ok(table.flush()?)
}

#[derive(Serialize)]
struct EnginesManifest<'a> {
    #[serde(flatten)]
    head: Head,
    scene: &'static str,
    budget_seconds: f64,
    processor: String,
    cores: usize,
    series: Vec<SeriesObject<'a>>,
    files: &'a [FileEntry],
}

#[derive(Serialize)]
struct SeriesObject<'a> {
    engine: &'static str,
    precision: &'static str,
    device: &'a str,
    open_seconds: f64,
    skipped: Option<&'a (usize, String)>,
    check: Option<CheckObject<'a>>,
}

#[derive(Serialize)]
struct CheckObject<'a> {
    samples: usize,
    mismatched: usize,
    kinds: BTreeMap<&'static str, usize>,
    faults: Vec<String>,
    /// Restitution and frequency of each cell.
    unexplained_cells: &'a [[f64; 2]],
}

fn check_object(SampleCheck { validation, unexplained }: &SampleCheck) -> CheckObject<'_> {
    let kinds = Kind::ALL.into_iter().map(|kind| (kind.name(), validation.of_kind(kind)));
    CheckObject {
        samples: validation.replayed,
        mismatched: validation.mismatches.len(),
        kinds: kinds.filter(|(_, count)| *count > 0).collect(),
        faults: validation.faults(),
        unexplained_cells: unexplained,
    }
}

fn manifest<'a>(all: &'a [Series], budget_seconds: f64, files: &'a [FileEntry]) -> EnginesManifest<'a> {
    let object = |series: &'a Series| SeriesObject {
        engine: series.target.engine(),
        precision: series.target.precision.name(),
        device: &series.target.device,
        open_seconds: series.open_seconds,
        skipped: series.skipped.as_ref(),
        check: series.check.as_ref().map(check_object),
    };
    EnginesManifest {
        head: Head::of("bench engines"),
        scene: SCENE,
        budget_seconds,
        processor: processor::described(),
        cores: processor::cores(),
        series: all.iter().map(object).collect(),
        files,
    }
}
