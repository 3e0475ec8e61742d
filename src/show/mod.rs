//! Presentation of results: tables, colours, figures, the report and texts. Nothing here opens a file; everything writes into
//! an `impl Write` or returns a value.

pub mod caption;
pub mod cells;
pub mod color;
#[cfg(test)]
mod color_difference;
pub mod drawing;
pub mod error;
mod event_row;
pub mod figure;
pub mod instant;
pub mod layers;
pub mod map_pair;
pub mod names;
pub mod numbers;
pub mod orbit_json;
mod orbit_quantities;
pub mod orbit_spectrum;
pub mod orbit_summary;
pub mod parameters;
pub mod provenance;
pub mod refined_cycle;
pub mod refinement;
pub mod replay;
pub mod report;
pub mod run_up;
mod sketch;
pub mod symbols;
pub mod table;
pub mod validation;
pub mod wall_labels;
pub mod words;
