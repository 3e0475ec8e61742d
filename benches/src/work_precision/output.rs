//! The files of `work-precision`: tables, figures, cells for other programs, and the manifest.

use std::io::Write;

use serde::Serialize;
use serde_json::{Value, json};

use super::PERIODS;
use super::cells::{Kind, Subject};
use super::figure::{self, View};
use super::measure::Curve;
use super::points::Point;
use crate::write_rows;
use rattlemap::record::distance::farther;
use rattlemap::show::error::WriteError;
use rattlemap::show::parameters::Parameters;
use rattlemap::store::error::OutputError;
use rattlemap::store::folder::Folder;
use rattlemap::store::inventory;
use rattlemap::store::manifest::{Head, MANIFEST, joined};
use rattlemap_dynamics::model::State;

const TABLE: &str = "work_precision.csv";
const CELLS_TABLE: &str = "work_precision_cells.csv";
const CELLS: &str = "cells.json";

/// Every file that a run may write, the manifest last.
pub const FILES: [&str; 7] = [
    TABLE,
    CELLS_TABLE,
    CELLS,
    "work_precision.png",
    "work_precision_median.png",
    "work_precision_events.png",
    MANIFEST,
];

/// The figures.
const FIGURES: [(&str, View); 3] = [
    (
        "work_precision.png",
        View {
            title: "Run time against error, the worst cell of all: lower left is better",
            axis: "error of the state after 8 forcing periods, worst cell",
            error: |point| point.state_error_worst,
        },
    ),
    (
        "work_precision_median.png",
        View {
            title: "Run time against error, the median cell: lower left is better",
            axis: "error of the state after 8 forcing periods, median cell",
            error: |point| point.state_error_median,
        },
    ),
    (
        "work_precision_events.png",
        View {
            title: "Run time against error of event times, the worst cell of all: lower left is better",
            axis: "error of the times of the last two events, worst cell",
            error: |point| point.event_error_worst,
        },
    ),
];

/// Facts about a run, for the manifest.
#[derive(Clone, Debug, Serialize)]
pub struct Run<'a> {
    /// Name of the processor.
    pub processor: &'a str,
    /// Number of its cores.
    pub cores: usize,
    /// Name of the graphics adapter.
    pub adapter: &'a str,
    /// Number of timed rounds.
    pub rounds: usize,
    /// Whether sizes were tiny, so that the figures mean nothing.
    pub quick: bool,
    /// Sentences with ratios of time at equal error.
    pub ratios: &'a [String],
}

#[derive(Serialize)]
struct CellRow<'a> {
    method: &'a str,
    steps: Option<u32>,
    tolerance: Option<f64>,
    kind: Kind,
    e: f64,
    omega: f64,
    #[serde(rename = "F")]
    force: f64,
    state_error: f64,
    event_error: Option<f64>,
}

/// Writes all files. `peers` are points of other programs, which tables and figures include.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    run: &Run<'_>,
    subjects: &[Subject],
    curves: &[Curve],
    peers: &[Point],
) -> Result<(), OutputError> {
    let all: Vec<Point> =
        curves.iter().map(|curve| curve.point.clone()).chain(peers.iter().cloned()).collect();
    folder.replace(TABLE, |out| write_rows(out, &all))?;
    folder.replace(CELLS_TABLE, |out| write_cells(out, subjects, curves))?;
    let objects: Vec<_> = subjects.iter().map(subject).collect();
    folder.write_json(CELLS, &objects)?;
    let subtitle = format!("{} cores: {}; lanes on {}", run.cores, run.processor, run.adapter);
    for (name, view) in FIGURES {
        folder.replace(name, |out| figure::write(out, &subtitle, view, &all))?;
    }
    let manifest = joined([
        json!(Head::of("work-precision")),
        json!(run),
        json!({
            "periods": PERIODS,
            "cells": subjects.chunk_by(|a, b| a.cell == b.cell).map(cell).collect::<Vec<_>>(),
            "files": inventory::entries(folder, &FILES[..FILES.len() - 1])?,
        }),
    ]);
    inventory::write_manifest(folder, &manifest)
}

/// Describes a cell by the parameters of its first variant and the largest amplification of all variants.
fn cell(variants: &[Subject]) -> Value {
    let Subject { kind, pair, beyond, .. } = &variants[0];
    json!({
        "kind": kind,
        "e": pair.e,
        "omega": pair.omega,
        "F": pair.force,
        "beyond": beyond,
        "amplification": variants.iter().map(|subject| subject.amplification).fold(0.0, farther),
        "variants": variants.len(),
    })
}

/// Describes a subject for other programs.
fn subject(subject: &Subject) -> Value {
    let times = subject.exact.events.iter().filter(|t| !t.is_nan());
    json!({
        "kind": subject.kind,
        "parameters": Parameters::of(&subject.pair),
        "periods": PERIODS,
        "start": first_four(&subject.start),
        "state": first_four(&subject.exact.state),
        "events": times.collect::<Vec<_>>(),
    })
}

/// Returns the numbers of a state of two coordinates.
fn first_four(state: &State) -> [f64; 4] {
    std::array::from_fn(|i| state[i])
}

/// Writes one row per method, setting and cell, with the largest errors of the cell's variants.
fn write_cells(out: impl Write, subjects: &[Subject], curves: &[Curve]) -> Result<(), WriteError> {
    let mut rows = Vec::new();
    for Curve { point, errors } in curves {
        let mut errors = errors.iter();
        for variants in subjects.chunk_by(|a, b| a.cell == b.cell) {
            let (first, own) = (&variants[0], errors.by_ref().take(variants.len()));
            let (state_error, event_error) = own.fold((0.0f64, None::<f64>), |(state, event), error| {
                (farther(state, error.state), event.into_iter().chain(error.event).reduce(farther))
            });
            rows.push(CellRow {
                method: &point.method,
                steps: point.steps,
                tolerance: point.tolerance,
                kind: first.kind,
                e: first.pair.e,
                omega: first.pair.omega,
                force: first.pair.force,
                state_error,
                event_error,
            });
        }
    }
    write_rows(out, rows)
}
