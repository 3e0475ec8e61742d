//! Why results cannot be written.

use std::io;
use std::path::PathBuf;

use crate::show::error::WriteError;
use rattlemap_dynamics::model::ModelError;

/// Why a result cannot be written. The text is one line with the file and the reason.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// A file cannot be written.
    #[error("cannot write {}: {reason}{}", .path.display(), .reason.remedy())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: WriteError,
    },
    /// A file of an earlier run cannot be removed.
    #[error("cannot replace {}: {reason}", .path.display())]
    Replace {
        /// The file.
        path: PathBuf,
        /// The system's error.
        reason: io::Error,
    },
    /// A result cannot be put into JSON.
    #[error("cannot put the result into JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The model has no motion.
    #[error(transparent)]
    Model(#[from] ModelError),
}
