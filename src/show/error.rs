//! Errors of writing a table, a figure or a report.

use std::io;

/// Reason why one result could not be written. The caller knows the file, if there is one.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// An error of the operating system.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// An error of a CSV table.
    #[error(transparent)]
    Table(#[from] csv::Error),
    /// An error of a JSON object.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A picture without pixels, or with more than memory can hold.
    #[error("the figure has {width} x {height} pixels")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels from top to bottom.
        height: u32,
    },
    /// Pixels that could not be encoded as PNG.
    #[error(transparent)]
    Png(#[from] png::EncodingError),
    /// A typeface that could not be embedded in a PDF.
    #[error("the typeface cannot be embedded: {0}")]
    Typeface(#[from] subsetter::Error),
}
