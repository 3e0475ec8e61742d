//! Errors, and the Python exceptions that report them. Their texts are the program's.

use pyo3::PyErr;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use rattlemap::job::engine_choice::ChoiceError;
use rattlemap::job::error::JobError;
use rattlemap::map::plan::NoMotion;
use rattlemap::map::scene::SceneError;
use rattlemap::map::sweep::SweepError;
use rattlemap::model::ModelError;
use rattlemap::store::error::OutputError;
use rattlemap::store::finished_map::FinishedMapError;
use rattlemap::store::folder::FolderError;
use rattlemap::store::merge::MergeError;
use rattlemap::store::run_records::RunRecordsError;

/// An exception of the package to be raised.
#[derive(Debug)]
pub(crate) struct Problem {
    /// Name of its class in `rattlemap.errors`.
    class: &'static str,
    text: String,
}

impl Problem {
    /// The scene or the request is wrong.
    pub(crate) fn scene(text: impl ToString) -> Problem {
        Problem { class: "SceneError", text: text.to_string() }
    }

    /// The model is wrong, or has no motion.
    pub(crate) fn model(text: impl ToString) -> Problem {
        Problem { class: "ModelError", text: text.to_string() }
    }

    /// The engine cannot be opened, or fails.
    pub(crate) fn engine(text: impl ToString) -> Problem {
        Problem { class: "EngineError", text: text.to_string() }
    }

    /// A folder cannot be used.
    pub(crate) fn folder(text: impl ToString) -> Problem {
        Problem { class: "FolderError", text: text.to_string() }
    }
}

/// Converts errors of layers below jobs.
macro_rules! from_errors {
    ($($error:ty),+ $(,)?) => {
        $(impl From<$error> for Problem {
            fn from(error: $error) -> Problem {
                JobError::from(error).into()
            }
        })+
    };
}

from_errors! {
    SceneError, ModelError, NoMotion, ChoiceError, SweepError, FinishedMapError, FolderError, OutputError,
    RunRecordsError, MergeError,
}

impl From<JobError> for Problem {
    fn from(error: JobError) -> Problem {
        match error {
            JobError::Model(_) | JobError::NoMotion(_) => Problem::model(error),
            JobError::Engine(_) | JobError::Sweep(_) => Problem::engine(error),
            JobError::Folder(_)
            | JobError::Records(_)
            | JobError::FinishedMap(_)
            | JobError::Output(_)
            | JobError::Merge(_)
            | JobError::Failed(_) => Problem::folder(error),
            JobError::Scene(_) | JobError::TooLarge(_) | JobError::Usage(_) => Problem::scene(error),
        }
    }
}

impl From<Problem> for PyErr {
    fn from(problem: Problem) -> PyErr {
        Python::attach(|py| {
            let class = py.import("rattlemap.errors").and_then(|errors| errors.getattr(problem.class));
            match class.and_then(|class| Ok(class.cast_into::<PyType>()?)) {
                Ok(class) => PyErr::from_type(class, (problem.text,)),
                Err(_) => PyRuntimeError::new_err(problem.text),
            }
        })
    }
}
