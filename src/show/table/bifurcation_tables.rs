//! Tables of a bifurcation diagram: section points, states at phase 0, and one row per value of the axis.

use std::io;

use crate::map::bifurcation::{Column, SectionPoint};
use crate::record::Spelling;
use crate::show::error::WriteError;
use crate::show::names::{self, float, optional};
use crate::show::numbers::Number;
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::word::Word;

/// Columns of a point before its states.
pub(super) const POINT_FIELDS: [&str; 3] = ["side", "kind", "t_mod_period"];

/// Columns of the table of columns after value and direction.
pub(super) const COLUMN_FIELDS: [&str; 11] = [
    "class",
    "period",
    "word",
    "pattern",
    "lyapunov",
    "lyapunov_error",
    "impacts_per_period",
    "mesh_fraction",
    "symmetric",
    "status",
    "periods_run",
];

/// Writes `bifurcation.csv`: the section points, with the states before and after the event. The last column is the gap's name if `gaps` has
/// the names of several.
pub fn write_points(
    out: impl io::Write,
    axis: &str,
    names: &[&str],
    gaps: Option<&[String]>,
    columns: &[Column],
) -> Result<(), WriteError> {
    let fields = POINT_FIELDS.map(str::to_owned).into_iter().chain(state_fields(names));
    let fields = fields.chain(gaps.map(|_| "gap".to_owned()));
    write_rows(out, axis, fields.collect(), columns, |column| {
        let states = |point: &SectionPoint| [point.before, point.after].map(|state| texts(state, names));
        let row = |point: &SectionPoint| {
            let head = [names::side_code(point.side).to_string(), point.kind.name().to_owned()];
            let head = head.into_iter().chain([float(point.t_mod_period)]);
            let gap = gaps.map(|gaps| gaps[point.gap].clone());
            head.chain(states(point).concat()).chain(gap).collect()
        };
        column.points.iter().map(row).collect()
    })
}

/// Writes `bifurcation_strobe.csv`: the states at phase 0.
pub fn write_strobes(
    out: impl io::Write,
    axis: &str,
    names: &[&str],
    columns: &[Column],
) -> Result<(), WriteError> {
    let fields = names.iter().map(ToString::to_string).collect();
    write_rows(out, axis, fields, columns, |column| {
        column.strobes.iter().map(|&state| texts(state, names)).collect()
    })
}

/// Writes a table with any number of rows per column of the diagram. A column without rows has one with empty fields, so that
/// no value of the axis is missing.
fn write_rows(
    out: impl io::Write,
    axis: &str,
    fields: Vec<String>,
    columns: &[Column],
    rows: impl Fn(&Column) -> Vec<Vec<String>>,
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let first = [axis].into_iter().chain(direction_field(columns)).chain(["class", "period", "status"]);
    table.write_record(first.chain(fields.iter().map(String::as_str)))?;
    for column in columns {
        let mut rows = rows(column);
        if rows.is_empty() {
            rows.push(vec![String::new(); fields.len()]);
        }
        let (class, status) = (column.class.name().to_owned(), column.status.name().to_owned());
        let head: Vec<String> =
            location(column).chain([class, optional(names::period(column.class)), status]).collect();
        for row in rows {
            table.write_record(head.iter().chain(&row))?;
        }
    }
    Ok(table.flush()?)
}

/// Writes `bifurcation_columns.csv`: class, word, exponent, averages and the requested `numbers` at each value of the axis.
pub fn write_columns(
    out: impl io::Write,
    axis: &str,
    numbers: &[Number],
    columns: &[Column],
) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let head = [axis].into_iter().chain(direction_field(columns)).chain(COLUMN_FIELDS);
    table.write_record(head.chain(numbers.iter().map(|number| &*number.name)))?;
    for column in columns {
        let measured = numbers.iter().map(|number| float(number.of_column(column)));
        let fields = location(column).chain([
            column.class.name().to_owned(),
            optional(names::period(column.class)),
            spelling(column.word.as_ref()),
            spelling(column.pattern().as_ref()),
            float(column.lyapunov),
            float(column.lyapunov_error),
            float(column.impacts_per_period),
            float(column.mesh_fraction),
            optional(column.symmetric),
            column.status.name().to_owned(),
            column.periods_run.to_string(),
        ]);
        table.write_record(fields.chain(measured))?;
    }
    Ok(table.flush()?)
}

/// Returns the name of the column of directions, which only diagrams with both passes have.
fn direction_field(columns: &[Column]) -> Option<&'static str> {
    columns.iter().any(|column| column.direction.is_some()).then_some("direction")
}

