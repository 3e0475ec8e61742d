//! Results, written down: files in a guarded folder, and text for the terminal.

pub mod bifurcation;
mod bifurcation_csv;
pub mod bifurcation_figure;
pub mod folder;
mod manifest;
mod names;
pub mod orbit;
pub mod orbit_figures;
mod orbit_json;
mod orbit_summary;
mod plot_style;

pub use folder::{Folder, FolderError};
