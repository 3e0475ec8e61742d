//! Section points as a table: one row per point.

use std::io;

use crate::map::bifurcation::{Column, Direction, SectionPoint};
use crate::show::error::WriteError;
use crate::show::names;
use crate::show::table::cell_columns::Values;
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::orbit::EventKind;

/// Point fields after `class`, `period` and `status`; the state before and after follows.
const POINT_FIELDS: [&str; 3] = ["side", "kind", "t_mod_period"];

/// Writes the columns; the first field is named after the swept parameter, the last
/// ones after the components of the state.
///
/// A column without points (no contact at all) still has one row, with empty point fields,
/// so that no value of the axis is missing from the table.
///
/// # Errors
/// If the table cannot be written.
pub(crate) fn write(
    to: impl io::Write,
    axis: &str,
    names: &[&str],
    columns: &[Column],
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(to);
    let before: Vec<String> = names.iter().map(|name| format!("{name}_before")).collect();
    let states = before.iter().map(String::as_str).chain(names.iter().copied());
    let first = [axis].into_iter().chain(direction_field(columns)).chain(["class", "period", "status"]);
    table.write_record(first.chain(POINT_FIELDS).chain(states))?;
    for column in columns {
        let head = head(column);
        for point in &column.points {
            table.write_record(head.iter().cloned().chain(fields(point, names.len())))?;
        }
        if column.points.is_empty() {
            let empty = std::iter::repeat_n(String::new(), POINT_FIELDS.len() + 2 * names.len());
            table.write_record(head.into_iter().chain(empty))?;
        }
    }
    Ok(table.flush()?)
}

/// The points by column, each of its own type: what the table says but for class, period and status. Columns without
/// points are not among them. Directions are numbered as [`Direction::BOTH`], kinds as [`KINDS`].
pub(crate) fn points(axis: &str, names: &[&str], columns: &[Column]) -> Vec<(String, Values)> {
    let all = || columns.iter().flat_map(|column| column.points.iter().map(move |point| (column, point)));
    let floats = |of: &dyn Fn(&Column, &SectionPoint) -> f64| {
        let finite = |x: f64| if x.is_finite() { x } else { f64::NAN };
        Values::F64(all().map(|(column, point)| finite(of(column, point))).collect())
    };
    let place = |column: &Column| Direction::BOTH.iter().position(|way| Some(*way) == column.direction);
    let directions = || all().map(|(column, _)| place(column).unwrap_or_default() as i8).collect();
    let kind = |point: &SectionPoint| KINDS.iter().position(|kind| *kind == point.kind).unwrap_or_default();
    let mut list = vec![(axis.to_owned(), floats(&|column, _| column.value))];
    list.extend(direction_field(columns).map(|name| (name.to_owned(), Values::I8(directions()))));
    let [side, kinds, time] = POINT_FIELDS.map(str::to_owned);
    list.push((side, Values::I8(all().map(|(_, point)| names::side(point.side)).collect())));
    list.push((kinds, Values::I8(all().map(|(_, point)| kind(point) as i8).collect())));
    list.push((time, floats(&|_, point| point.t_mod_period)));
    for (i, name) in names.iter().enumerate() {
        list.push((format!("{name}_before"), floats(&|_, point| point.before[i])));
    }
    for (i, name) in names.iter().enumerate() {
        list.push(((*name).to_owned(), floats(&|_, point| point.after[i])));
    }
    list
}

/// The kinds of points, by their numbers in columns.
const KINDS: [EventKind; 3] = [EventKind::Impact, EventKind::MeshStart, EventKind::MeshEnd];

/// The names of kinds and directions, by their numbers in columns.
pub(crate) fn point_codes() -> [Vec<&'static str>; 2] {
    [KINDS.map(names::kind).to_vec(), Direction::BOTH.map(Direction::name).to_vec()]
}

/// The name of a field that only diagrams with both passes have.
pub(crate) fn direction_field(columns: &[Column]) -> Option<&'static str> {
    columns.iter().any(|column| column.direction.is_some()).then_some("direction")
}

/// The fields of each row that tell its column: value, direction, class, period, status.
pub(crate) fn head(column: &Column) -> Vec<String> {
    let period = names::period(column.class).map(|period| period.to_string());
    let direction = column.direction.map(|direction| direction.name().to_owned());
    let rest = [
        names::class(column.class).to_owned(),
        period.unwrap_or_default(),
        names::status(column.status).to_owned(),
    ];
    [names::float(column.value)].into_iter().chain(direction).chain(rest).collect()
}

fn fields(point: &SectionPoint, components: usize) -> impl Iterator<Item = String> {
    let head = [
        names::side(point.side).to_string(),
        names::kind(point.kind).to_owned(),
        names::float(point.t_mod_period),
    ];
    let state = move |state: State| state.into_iter().take(components).map(names::float);
    head.into_iter().chain(state(point.before)).chain(state(point.after))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::Side;
    use rattlemap_dynamics::orbit::Class;

    #[test]
    fn one_row_per_point_and_one_for_none() {
        let point = SectionPoint {
            side: Side::Left,
            kind: EventKind::MeshStart,
            t_mod_period: 0.1,
            before: [1.0, -2.0, 1.5, 1e-7],
            after: [1.0, 0.1 + 0.2, 1.5, f64::NAN],
        };
        let column = |value, class, points| Column { points, ..Column::plain(value, class) };
        let columns = [
            column(0.25, Class::Periodic { period: 2 }, vec![point, point]),
            column(1.0, Class::Chaotic, vec![]),
        ];
        let mut text = Vec::new();
        write(&mut text, "e", &["x1", "v1", "x2", "v2"], &columns).unwrap();
        let row = "0.25,periodic,2,ok,-1,mesh_start,0.1,1.0,-2.0,1.5,1e-7,1.0,0.30000000000000004,1.5,";
        let expected = format!(
            "e,class,period,status,side,kind,t_mod_period,x1_before,v1_before,x2_before,v2_before,x1,v1,x2,v2\n\
             {row}\n{row}\n1.0,chaotic,,ok,,,,,,,,,,,\n"
        );
        assert_eq!(String::from_utf8(text).unwrap(), expected);
        let up = Column { direction: Some(Direction::Up), ..columns[1].clone() };
        let mut text = Vec::new();
        write(&mut text, "e", &["x1", "v1"], &[up]).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(
            text.starts_with("e,direction,class,") && text.ends_with("\n1.0,up,chaotic,,ok,,,,,,,\n"),
            "{text}"
        );
    }
}
