//! Why a record file cannot be used.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::show::error::remedy;
use crate::store::file_names::RECORDS;

/// Why a record file cannot be used.
#[derive(Debug, Error)]
pub enum RecordFileError {
    /// The folder holds other files, but no record file.
    #[error("--resume: there is no {RECORDS} in {}; leave --resume out, or name the folder of an interrupted run with --out", .folder.display())]
    NothingToResume {
        /// The folder.
        folder: PathBuf,
    },
    /// The records belong to another run.
    #[error("{} holds another run: {differences}; give the settings of that run, or start anew with --force", .path.display())]
    OtherRun {
        /// The file.
        path: PathBuf,
        /// The settings that differ, each with both values.
        differences: String,
    },
    /// The header is unreadable, or a batch contains records that no run of this version writes.
    #[error("{} is damaged at byte {at}: {what}; start anew with --force", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Offset of the damage in bytes.
        at: u64,
        /// Description of the damage.
        what: &'static str,
    },
    /// Another version of the program wrote the file, in another format or with other columns.
    #[error(
        "{} was written by another version in another format; make the map anew with --force, or resume it with the \
         version that began it",
        .path.display()
    )]
    OtherVersion {
        /// The file.
        path: PathBuf,
    },
    /// The operating system reports an error.
    #[error("{}: {reason}{}", .path.display(), remedy(.reason.kind()))]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        reason: io::Error,
    },
}
