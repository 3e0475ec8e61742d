//! Tables of results.

pub mod attractors_csv;
pub mod bifurcation_tables;
pub mod branch_tables;
pub mod cell_columns;
pub mod cells_csv;
pub mod cells_npy;
pub mod compare_csv;
pub mod curve_tables;
pub mod orbit_tables;
#[cfg(feature = "files")]
pub mod share_tables;
pub mod words_csv;

use std::io::Write;
use std::ops::Range;

use rayon::prelude::*;

use crate::show::error::WriteError;

/// Number of rows that all cores together format at a time.
const BLOCK: usize = 1 << 16;
/// Number of rows per task.
const PART: usize = 1 << 12;

/// Writes `count` rows in order. `part` returns the bytes of a range of rows and is called in parallel.
fn write_rows(
    out: &mut impl Write,
    count: usize,
    part: impl Fn(Range<usize>) -> Result<Vec<u8>, WriteError> + Sync,
) -> Result<(), WriteError> {
    for block in (0..count).step_by(BLOCK) {
        let end = count.min(block + BLOCK);
        let starts: Vec<usize> = (block..end).step_by(PART).collect();
        let parts = starts.par_iter().map(|&start| part(start..end.min(start + PART)));
        for part in parts.collect::<Result<Vec<_>, WriteError>>()? {
            out.write_all(&part)?;
        }
    }
    Ok(out.flush()?)
}

#[cfg(test)]
mod tests {
    use crate::model_file::FileModel;

    /// Columns beside which a table has columns with the names of parameters or of components of the state.
    #[test]
    fn names_of_columns_are_reserved_in_models() {
        let text = FileModel::built_in("bilinear").unwrap().definition().text.clone();
        let fixed = [
            &super::attractors_csv::FIELDS_BEFORE[..],
            &super::attractors_csv::FIELDS_AFTER,
            &super::bifurcation_tables::POINT_FIELDS,
            &super::bifurcation_tables::COLUMN_FIELDS,
            &["i", "j", "t", "phase", "direction", "domain", "event", "side", "moment"],
        ];
        let of_cells = super::cell_columns::all_names();
        for name in fixed.concat().into_iter().chain(of_cells.iter().map(String::as_str)) {
            let named = text.replace("zeta", name);
            let error = FileModel::parse(&named, "m.toml").expect_err(name).to_string();
            assert!(error.contains(&format!("`{name}` is ")) && error.contains("cannot be used"), "{error}");
        }
    }
}
