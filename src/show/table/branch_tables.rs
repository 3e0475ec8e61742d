//! Tables of the branches of a bifurcation diagram: their cycles, and their special points.

use std::io;

use crate::map::branches::{BranchRow, Branches};
use crate::record::Spelling;
use crate::show::error::WriteError;
use crate::show::names::{self, float, optional};
use crate::show::numbers::Number;
use rattlemap_dynamics::cycle::Special;

/// Returns the name of a special point in tables.
fn name(kind: Special) -> &'static str {
    match kind {
        Special::Fold => "fold",
        Special::Flip => "flip",
        Special::Pitchfork => "pitchfork",
        Special::Grazing => "grazing",
        Special::Border => "border",
        Special::Value => "value",
    }
}

/// Writes `branches.csv`: one row for each cycle on a branch. `states`: the names of the state's components.
pub fn write_branches(
    out: impl io::Write,
    axis: &str,
    states: &[&str],
    numbers: &[Number],
    branches: &Branches,
) -> Result<(), WriteError> {
    let rows = || branches.rows.iter().filter(|row| row.special.is_none());
    write(out, &["branch", "arclength", axis], states, numbers, rows(), |row| {
        vec![row.branch.to_string(), float(row.arclength), float(row.column.value)]
    })
}

/// Writes `special_points.csv`: one row for each special point of a branch.
pub fn write_special_points(
    out: impl io::Write,
    axis: &str,
    states: &[&str],
    numbers: &[Number],
    branches: &Branches,
) -> Result<(), WriteError> {
    let rows = || branches.rows.iter().filter(|row| row.special.is_some());
    write(out, &["branch", "kind", "arclength", axis], states, numbers, rows(), |row| {
        let kind = row.special.map_or("", name).to_owned();
        vec![row.branch.to_string(), kind, float(row.arclength), float(row.column.value)]
    })
}

fn write<'r>(
    out: impl io::Write,
    head: &[&str],
    states: &[&str],
    numbers: &[Number],
    rows: impl Iterator<Item = &'r BranchRow>,
    start: impl Fn(&BranchRow) -> Vec<String>,
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let multipliers =
        (1..=states.len()).flat_map(|i| ["re", "im"].map(|part| format!("multiplier{i}_{part}")));
    let fields =
        head.iter().copied().map(str::to_owned).chain(["word", "period", "stable"].map(str::to_owned));
    let fields = fields.chain(states.iter().map(ToString::to_string)).chain(multipliers);
    table.write_record(fields.chain(numbers.iter().map(|number| number.name.clone())))?;
    for row in rows {
        let column = &row.column;
        let word = column.word.as_ref().map_or(String::new(), |word| Spelling::new(word).in_table());
        let class = [word, optional(names::period(column.class)), row.stable.to_string()];
        let state = column.state.into_iter().flatten().take(states.len()).map(float);
        let multiplier = |i: usize| row.multipliers.get(i).copied().unwrap_or([f64::NAN; 2]).map(float);
        let multipliers = (0..states.len()).flat_map(multiplier);
        let measured = numbers.iter().map(|number| float(number.of_column(column)));
        table.write_record(
            start(row).into_iter().chain(class).chain(state).chain(multipliers).chain(measured),
        )?;
    }
    Ok(table.flush()?)
}
