//! What the motion is at each value of the axis, as a table: one row per column of the diagram.

use std::io;

use crate::map::bifurcation::Column;
use crate::record::Spelling;
use crate::show::error::WriteError;
use crate::show::names::{self, float};
use crate::show::table::bifurcation_csv::direction_field;
use rattlemap_dynamics::word::Word;

/// Fields after the axis' value and the direction.
const FIELDS: [&str; 11] = [
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

/// Writes the columns; the first field is named after the swept parameter.
///
/// # Errors
/// If the table cannot be written.
pub(crate) fn write(to: impl io::Write, axis: &str, columns: &[Column]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record([axis].into_iter().chain(direction_field(columns)).chain(FIELDS))?;
    for column in columns {
        let direction = column.direction.map(|direction| direction.name().to_owned());
        table.write_record([float(column.value)].into_iter().chain(direction).chain(fields(column)))?;
    }
    Ok(table.flush()?)
}

fn fields(column: &Column) -> [String; 11] {
    [
        names::class(column.class).to_owned(),
        names::period(column.class).map_or(String::new(), |period| period.to_string()),
        spelled(column.word.as_ref()),
        spelled(column.pattern().as_ref()),
        float(column.lyapunov),
        float(column.lyapunov_error),
        float(column.impacts_per_period),
        float(column.mesh_fraction),
        column.symmetric.map_or(String::new(), |symmetric| symmetric.to_string()),
        names::status(column.status).to_owned(),
        column.periods_run.to_string(),
    ]
}

/// The word or pattern as a map's table has it.
fn spelled(word: Option<&Word>) -> String {
    word.map_or(String::new(), |word| Spelling::new(word).in_table())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::bifurcation::Direction;
    use rattlemap_dynamics::orbit::{Class, Status};

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

    fn written(columns: &[Column]) -> String {
        let mut text = Vec::new();
        write(&mut text, "e", columns).unwrap();
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn one_row_per_column_and_a_direction_where_there_are_two_passes() {
        let failed = Column {
            status: Status::TooStiff,
            lyapunov: f64::NAN,
            lyapunov_error: None,
            impacts_per_period: f64::NAN,
            mesh_fraction: f64::NAN,
            ..column(1.0, Class::Failed)
        };
        let columns = [column(0.25, Class::Periodic { period: 2 }), column(0.5, Class::Chaotic), failed];
        let fields = "class,period,word,pattern,lyapunov,lyapunov_error,impacts_per_period,mesh_fraction,symmetric,status,\
                      periods_run";
        assert_eq!(
            written(&columns),
            format!(
                "e,{fields}\n0.25,periodic,2,w3336,w36,0.25,,2.0,0.125,true,ok,578\n\
                 0.5,chaotic,,,,0.25,0.30000000000000004,2.0,0.125,,ok,578\n1.0,failed,,,,,,,,,too_stiff,578\n"
            )
        );
        let both = Direction::BOTH
            .map(|direction| Column { direction: Some(direction), ..column(0.5, Class::Chaotic) });
        let text = written(&both);
        assert!(text.starts_with("e,direction,class,"), "{text}");
        assert!(text.contains("\n0.5,up,chaotic,") && text.contains("\n0.5,down,chaotic,"), "{text}");
    }

    #[test]
    fn long_words_are_hashed_as_in_the_tables_of_maps() {
        let long: Vec<u8> = (0..100).map(|i| b'1' + (i * i % 6) as u8).collect();
        let long = Column { word: Some(Word::cyclic(&long)), ..column(0.5, Class::Periodic { period: 9 }) };
        let word = spelled(long.word.as_ref());
        assert!(word.starts_with("w#") && word.ends_with("/100"), "{word}");
        assert_eq!(spelled(Some(&Word::default())), "w", "a word without events is one");
    }
}
