//! Tables of results, one module per format.

pub mod attractors_csv;
pub mod bifurcation_columns_csv;
pub mod bifurcation_csv;
pub mod bifurcation_strobe_csv;
pub mod cell_columns;
pub mod cells_csv;
pub mod cells_npy;
pub mod compare_csv;
pub mod orbit_tables;
pub mod words_csv;
