//! Why results were not written down.

use std::io;
use std::path::PathBuf;

use crate::show::error::WriteError;
use rattlemap_dynamics::model::ModelError;

/// A result that was not written; its text is one line with the file and the reason.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// A file could not be written.
    #[error("cannot write {}: {reason}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What went wrong with it.
        reason: WriteError,
    },
    /// A file of an earlier run could not be removed.
    #[error("cannot replace {}: {reason}", .path.display())]
    Replace {
        /// The file.
        path: PathBuf,
        /// The operating system's words.
        reason: io::Error,
    },
    /// Text could not be printed.
    #[error("cannot write to stdout: {0}")]
    Stdout(io::Error),
    /// A result could not be put into JSON.
    #[error("cannot put the result into JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// What was to be shown has no motion.
    #[error(transparent)]
    Model(#[from] ModelError),
}
