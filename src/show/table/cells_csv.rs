//! `cells.csv`: one row per cell.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use rayon::prelude::*;

use crate::map::scene::Quantity;
use crate::record::Spelling;
use crate::show::cells::{Cells, Row};
use crate::show::error::WriteError;
use crate::show::names::{self, float};

/// Cells whose rows are formatted at a time, all cores together.
const BLOCK: usize = 1 << 16;
/// Cells per task.
const PART: usize = 1 << 12;

/// The last field of maps that count attractors.
pub(crate) const ATTRACTORS: &str = "attractors";

/// The last field of maps of basins.
pub(crate) const ATTRACTOR: &str = "attractor";

/// Fields after the indices and the axes.
const MEASURED: [&str; 8] = [
    "class",
    "period",
    "lyapunov",
    "lyapunov_error",
    "impacts_per_period",
    "mesh_fraction",
    "symmetric",
    "word",
];

/// After the word, where it is asked for.
const PATTERN: &str = "pattern";

/// Fields after these.
const RUN: [&str; 3] = ["status", "periods_run", "source"];

/// Writes the table to `path`.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(path: &Path, cells: &Cells<'_>) -> Result<(), WriteError> {
    let mut file = BufWriter::new(File::create(path)?);
    let mut header = csv::Writer::from_writer(Vec::new());
    let counted = cells.attractors().map(|_| ATTRACTORS).or(cells.basins().map(|_| ATTRACTOR));
    let pattern = cells.asks(Quantity::Pattern).then_some(PATTERN);
    let fields = MEASURED.into_iter().chain(pattern).chain(RUN).chain(counted);
    header.write_record(places(cells).iter().copied().chain(swept(cells)).chain(fields))?;
    file.write_all(&finished(header)?)?;
    let [columns, rows] = cells.counts();
    let count = columns * rows;
    for block in (0..count).step_by(BLOCK) {
        let end = count.min(block + BLOCK);
        let starts: Vec<usize> = (block..end).step_by(PART).collect();
        let parts = starts.par_iter().map(|&start| part(cells, start..end.min(start + PART)));
        for part in parts.collect::<Result<Vec<_>, WriteError>>()? {
            file.write_all(&part)?;
        }
    }
    Ok(file.flush()?)
}

/// Names of the first fields, which a list does not have: there a row's number tells as much.
pub(crate) fn places(cells: &Cells<'_>) -> &'static [&'static str] {
    if cells.scene().list().is_some() { &[] } else { &["i", "j"] }
}

/// Names of the fields after those.
pub(crate) fn swept<'a>(cells: &Cells<'a>) -> impl Iterator<Item = &'a str> {
    cells.scene().swept().map(|parameter| &*parameter.name)
}

fn part(cells: &Cells<'_>, ids: std::ops::Range<usize>) -> Result<Vec<u8>, WriteError> {
    let mut table = csv::Writer::from_writer(Vec::with_capacity(160 * ids.len()));
    let places = places(cells);
    for id in ids {
        let row = cells.row(id);
        let places = row.indices[..places.len()].iter().map(|index| index.to_string());
        let values = cells.values(id).into_iter().map(|value| format!("{value:?}"));
        let pattern = cells.asks(Quantity::Pattern).then(|| spelled(cells.pattern(id)));
        let label = || row.attractor.map_or(String::new(), |label| label.to_string());
        let counted = row.attractors.map(|count| count.to_string()).or(cells.basins().map(|_| label()));
        let fields = measured(&row, spelled(cells.word(id))).into_iter().chain(pattern).chain(run(&row));
        table.write_record(places.chain(values).chain(fields).chain(counted))?;
    }
    finished(table)
}

fn finished(table: csv::Writer<Vec<u8>>) -> Result<Vec<u8>, WriteError> {
    table.into_inner().map_err(|error| error.into_error().into())
}

fn spelled(word: Option<Spelling>) -> String {
    word.map_or(String::new(), |word| word.in_table())
}

fn measured(row: &Row, word: String) -> [String; 8] {
    [
        row.class.map_or(String::new(), |class| names::class(class).to_owned()),
        row.period.map_or(String::new(), |period| period.to_string()),
        float(row.lyapunov),
        float(row.lyapunov_error),
        float(row.impacts_per_period),
        float(row.mesh_fraction),
        row.symmetric.map_or(String::new(), |symmetric| symmetric.to_string()),
        word,
    ]
}

fn run(row: &Row) -> [String; 3] {
    let [status, source] = [names::status(row.status), names::source(row.source)].map(str::to_owned);
    [status, row.periods_run.to_string(), source]
}
