//! Results, written down: files in a guarded folder, and text for the terminal.

pub mod bifurcation;
mod bifurcation_csv;
pub mod bifurcation_figure;
mod bifurcation_manifest;
mod cells;
mod cells_csv;
mod cells_npy;
pub mod engines;
mod engines_figure;
pub mod folder;
mod layers;
mod manifest;
pub mod map;
mod map_figure;
mod map_manifest;
mod names;
pub mod orbit;
pub mod orbit_figures;
mod orbit_json;
mod orbit_summary;
mod plot_style;
mod record_file;
mod replay;
mod report;
pub mod stability;
mod stability_figures;
mod validation_json;
pub mod work_precision;
mod work_precision_figure;

pub use cells::Cells;
pub use folder::{Folder, FolderError};
pub use record_file::{Identity, RECORDS, RecordFile, RecordFileError};
