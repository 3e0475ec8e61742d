//! Results, written down: files in a guarded folder, and text for the terminal.

pub mod bifurcation;
mod bifurcation_columns_csv;
mod bifurcation_csv;
pub mod bifurcation_figure;
mod bifurcation_manifest;
pub mod caption;
mod cells;
mod cells_csv;
mod cells_npy;
pub mod compare;
mod compare_csv;
mod compare_figure;
mod error;
pub mod folder;
pub mod inventory;
mod layers;
pub mod manifest;
pub mod map;
mod map_figure;
pub mod map_json;
mod map_manifest;
mod names;
pub mod orbit;
pub mod orbit_figures;
mod orbit_json;
mod orbit_spectrum;
mod orbit_summary;
mod orbit_tables;
pub mod parameters;
pub mod plot_style;
mod record_file;
mod replay;
mod report;
#[cfg(test)]
mod seen;
mod stdout;
mod symbols;
pub mod unfinished;
mod validation_json;
mod words;
mod words_csv;

pub use cells::Cells;
pub use error::{DrawError, FigureError, OutputError, WriteError};
pub use folder::{Folder, FolderError};
pub use record_file::{Damage, Extent, Identity, Order, RECORDS, RecordFile, RecordFileError};
pub use stdout::print;
