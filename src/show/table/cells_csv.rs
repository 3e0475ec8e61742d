//! `cells.csv`: one row per cell.

use std::io::Write;
use std::ops::Range;

use rayon::prelude::*;

use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::table::cell_columns::{CellColumn, CellRow, location_names, of_csv};

/// Number of rows formatted at a time by all cores together.
const BLOCK: usize = 1 << 16;
/// Number of rows per task.
const PART: usize = 1 << 12;

/// Writes the table.
pub fn write(mut out: impl Write, cells: &Cells<'_>) -> Result<(), WriteError> {
    let columns = of_csv(cells);
    let mut header = csv::Writer::from_writer(&mut out);
    header.write_record(location_names(cells).chain(columns.iter().map(|column| &*column.name)))?;
    header.flush()?;
    drop(header);
    let count = cells.count();
    for block in (0..count).step_by(BLOCK) {
        let end = count.min(block + BLOCK);
        let starts: Vec<usize> = (block..end).step_by(PART).collect();
        let parts = starts.par_iter().map(|&start| part(cells, &columns, start..end.min(start + PART)));
        for part in parts.collect::<Result<Vec<_>, WriteError>>()? {
            out.write_all(&part)?;
        }
    }
    Ok(out.flush()?)
}

fn part(cells: &Cells<'_>, columns: &[CellColumn], ids: Range<usize>) -> Result<Vec<u8>, WriteError> {
    let mut table = csv::Writer::from_writer(Vec::with_capacity(160 * ids.len()));
    for id in ids {
        let cell = CellRow::new(cells, id);
        table.write_record(cell.location().chain(columns.iter().map(|column| (column.text)(&cell))))?;
    }
    table.into_inner().map_err(|error| error.into_error().into())
}
