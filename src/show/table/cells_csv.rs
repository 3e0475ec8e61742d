//! `cells.csv`: one row per cell.

use std::io::Write;
use std::ops::Range;

use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::table::cell_columns::{CellColumn, CellRow, location_names, of_csv};
use crate::show::table::write_rows;

/// Writes the table.
pub fn write(mut out: impl Write, cells: &Cells<'_>) -> Result<(), WriteError> {
    let columns = of_csv(cells);
    let mut header = csv::Writer::from_writer(&mut out);
    header.write_record(location_names(cells).chain(columns.iter().map(|column| &*column.name)))?;
    header.flush()?;
    drop(header);
    write_rows(&mut out, cells.count(), |ids| part(cells, &columns, ids))
}

fn part(cells: &Cells<'_>, columns: &[CellColumn], ids: Range<usize>) -> Result<Vec<u8>, WriteError> {
    let mut table = csv::Writer::from_writer(Vec::with_capacity(160 * ids.len()));
    for id in ids {
        let cell = CellRow::new(cells, id);
        table.write_record(cell.location().chain(columns.iter().map(|column| (column.text)(&cell))))?;
    }
    table.into_inner().map_err(|error| error.into_error().into())
}
