//! `compare.csv`: one row per cell in which two maps differ by class, period, pattern or word.

use std::path::Path;

use crate::show::error::WriteError;
use crate::show::names;
use crate::show::table::cells_csv;
use crate::store::compare::Compared;

/// Fields after the indices and the axes.
const FIELDS: [&str; 7] = ["class_a", "period_a", "class_b", "period_b", "lyapunov_a", "lyapunov_b", "kind"];

/// Writes the table to `path`.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(path: &Path, compared: &Compared<'_>) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_path(path)?;
    let [a, b] = compared.sides.map(|side| side.cells);
    let places = cells_csv::places(a);
    table.write_record(places.iter().copied().chain(cells_csv::swept(a)).chain(FIELDS))?;
    let differing = compared.comparison.kinds.iter().enumerate();
    for (id, kind) in differing.filter_map(|(id, kind)| Some((id, (*kind)?))) {
        let values = a.values(id).into_iter().map(|value| format!("{value:?}"));
        let [a, b] = [a, b].map(|cells| cells.row(id));
        let [class_a, class_b] = [&a, &b].map(|row| row.class.map_or("", names::class).to_owned());
        let [period_a, period_b] = [&a, &b].map(|row| row.period.map_or(String::new(), |p| p.to_string()));
        let indices = a.indices[..places.len()].iter().map(ToString::to_string);
        table.write_record(indices.chain(values).chain([
            class_a,
            period_a,
            class_b,
            period_b,
            names::float(a.lyapunov),
            names::float(b.lyapunov),
            kind.name().to_owned(),
        ]))?;
    }
    Ok(table.flush()?)
}
