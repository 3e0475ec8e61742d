//! Results, written down: files in a guarded folder, and text for the terminal.

pub mod bifurcation;
mod bifurcation_csv;
pub mod bifurcation_figure;
mod bifurcation_manifest;
mod cells;
mod cells_csv;
mod cells_npy;
pub mod folder;
mod layers;
pub(crate) mod manifest;
pub mod map;
mod map_figure;
mod map_manifest;
mod names;
pub mod orbit;
pub mod orbit_figures;
mod orbit_json;
mod orbit_summary;
pub(crate) mod parameters;
pub(crate) mod plot_style;
mod record_file;
mod replay;
mod report;
mod stdout;
pub mod unfinished;
mod validation_json;

pub use cells::Cells;
pub use folder::{Folder, FolderError};
pub use record_file::{Damage, Extent, Identity, RECORDS, RecordFile, RecordFileError};
pub use stdout::print;
