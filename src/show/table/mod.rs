//! Tables of results.

pub mod attractors_csv;
pub mod bifurcation_tables;
pub mod cell_columns;
pub mod cells_csv;
pub mod cells_npy;
pub mod compare_csv;
pub mod orbit_tables;
pub mod words_csv;

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
