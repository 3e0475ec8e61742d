//! The folder of `bench engines`: one table, one figure, the manifest.

use std::collections::BTreeMap;
use std::io::Write;

use serde_json::{Value, json};

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
use crate::store::manifest::{Head, MANIFEST, joined};
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

fn manifest(all: &[Series], budget_seconds: f64, files: &[FileEntry]) -> Value {
    joined([
        json!(Head::of("bench engines")),
        json!({
            "scene": SCENE,
            "budget_seconds": budget_seconds,
            "processor": processor::described(),
            "cores": processor::cores(),
            "series": all.iter().map(of_series).collect::<Vec<_>>(),
            "files": files,
        }),
    ])
}

fn of_series(series: &Series) -> Value {
    json!({
        "engine": series.target.engine(),
        "precision": series.target.precision.name(),
        "device": series.target.device,
        "open_seconds": series.open_seconds,
        "skipped": series.skipped,
        "check": series.check.as_ref().map(of_check),
    })
}

/// Describes a comparison with the reference. A cell without an explanation has its restitution and frequency.
fn of_check(SampleCheck { validation, unexplained }: &SampleCheck) -> Value {
    let kinds = Kind::ALL.into_iter().map(|kind| (kind.name(), validation.of_kind(kind)));
    json!({
        "samples": validation.replayed,
        "mismatched": validation.mismatches.len(),
        "kinds": kinds.filter(|(_, count)| *count > 0).collect::<BTreeMap<_, _>>(),
        "faults": validation.faults(),
        "unexplained_cells": unexplained,
    })
}
