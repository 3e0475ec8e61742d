//! What goes wrong, by the exception that tells it; its text is the program's.

use pyo3::PyErr;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use rattlemap::job::engine_choice::ChoiceError;
use rattlemap::job::error::Failure;
use rattlemap::map::plan::NoMotion;
use rattlemap::map::scene::SceneError;
use rattlemap::map::sweep::SweepError;
use rattlemap::model::ModelError;
use rattlemap::store::error::OutputError;
use rattlemap::store::finished_map::FinishedMapError;
use rattlemap::store::folder::FolderError;
use rattlemap::store::merge::MergeError;
use rattlemap::store::record_file::RecordFileError;
use rattlemap::store::run_records::RunRecordsError;

/// An exception of the package that is to be raised, and its text.
#[derive(Debug)]
pub(crate) struct Problem {
    /// Its name in `rattlemap.errors`.
    class: &'static str,
    text: String,
}

impl Problem {
    /// What is asked is wrong.
    pub(crate) fn scene(text: impl ToString) -> Problem {
        Problem { class: "SceneError", text: text.to_string() }
    }

    /// The model is wrong, or has no motion.
    pub(crate) fn model(text: impl ToString) -> Problem {
        Problem { class: "ModelError", text: text.to_string() }
    }

    /// The engine is not there, or fails.
    pub(crate) fn engine(text: impl ToString) -> Problem {
        Problem { class: "EngineError", text: text.to_string() }
    }

    /// A folder cannot be used.
    pub(crate) fn folder(text: impl ToString) -> Problem {
        Problem { class: "FolderError", text: text.to_string() }
    }
}

macro_rules! told {
    ($($error:ty => $class:ident),+ $(,)?) => {
        $(impl From<$error> for Problem {
            fn from(error: $error) -> Problem {
                Problem::$class(error)
            }
        })+
    };
}

told! {
    SceneError => scene,
    ModelError => model,
    NoMotion => model,
    ChoiceError => engine,
    SweepError => engine,
    FinishedMapError => folder,
    FolderError => folder,
    OutputError => folder,
    RecordFileError => folder,
    RunRecordsError => folder,
    MergeError => folder,
    // The request, unless somebody says better.
    Failure => scene,
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
