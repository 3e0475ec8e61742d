//! `cells.csv`: one row per cell.

use std::fmt::{self, Write as _};
use std::io::{self, Write};
use std::ops::Range;

use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::table::cell_columns::{CellColumn, CellRow, location_names, of_csv};
use crate::show::table::words_csv::WordRows;
use crate::show::table::write_rows;

/// Writes the table.
pub fn write(mut out: impl Write, cells: &Cells<'_>, rows: &WordRows<'_>) -> Result<(), WriteError> {
    let columns = of_csv(cells);
    let mut header = csv::Writer::from_writer(&mut out);
    header.write_record(location_names(cells).chain(columns.iter().map(|column| &*column.name)))?;
    header.flush()?;
    drop(header);
    write_rows(&mut out, cells.count(), |ids| part(cells, rows, &columns, ids))
}

fn part(
    cells: &Cells<'_>,
    rows: &WordRows<'_>,
    columns: &[CellColumn],
    ids: Range<usize>,
) -> Result<Vec<u8>, WriteError> {
    let mut table = csv::Writer::from_writer(Vec::with_capacity(160 * ids.len()));
    let mut text = String::new();
    for id in ids {
        let cell = CellRow::new(cells, id);
        for place in cell.location() {
            table.write_field(written(&mut text, |to| write!(to, "{place}"))?)?;
        }
        for column in columns {
            table.write_field(written(&mut text, |to| (column.text)(&cell, rows, to))?)?;
        }
        // Ends the row.
        table.write_record(None::<&str>)?;
    }
    table.into_inner().map_err(|error| error.into_error().into())
}

/// Replaces `text` by what `write` writes.
fn written(text: &mut String, write: impl Fn(&mut String) -> fmt::Result) -> io::Result<&str> {
    text.clear();
    write(text).map_err(io::Error::other)?;
    Ok(text)
}
