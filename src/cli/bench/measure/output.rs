//! The folder of `bench engines`: tables, figures and manifest.

use std::collections::BTreeMap;
use std::io::Write;

use crate::gpu::DeviceTimes;
use crate::show::error::WriteError;
use crate::store::error::OutputError;
use serde::Serialize;

use super::check::Check;
use super::{Point, Run, SCENE, Series, figure};
use crate::cli::bench::statistics::Spread;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::{Head, MANIFEST};
use crate::validate::Kind;
use rattlemap_dynamics::orbit::Class;

const TABLE: &str = "engines.csv";
const RUNS: &str = "runs.csv";
const FIGURE: &str = "engines.png";
const STAGES: &str = "stages.png";

/// What was asked for, and on what it ran.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Seconds that all of it might take.
    pub budget_seconds: f64,
    /// Whether sizes were tiny.
    pub quick: bool,
    /// Processor cores of the machine.
    pub cores: usize,
    /// The processor's name.
    pub processor: String,
    /// Operations per second at the peak, by series; none where it is not known.
    pub peaks: Vec<Option<f64>>,
}

/// Writes all files, the manifest last; returns their names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, series: &[Series], asked: &Asked) -> Result<Vec<&'static str>, OutputError> {
    folder.remove(&[MANIFEST, TABLE, RUNS, FIGURE, STAGES])?;
    folder.replace(TABLE, |out| write_table(out, series, asked))?;
    folder.replace(RUNS, |out| write_runs(out, series))?;
    folder.replace(FIGURE, |out| figure::write_rates(out, series, &asked.processor))?;
    folder.replace(STAGES, |out| figure::write_stages(out, series))?;
    let files = [TABLE, RUNS, FIGURE, STAGES];
    let listed = inventory::entries(folder, &files)?;
    inventory::write_manifest(folder, &manifest(series, asked, &listed))?;
    Ok([&files[..], &[MANIFEST]].concat())
}

/// Shares of the peak that a point's counted operations come to, at least and at most.
pub fn shares_of_peak(series: &Series, point: &Point, peak: Option<f64>) -> Option<[f64; 2]> {
    let (work, peak) = (series.work.as_ref()?, peak?);
    let rate = point.spread(Run::rate).median;
    Some([work.at_least(), work.at_most()].map(|operations| rate * operations / peak))
}

/// Share of the integration in which the device worked, by its own clock.
pub fn device_share(run: &Run) -> f64 {
    device(run, |device| device.busy / run.times.integrate)
}

/// A number of the device's own clock, if it has one.
fn device(run: &Run, of: impl Fn(DeviceTimes) -> f64) -> f64 {
    run.times.device.map_or(f64::NAN, of)
}

/// A column of the tables: its name and its number.
type Field = (&'static str, fn(&Run) -> f64);

/// What is told of a run as it is and of a point by its median.
const STAGE_FIELDS: [Field; 10] = [
    ("prepare_s", |run| run.times.prepare),
    ("upload_s", |run| run.times.upload),
    ("integrate_s", |run| run.times.integrate),
    ("read_s", |run| run.times.read),
    ("write_s", |run| run.times.write),
    ("device_s", |run| device(run, |device| device.busy)),
    ("device_share", device_share),
    ("longest_dispatch_s", |run| device(run, |device| device.longest_dispatch)),
    ("idle_s", |run| device(run, |device| device.idle)),
    ("longest_gap_s", |run| device(run, |device| device.longest_gap)),
];

/// What is told of a point with its range, too.
const RATE_FIELDS: [Field; 2] = [("lane_periods_per_s", Run::rate), ("lane_steps_per_s", Run::step_rate)];

const KEYS: [&str; 5] = ["engine", "precision", "device", "threads", "lanes"];

/// Four significant digits; nothing for what is not known.
fn number(x: f64) -> String {
    if x.is_finite() {
        format!("{x:.3e}").parse().map_or(String::new(), |x: f64| format!("{x:?}"))
    } else {
        String::new()
    }
}

fn keys(series: &Series, point: &Point) -> Vec<String> {
    let engine = &series.engine;
    vec![
        engine.name().to_owned(),
        engine.precision().to_owned(),
        engine.device().to_owned(),
        engine.threads().map_or(String::new(), |threads| threads.to_string()),
        point.lanes.to_string(),
    ]
}

/// One row per engine and size.
fn write_table(out: impl Write, all: &[Series], asked: &Asked) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let mut header: Vec<String> = KEYS.map(ToOwned::to_owned).to_vec();
    header.push("runs".to_owned());
    header.extend(STAGE_FIELDS.map(|(name, _)| name.to_owned()));
    for (name, _) in RATE_FIELDS {
        header.extend([name.to_owned(), format!("{name}_low"), format!("{name}_high")]);
    }
    header.extend(["peak_share_at_least", "peak_share_at_most"].map(ToOwned::to_owned));
    header.extend(Class::NAMES.map(ToOwned::to_owned));
    header.push("cells_differing".to_owned());
    table.write_record(header)?;
    for (series, &peak) in all.iter().zip(&asked.peaks) {
        for point in &series.points {
            let mut row = keys(series, point);
            row.push(point.runs.len().to_string());
            row.extend(STAGE_FIELDS.map(|(_, of)| number(point.spread(of).median)));
            for (_, of) in RATE_FIELDS {
                let Spread { median, low, high } = point.spread(of);
                row.extend([median, low, high].map(number));
            }
            let shares = shares_of_peak(series, point, peak).unwrap_or([f64::NAN; 2]);
            row.extend(shares.map(number));
            row.extend(point.classes.map(|count| count.to_string()));
            row.push(point.differing.map_or(String::new(), |count| count.to_string()));
            table.write_record(row)?;
        }
    }
    Ok(table.flush()?)
}

