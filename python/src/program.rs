//! Runs the program in the interpreter's process.

use std::ffi::OsString;
use std::io::{Write, stdout};

use pyo3::prelude::*;
use rattlemap::cli;
use rattlemap::job::environment;

/// Runs arguments that begin with the program's name, and returns the exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| {
        let code = cli::run_with(arguments);
        // The interpreter does not flush Rust's stdout when it ends.
        let _ = stdout().flush();
        code
    })
}

/// Returns the environment variable that the program sets for itself, and its value.
#[pyfunction]
pub(crate) fn missing_variable() -> Option<(&'static str, &'static str)> {
    environment::missing_variable()
}
