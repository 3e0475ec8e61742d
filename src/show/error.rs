//! Why a table or a figure could not be made.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

/// What can go wrong with one file.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system will not have it.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A table.
    #[error(transparent)]
    Table(#[from] csv::Error),
    /// JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// The type of an array's field.
    #[error(transparent)]
    Array(#[from] npyz::ParseTypeStrError),
    /// A figure.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// A figure that was not made.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// It could not be drawn.
    #[error("cannot draw the figure {}: {reason}", .path.display())]
    Draw {
        /// The file that it was to be.
        path: PathBuf,
        /// What went wrong.
        reason: DrawError,
    },
    /// It could not be saved.
    #[error("cannot write the figure {}: {reason}", .path.display())]
    Save {
        /// The file.
        path: PathBuf,
        /// What the encoder or the operating system says.
        reason: Box<dyn Error + Send + Sync>,
    },
}

/// A picture that could not be put into a file's form.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// It has no pixels, or more than memory holds.
    #[error("it has {width} x {height} pixels")]
    Size {
        /// Across.
        width: u32,
        /// From top to bottom.
        height: u32,
    },
    /// Pixels as PNG.
    #[error(transparent)]
    Png(#[from] png::EncodingError),
    /// The typeface in a PDF.
    #[error("its typeface cannot be embedded: {0}")]
    Typeface(#[from] subsetter::Error),
    /// Text in memory.
    #[error(transparent)]
    Text(#[from] std::fmt::Error),
}

impl FigureError {
    pub(crate) fn draw(path: &Path, reason: DrawError) -> FigureError {
        FigureError::Draw { path: path.to_owned(), reason }
    }

    pub(crate) fn save(path: &Path, reason: impl Error + Send + Sync + 'static) -> FigureError {
        FigureError::Save { path: path.to_owned(), reason: reason.into() }
    }
}
