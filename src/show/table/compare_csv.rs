//! `compare.csv`: one row per cell in which two maps differ by class, period, pattern, word, motion or quantities.

use std::io::Write;

use crate::show::error::WriteError;
use crate::show::map_pair::MapPair;
use crate::show::names::{float, optional};
use crate::show::table::cell_columns::{CellRow, location_names};
use rattlemap_dynamics::orbit::Class;

/// Columns after indices and swept values.
const COMPARE_FIELDS: [&str; 8] =
    ["class_a", "period_a", "class_b", "period_b", "lyapunov_a", "lyapunov_b", "kind", "quantities"];

/// Writes the table.
pub fn write(out: impl Write, pair: &MapPair<'_>) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let cells = pair.sides.map(|side| side.cells);
    table.write_record(location_names(cells[0]).chain(COMPARE_FIELDS))?;
    let differing = pair.comparison.kinds.iter().enumerate();
    for (id, kind) in differing.filter_map(|(id, kind)| Some((id, (*kind)?))) {
        let [a, b] = cells.map(|cells| cells.row(id));
        table.write_record(CellRow::new(cells[0], id).location().map(|place| place.to_string()).chain([
            optional(a.class.map(Class::name)),
            optional(a.period),
            optional(b.class.map(Class::name)),
            optional(b.period),
            float(a.lyapunov),
            float(b.lyapunov),
            kind.name().to_owned(),
            // Names of the quantities that differ.
            pair.comparison.names_of_differing(id).collect::<Vec<_>>().join(" "),
        ]))?;
    }
    Ok(table.flush()?)
}
