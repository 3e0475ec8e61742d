//! Errors of jobs.

use thiserror::Error;

use crate::job::engine_choice::{AdapterError, ChoiceError};
use crate::map::plan::NoMotion;
use crate::map::scene::SceneError;
use crate::map::sweep::SweepError;
use crate::store::error::OutputError;
use crate::store::finished_map::FinishedMapError;
use crate::store::folder::FolderError;
use crate::store::merge::MergeError;
use crate::store::record_file::RecordFileError;
use crate::store::run_records::RunRecordsError;
use rattlemap_dynamics::model::ModelError;

/// An error of a job.
#[derive(Debug, Error)]
pub enum JobError {
    /// The scene cannot be read or is wrong.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model is wrong.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The model has no motion at some cell.
    #[error(transparent)]
    NoMotion(#[from] NoMotion),
    /// The engine cannot be opened.
    #[error(transparent)]
    Engine(#[from] ChoiceError),
    /// The engine failed, or its records could not be stored.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The record file cannot be used.
    #[error(transparent)]
    Records(#[from] RecordFileError),
    /// The folder of a finished map cannot be read.
    #[error(transparent)]
    FinishedMap(#[from] FinishedMapError),
    /// A result cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Shards cannot be merged.
    #[error(transparent)]
    Merge(#[from] MergeError),
    /// The map is larger than this machine's memory or disk, or has too many cells.
    #[error("{0}")]
    TooLarge(String),
    /// The request is wrong in another way.
    #[error("{0}")]
    Usage(String),
    /// The job failed in another way.
    #[error("{0}")]
    Failed(String),
}

impl JobError {
    /// Whether the request is wrong and nothing was computed. Otherwise the job failed.
    pub fn is_usage(&self) -> bool {
        match self {
            JobError::Engine(error) => error.is_usage(),
            JobError::Merge(error) => error.is_usage(),
            JobError::FinishedMap(error) => error.is_usage(),
            JobError::Sweep(_) | JobError::Output(_) | JobError::Failed(_) => false,
            JobError::Scene(_)
            | JobError::Model(_)
            | JobError::NoMotion(_)
            | JobError::Folder(_)
            | JobError::Records(_)
            | JobError::TooLarge(_)
            | JobError::Usage(_) => true,
        }
    }
}

impl From<AdapterError> for JobError {
    fn from(error: AdapterError) -> JobError {
        JobError::Engine(error.into())
    }
}

impl From<RunRecordsError> for JobError {
    fn from(error: RunRecordsError) -> JobError {
        match error {
            RunRecordsError::Folder(error) => error.into(),
            RunRecordsError::Records(error) => error.into(),
            RunRecordsError::Output(error) => error.into(),
        }
    }
}
