//! `cells.npy`: the cells as a structured array for `numpy.load`.

use std::io::Write;

use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::table::cell_columns::{CellRow, numpy_types, requested};
use crate::show::table::words_csv::WordRows;
use crate::show::table::write_rows;

/// The header ends at a multiple of this many bytes.
const ALIGNMENT: usize = 64;

/// Writes the array in version 1.0 of NumPy's format: one dimension, with the fields of `cells.csv` that the scene requests.
///
/// Classes, statuses and sources are codes. Words and patterns are rows of `words.csv`. Absent values are 0 (period, word,
/// pattern), NaN (numbers) or -1 (class, symmetry, attractor).
pub fn write(mut out: impl Write, cells: &Cells<'_>, rows: &WordRows<'_>) -> Result<(), WriteError> {
    let columns = requested(cells);
    let fields: String =
        numpy_types(cells, &columns).map(|(name, kind)| format!("('{name}', '{kind}'), ")).collect();
    let count = cells.count();
    let mut header = format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': ({count}, ), }}");
    let magic = b"\x93NUMPY\x01\x00";
    let begin = magic.len() + size_of::<u16>();
    let length = (begin + header.len() + 1).next_multiple_of(ALIGNMENT) - begin;
    header = format!("{header:<width$}\n", width = length - 1);
    out.write_all(magic)?;
    out.write_all(&(length as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    write_rows(&mut out, count, |ids| {
        let mut bytes = Vec::new();
        for id in ids {
            let cell = CellRow::new(cells, id);
            cell.indices().iter().for_each(|&index| bytes.extend((index as u32).to_le_bytes()));
            cells.values(id).iter().for_each(|value| bytes.extend(value.to_le_bytes()));
            columns.iter().for_each(|column| column.value.put(&cell, rows, &mut bytes));
        }
        Ok(bytes)
    })
}
