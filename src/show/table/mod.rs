//! Tables of results.

pub mod attractors_csv;
pub mod bifurcation_tables;
pub mod cell_columns;
pub mod cells_csv;
pub mod cells_npy;
pub mod compare_csv;
pub mod orbit_tables;
pub mod words_csv;
