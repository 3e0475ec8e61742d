//! `attractors.csv`: the attractors of a map of basins.

use std::io;

use crate::findings::attractors::{Attractor, Basins};
use crate::record::Spelling;
use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::names::{self, float, optional};
use rattlemap_dynamics::orbit::Class;

/// Columns before and after the strobe state.
pub(super) const FIELDS_BEFORE: [&str; 7] =
    ["label", "class", "period", "word", "exponent", "largest_multiplier", "symmetric"];
pub(super) const FIELDS_AFTER: [&str; 2] = ["cells", "share"];

/// Returns the name of an attractor in legends.
pub(crate) fn attractor_name(label: usize, attractor: &Attractor) -> String {
    let kind = match attractor.class {
        Class::Periodic { period } => format!("period {period}"),
        Class::QuasiPeriodic => "quasi-periodic".to_owned(),
        _ => "chaos".to_owned(),
    };
    let word = match &attractor.word {
        Some(word) if word.is_empty() && attractor.meshes => ", always in contact".to_owned(),
        Some(word) if word.is_empty() => ", no contact".to_owned(),
        Some(word) => format!(", word {}", Spelling::new(word).text()),
        None => String::new(),
    };
    format!("{label}: {kind}{word}")
}

/// Writes the table: one attractor per row, the largest basin first. The last columns are the swept parameters at which the
/// attractor was found.
pub fn write(out: impl io::Write, cells: &Cells<'_>, basins: &Basins) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let scene = cells.scene();
    let names = scene.base().state_names();
    let states = names.iter().map(|name| format!("strobe_{name}"));
    let axes = scene.axes().iter().enumerate();
    let swept: Vec<(usize, &str)> = axes
        .filter(|(_, axis)| !axis.target().is_start())
        .map(|(i, axis)| (i, &*axis.parameter().name))
        .collect();
    let before = FIELDS_BEFORE.iter().map(ToString::to_string);
    let after =
        FIELDS_AFTER.iter().map(ToString::to_string).chain(swept.iter().map(|(_, name)| (*name).to_owned()));
    table.write_record(before.chain(states).chain(after))?;
    let total = basins.labels().len() as f64;
    for (label, attractor) in basins.attractors().iter().enumerate() {
        let word = attractor.word.as_ref().map_or(String::new(), |word| Spelling::new(word).in_table());
        let before = [
            label.to_string(),
            attractor.class.name().to_owned(),
            optional(names::period(attractor.class)),
            word,
            float(attractor.exponent),
            float(attractor.multiplier),
            optional(attractor.symmetric),
        ];
        let state = (0..names.len()).map(|i| float(attractor.strobe.map(|state| state[i])));
        let after = [attractor.cells.to_string(), float(attractor.cells as f64 / total)];
        // Chaos is one attractor over all swept values, so it has none of its own.
        let is_cycle = attractor.strobe.is_some();
        let values = cells.values(attractor.cell);
        let at = swept.iter().map(|&(i, _)| float(Some(values[i]).filter(|_| is_cycle)));
        table.write_record(before.into_iter().chain(state).chain(after).chain(at))?;
    }
    Ok(table.flush()?)
}
