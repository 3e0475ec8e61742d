//! Tables of the bifurcation curves of a map: their cycles, points where two conditions meet, and pairs of cells without a curve.

use std::io;

use crate::map::curves::{CurvePoint, Curves};
use crate::record::Spelling;
use crate::show::error::WriteError;
use crate::show::names::float;

/// Writes `curves.csv`: one row for each cycle on a curve. `states`: the names of the state's components.
pub fn write_curves(
    out: impl io::Write,
    axes: [&str; 2],
    states: &[&str],
    found: &Curves,
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let head = ["curve", "kind", "point", axes[0], axes[1], "word", "period", "stable"].map(str::to_owned);
    table.write_record(
        head.into_iter().chain(multipliers(states)).chain(["arclength".to_owned()]).chain(names(states)),
    )?;
    for (number, curve) in found.curves.iter().enumerate() {
        let word = Spelling::new(&curve.word).in_table();
        for (nth, point) in curve.points.iter().enumerate() {
            let head = [(number + 1).to_string(), curve.kind.name().to_owned(), (nth + 1).to_string()];
            let class = [word.clone(), curve.period.to_string(), point.stable.to_string()];
            let row = head.into_iter().chain(point.values.map(float)).chain(class);
            let row = row.chain(multiplier_values(point, states)).chain([float(point.arclength)]);
            table.write_record(row.chain(state_values(point, states)))?;
        }
    }
    Ok(table.flush()?)
}

/// Writes `curve_points.csv`: one row for each point of a curve at which the condition of another kind is met, too.
pub fn write_meetings(
    out: impl io::Write,
    axes: [&str; 2],
    states: &[&str],
    found: &Curves,
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let head = ["curve", "kind", "with", axes[0], axes[1]].map(str::to_owned);
    table.write_record(head.into_iter().chain(multipliers(states)).chain(names(states)))?;
    for meeting in &found.meetings {
        let kind =
            found.curves.get(meeting.curve - 1).map_or(String::new(), |curve| curve.kind.name().to_owned());
        let head = [meeting.curve.to_string(), kind, meeting.with.name().to_owned()];
        let row = head.into_iter().chain(meeting.at.values.map(float));
        let row = row.chain(multiplier_values(&meeting.at, states));
        table.write_record(row.chain(state_values(&meeting.at, states)))?;
    }
    Ok(table.flush()?)
}

/// Writes `unexplained.csv`: one row for each pair of neighbouring cells with different cycles, no curve between them, and no reason why none is
/// needed.
pub fn write_unexplained(out: impl io::Write, axes: [&str; 2], found: &Curves) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let names = [1, 2].map(|cell| axes.map(|axis| format!("{axis}_{cell}"))).concat();
    table.write_record(names.into_iter().chain(["reason".to_owned()]))?;
    for pair in &found.unexplained {
        table.write_record(pair.cells.concat().into_iter().map(float).chain([pair.reason.to_owned()]))?;
    }
    Ok(table.flush()?)
}

fn names(states: &[&str]) -> impl Iterator<Item = String> {
    states.iter().map(ToString::to_string)
}

fn multipliers(states: &[&str]) -> impl Iterator<Item = String> {
    (1..=states.len()).flat_map(|i| ["re", "im"].map(|part| format!("multiplier{i}_{part}")))
}

fn multiplier_values(point: &CurvePoint, states: &[&str]) -> impl Iterator<Item = String> {
    (0..states.len()).flat_map(|i| point.multipliers.get(i).copied().unwrap_or([f64::NAN; 2]).map(float))
}

fn state_values(point: &CurvePoint, states: &[&str]) -> impl Iterator<Item = String> {
    point.state.into_iter().take(states.len()).map(float)
}