/// Returns the names of the columns of the states before and after an event.
fn state_fields<'n>(names: &'n [&'n str]) -> impl Iterator<Item = String> + 'n {
    let before = names.iter().map(|name| format!("{name}_before"));
    before.chain(names.iter().map(ToString::to_string))
}

/// Returns value and direction of a column.
fn location(column: &Column) -> impl Iterator<Item = String> {
    let direction = column.direction.map(|direction| direction.name().to_owned());
    [float(column.value)].into_iter().chain(direction)
}

fn texts(state: State, names: &[&str]) -> Vec<String> {
    state.into_iter().take(names.len()).map(float).collect()
}

fn spelling(word: Option<&Word>) -> String {
    word.map_or(String::new(), |word| Spelling::new(word).in_table())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::bifurcation::Direction;
    use rattlemap_dynamics::model::{Side, state};
    use rattlemap_dynamics::orbit::{Class, EventKind, Status};

    fn text(write: impl FnOnce(&mut Vec<u8>) -> Result<(), WriteError>) -> String {
        let mut bytes = Vec::new();
        write(&mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    fn upwards(column: &Column) -> [Column; 1] {
        [Column { direction: Some(Direction::Up), ..column.clone() }]
    }

    #[test]
    fn a_point_has_a_row_and_a_column_without_points_has_one_row() {
        let point = SectionPoint {
            gap: 1,
            side: Side::Left,
            kind: EventKind::MeshStart,
            t_mod_period: 0.1,
            before: state(&[1.0, -2.0, 1.5, 1e-7]),
            after: state(&[1.0, 0.1 + 0.2, 1.5, f64::NAN]),
        };
        let periodic = Column::plain(0.25, Class::Periodic { period: 2 });
        let columns = [Column { points: vec![point, point], ..periodic }, Column::plain(1.0, Class::Chaotic)];
        let row = "0.25,periodic,2,ok,-1,mesh_start,0.1,1.0,-2.0,1.5,1e-7,1.0,0.30000000000000004,1.5,";
        let expected = format!(
            "e,class,period,status,side,kind,t_mod_period,x1_before,v1_before,x2_before,v2_before,x1,v1,x2,v2\n\
             {row}\n{row}\n1.0,chaotic,,ok,,,,,,,,,,,\n"
        );
        assert_eq!(text(|out| write_points(out, "e", &["x1", "v1", "x2", "v2"], None, &columns)), expected);
        let gaps = ["a".to_owned(), "b".to_owned()];
        let text_of_gaps = text(|out| write_points(out, "e", &["x1", "v1"], Some(&gaps), &columns));
        let lines: Vec<&str> = text_of_gaps.lines().collect();
        assert!(
            lines[0].ends_with(",x1,v1,gap") && lines[1].ends_with(",0.30000000000000004,b"),
            "{text_of_gaps}"
        );
        assert!(lines[3].ends_with(",chaotic,,ok,,,,,,,,"), "{text_of_gaps}");
        let text = text(|out| write_points(out, "e", &["x1", "v1"], None, &upwards(&columns[1])));
        assert!(
            text.starts_with("e,direction,class,") && text.ends_with("\n1.0,up,chaotic,,ok,,,,,,,\n"),
            "{text}"
        );
    }

    #[test]
    fn a_period_has_a_row_and_a_column_without_states_has_one_row() {
        let strobes = vec![state(&[0.5, -1.0]), state(&[0.1 + 0.2, 2.0])];
        let columns = [
            Column { strobes, ..Column::plain(0.25, Class::Periodic { period: 2 }) },
            Column::plain(1.0, Class::Failed),
        ];
        assert_eq!(
            text(|out| write_strobes(out, "F", &["x", "v"], &columns)),
            "F,class,period,status,x,v\n0.25,periodic,2,ok,0.5,-1.0\n0.25,periodic,2,ok,0.30000000000000004,2.0\n\
             1.0,failed,,ok,,\n"
        );
        assert_eq!(
            text(|out| write_strobes(out, "F", &["x", "v"], &upwards(&columns[1]))),
            "F,direction,class,period,status,x,v\n1.0,up,failed,,ok,,\n"
        );
    }

    fn column(value: f64, class: Class) -> Column {
        let is_periodic = matches!(class, Class::Periodic { .. });
        Column {
            lyapunov: 0.25,
            lyapunov_error: (!is_periodic).then_some(0.1 + 0.2),
            impacts_per_period: 2.0,
            mesh_fraction: 0.125,
            symmetric: is_periodic.then_some(true),
            word: is_periodic.then(|| Word::cyclic(b"6333")),
            periods_run: 578,
            ..Column::plain(value, class)
        }
    }

    #[test]
    fn a_column_has_a_row_and_a_direction_where_there_are_two_passes() {
        let failed = Column { status: Status::TooStiff, ..Column::plain(1.0, Class::Failed) };
        let [lyapunov, impacts_per_period, mesh_fraction] = [f64::NAN; 3];
        let failed = Column { lyapunov, impacts_per_period, mesh_fraction, periods_run: 578, ..failed };
        let columns = [column(0.25, Class::Periodic { period: 2 }), column(0.5, Class::Chaotic), failed];
        let fields = "class,period,word,pattern,lyapunov,lyapunov_error,impacts_per_period,mesh_fraction,symmetric,status,\
                      periods_run";
        assert_eq!(
            text(|out| write_columns(out, "e", &[], &columns)),
            format!(
                "e,{fields}\n0.25,periodic,2,w3336,w36,0.25,,2.0,0.125,true,ok,578\n\
                 0.5,chaotic,,,,0.25,0.30000000000000004,2.0,0.125,,ok,578\n1.0,failed,,,,,,,,,too_stiff,578\n"
            )
        );
        let both = Direction::ALL
            .map(|direction| Column { direction: Some(direction), ..column(0.5, Class::Chaotic) });
        let text = text(|out| write_columns(out, "e", &[], &both));
        assert!(text.starts_with("e,direction,class,"), "{text}");
        assert!(text.contains("\n0.5,up,chaotic,") && text.contains("\n0.5,down,chaotic,"), "{text}");
    }

    #[test]
    fn long_words_are_hashed_as_in_the_tables_of_maps() {
        let long: Vec<u8> = (0..100).map(|i| b'1' + (i * i % 6) as u8).collect();
        let word = spelling(Some(&Word::cyclic(&long)));
        assert!(word.starts_with("w#") && word.ends_with("/100"), "{word}");
        assert_eq!(spelling(Some(&Word::default())), "w", "the word without events");
    }
}
