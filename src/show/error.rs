//! Errors of writing a table, a figure or a report.

use std::io;

use rattlemap_dynamics::model::ModelError;

/// Remedy for an error of the operating system on writing, to be appended to its text; empty if there is no particular one.
pub fn remedy(kind: io::ErrorKind) -> &'static str {
    match kind {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "; make space on this disk",
        io::ErrorKind::FileTooLarge => {
            "; raise the limit for the size of files (`ulimit -f`), or write to another disk"
        }
        _ => "",
    }
}

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
    /// A model without a motion.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A typeface that could not be embedded in a PDF.
    #[error("the typeface cannot be embedded: {0}")]
    Typeface(#[from] subsetter::Error),
}

impl WriteError {
    /// Remedy, to be appended to the text; empty if there is no particular one.
    pub fn remedy(&self) -> &'static str {
        let kind = match self {
            WriteError::Io(error) | WriteError::Png(png::EncodingError::IoError(error)) => Some(error.kind()),
            WriteError::Table(error) => match error.kind() {
                csv::ErrorKind::Io(error) => Some(error.kind()),
                _ => None,
            },
            WriteError::Json(error) => error.io_error_kind(),
            WriteError::Png(_) | WriteError::Size { .. } | WriteError::Model(_) | WriteError::Typeface(_) => {
                None
            }
        };
        kind.map_or("", remedy)
    }
}