/// One row per run.
fn write_runs(out: impl Write, all: &[Series]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let fields = STAGE_FIELDS.iter().chain(&RATE_FIELDS);
    let header = KEYS.into_iter().chain(["run"]).chain(fields.clone().map(|(name, _)| *name));
    table.write_record(header)?;
    for series in all {
        for point in &series.points {
            for (nth, run) in point.runs.iter().enumerate() {
                let mut row = keys(series, point);
                row.push((nth + 1).to_string());
                row.extend(fields.clone().map(|(_, of)| number(of(run))));
                table.write_record(row)?;
            }
        }
    }
    Ok(table.flush()?)
}

#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    scene: &'static str,
    budget_seconds: f64,
    quick: bool,
    processor: &'a str,
    cores: usize,
    series: Vec<SeriesObject<'a>>,
    files: &'a [FileEntry],
}

#[derive(Serialize)]
struct SeriesObject<'a> {
    engine: &'static str,
    precision: &'static str,
    device: &'a str,
    threads: Option<usize>,
    open_seconds: f64,
    first_seconds: f64,
    lanes: Vec<usize>,
    skipped: Vec<SkippedObject<'a>>,
    /// Operations per second.
    peak: Option<f64>,
    work: Option<WorkObject>,
    check: Option<CheckObject>,
}

#[derive(Serialize)]
struct SkippedObject<'a> {
    lanes: usize,
    why: &'a str,
}

/// Per lane-period.
#[derive(Serialize)]
struct WorkObject {
    scan_steps: f64,
    careful_passes: f64,
    root_iterations: f64,
    operations_at_least: f64,
    operations_at_most: f64,
}

#[derive(Serialize)]
struct CheckObject {
    lanes: usize,
    samples: usize,
    mismatched: usize,
    kinds: BTreeMap<&'static str, usize>,
    faults: Vec<String>,
    /// Restitution and frequency of these cells.
    unexplained_cells: Vec<[f64; 2]>,
}

impl From<&Check> for CheckObject {
    fn from(Check { lanes, validation, unexplained }: &Check) -> CheckObject {
        let kinds = Kind::ALL.into_iter().map(|kind| (kind.name(), validation.of_kind(kind)));
        CheckObject {
            lanes: *lanes,
            samples: validation.replayed,
            mismatched: validation.mismatches.len(),
            kinds: kinds.filter(|(_, count)| *count > 0).collect(),
            faults: validation.faults(),
            unexplained_cells: unexplained.clone(),
        }
    }
}

fn manifest<'a>(all: &'a [Series], asked: &'a Asked, files: &'a [FileEntry]) -> Manifest<'a> {
    let object = |(series, &peak): (&'a Series, &Option<f64>)| SeriesObject {
        engine: series.engine.name(),
        precision: series.engine.precision(),
        device: series.engine.device(),
        threads: series.engine.threads(),
        open_seconds: series.open_seconds,
        first_seconds: series.first_seconds,
        lanes: series.points.iter().map(|point| point.lanes).collect(),
        skipped: series.skipped.iter().map(|(lanes, why)| SkippedObject { lanes: *lanes, why }).collect(),
        peak,
        work: series.work.as_ref().map(|work| WorkObject {
            scan_steps: work.iterations[0],
            careful_passes: work.iterations[1],
            root_iterations: work.iterations[2],
            operations_at_least: work.at_least(),
            operations_at_most: work.at_most(),
        }),
        check: series.check.as_ref().map(CheckObject::from),
    };
    Manifest {
        head: Head::of("bench engines"),
        scene: SCENE,
        budget_seconds: asked.budget_seconds,
        quick: asked.quick,
        processor: &asked.processor,
        cores: asked.cores,
        series: all.iter().zip(&asked.peaks).map(object).collect(),
        files,
    }
}
