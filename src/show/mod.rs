//! How results look: tables, colours, figures, the report and texts. Nothing here opens a file; everything writes into
//! an `impl Write` or returns a string.

pub mod caption;
pub mod cells;
#[cfg(test)]
mod color_difference;
pub mod drawing;
pub mod error;
pub mod figure;
pub mod layers;
pub mod names;
pub mod orbit_json;
pub mod orbit_spectrum;
pub mod orbit_summary;
pub mod parameters;
pub mod replay;
pub mod report;
pub mod symbols;
pub mod table;
pub mod wall_words;
pub mod words;
