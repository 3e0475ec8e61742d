//! Errors of commands, and their exit codes.

use std::process::ExitCode;

use anyhow::anyhow;
use rattlemap_dynamics::model::ModelError;

use crate::cli::say;
use crate::job::engine_choice::{AdapterError, ChoiceError};
use crate::job::error::JobError;
use crate::map::plan::NoMotion;
use crate::map::scene::SceneError;
use crate::store::error::OutputError;
use crate::store::finished_map::FinishedMapError;
use crate::store::folder::FolderError;
use crate::store::merge::MergeError;
use crate::store::run_records::RunRecordsError;

/// An error of a command.
#[derive(Debug)]
pub enum Failure {
    /// The request is wrong, and nothing was computed: exit code 2.
    Usage(anyhow::Error),
    /// The run failed, or its results could not be written: exit code 1.
    Run(anyhow::Error),
    /// A signal ended the run: exit code 128 plus its number, as in shells.
    Interrupted {
        /// Number of the signal.
        signal: i32,
        /// What is stored, and how to continue.
        text: String,
    },
}

/// Exit code of a process that a signal ended, minus the signal's number.
pub(crate) const SIGNALLED: i32 = 128;

impl Failure {
    /// Prints the error with its causes on stderr, and returns the exit code.
    pub fn report(&self) -> ExitCode {
        ExitCode::from(self.print())
    }

    /// Prints the error with its causes on stderr, and returns the exit code as a number.
    pub(crate) fn print(&self) -> u8 {
        say::note(format_args!("error: {self}"));
        match self {
            Failure::Usage(_) => 2,
            Failure::Run(_) => 1,
            Failure::Interrupted { signal, .. } => (SIGNALLED + signal) as u8,
        }
    }
}

/// Returns an error with this message if the run has failed.
///
/// # Errors
/// [`Failure::Run`].
pub fn fail_if(failed: bool, message: &'static str) -> Result<(), Failure> {
    if failed { Err(Failure::Run(anyhow!(message))) } else { Ok(()) }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // The alternate form includes the causes.
            Failure::Usage(error) | Failure::Run(error) => write!(f, "{error:#}"),
            Failure::Interrupted { text, .. } => write!(f, "{text}"),
        }
    }
}

impl From<JobError> for Failure {
    fn from(error: JobError) -> Failure {
        if error.is_usage() { Failure::Usage(error.into()) } else { Failure::Run(error.into()) }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Failure {
        Failure::Run(error)
    }
}

macro_rules! errors_of_jobs {
    ($($error:ty),+ $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Failure {
                JobError::from(error).into()
            }
        })+
    };
}

errors_of_jobs! {
    SceneError, ModelError, NoMotion, ChoiceError, AdapterError, FolderError, FinishedMapError, MergeError, OutputError,
    RunRecordsError,
}
