//! Instruments: measurements of speed, accuracy and scale that everyone can repeat.

pub mod host_cost;
pub mod machines;
pub mod phase;
pub mod shapes;
pub mod work_precision;

use std::io::Write;

use rattlemap::show::error::WriteError;
use serde::Serialize;

/// Writes a table with one line per row. Its columns have the names of the rows' fields.
///
/// # Errors
/// If the table cannot be written.
pub fn write_rows<R: Serialize>(
    out: impl Write,
    rows: impl IntoIterator<Item = R>,
) -> Result<(), WriteError> {
    let mut writer = csv::Writer::from_writer(out);
    rows.into_iter().try_for_each(|row| writer.serialize(row))?;
    Ok(writer.flush()?)
}
