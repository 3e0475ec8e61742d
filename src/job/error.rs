//! Why a command stops, and the exit code that says so.

use std::process::ExitCode;

use crate::job::engine_choice::ChoiceError;
use crate::map::plan::NoMotion;
use crate::map::scene::SceneError;
use crate::store::error::OutputError;
use crate::store::finished_map::FinishedMapError;
use crate::store::folder::FolderError;
use crate::store::merge::MergeError;
use crate::store::record_file::RecordFileError;
use crate::store::run_records::RunRecordsError;
use anyhow::anyhow;
use rattlemap_dynamics::model::ModelError;

use crate::cli::say;

/// A command that did not do what was asked.
#[derive(Debug)]
pub enum Failure {
    /// The request itself is at fault and nothing was computed: exit code 2.
    Usage(anyhow::Error),
    /// The run or its output failed: exit code 1.
    Run(anyhow::Error),
    /// A signal ended the run: exit code 128 and its number, as shells count it.
    Interrupted {
        /// The signal's number.
        signal: i32,
        /// What is kept, and how to go on.
        words: anyhow::Error,
    },
}

/// What exit codes of processes that a signal ended begin with.
pub(crate) const SIGNALLED: i32 = 128;

impl Failure {
    /// Says on stderr what went wrong, causes included, and returns the exit code.
    pub fn report(&self) -> ExitCode {
        ExitCode::from(self.told())
    }

    /// The same with the exit code as a number.
    pub(crate) fn told(&self) -> u8 {
        say::note(format_args!("error: {self}"));
        match self {
            Failure::Usage(_) => 2,
            Failure::Run(_) => 1,
            Failure::Interrupted { signal, .. } => (SIGNALLED + signal) as u8,
        }
    }
}

/// A run that went through but came to nothing.
pub fn fail_if(failed: bool, message: &'static str) -> Result<(), Failure> {
    if failed { Err(Failure::Run(anyhow!(message))) } else { Ok(()) }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (Failure::Usage(error) | Failure::Run(error) | Failure::Interrupted { words: error, .. }) = self;
        // The alternate form is the whole chain of causes on one line.
        write!(f, "{error:#}")
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Failure::Usage(error.into())
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        Failure::Usage(error.into())
    }
}

impl From<NoMotion> for Failure {
    fn from(error: NoMotion) -> Self {
        Failure::Usage(error.into())
    }
}

impl From<ChoiceError> for Failure {
    fn from(error: ChoiceError) -> Self {
        if error.is_in_the_request() { Failure::Usage(error.into()) } else { Failure::Run(error.into()) }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        Failure::Run(error.into())
    }
}

impl From<FolderError> for Failure {
    fn from(error: FolderError) -> Self {
        Failure::Usage(error.into())
    }
}

impl From<RecordFileError> for Failure {
    fn from(error: RecordFileError) -> Self {
        Failure::Usage(error.into())
    }
}

impl From<FinishedMapError> for Failure {
    fn from(error: FinishedMapError) -> Self {
        if error.is_usage() { Failure::Usage(error.into()) } else { Failure::Run(error.into()) }
    }
}

impl From<MergeError> for Failure {
    fn from(error: MergeError) -> Self {
        if error.is_usage() { Failure::Usage(error.into()) } else { Failure::Run(error.into()) }
    }
}

impl From<RunRecordsError> for Failure {
    fn from(error: RunRecordsError) -> Self {
        match error {
            RunRecordsError::Folder(error) => error.into(),
            RunRecordsError::Records(error) => error.into(),
            RunRecordsError::Output(error) => error.into(),
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Failure::Run(error)
    }
}
