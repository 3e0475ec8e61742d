//! The stroboscopic section as a table: one row per state at phase 0.

use std::path::Path;

use crate::map::bifurcation::Column;
use crate::show::error::WriteError;
use crate::show::names;
use crate::show::table::bifurcation_csv::{direction_field, head};

/// Writes the columns to `path`; the first field is named after the swept parameter, the last ones after the components
/// of the state. A column without states, because it failed, still has one row.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(path: &Path, axis: &str, names: &[&str], columns: &[Column]) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_path(path)?;
    let first = [axis].into_iter().chain(direction_field(columns)).chain(["class", "period", "status"]);
    table.write_record(first.chain(names.iter().copied()))?;
    for column in columns {
        let head = head(column);
        for state in &column.strobes {
            let state = state.iter().take(names.len()).map(|value| names::float(*value));
            table.write_record(head.iter().cloned().chain(state))?;
        }
        if column.strobes.is_empty() {
            let empty = std::iter::repeat_n(String::new(), names.len());
            table.write_record(head.into_iter().chain(empty))?;
        }
    }
    Ok(table.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::bifurcation::Direction;
    use rattlemap_dynamics::orbit::Class;

    #[test]
    fn one_row_per_period_and_one_for_none() {
        let strobes = vec![[0.5, -1.0, 0.0, 0.0], [0.1 + 0.2, 2.0, 0.0, 0.0]];
        let columns = [
            Column { strobes, ..Column::plain(0.25, Class::Periodic { period: 2 }) },
            Column::plain(1.0, Class::Failed),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        write(&path, "F", &["x", "v"], &columns).unwrap();
        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "F,class,period,status,x,v\n0.25,periodic,2,ok,0.5,-1.0\n0.25,periodic,2,ok,0.30000000000000004,2.0\n\
             1.0,failed,,ok,,\n"
        );
        let up = Column { direction: Some(Direction::Up), ..columns[1].clone() };
        write(&path, "F", &["x", "v"], &[up]).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(text, "F,direction,class,period,status,x,v\n1.0,up,failed,,ok,,\n");
    }
}
