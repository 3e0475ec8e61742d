//! Finished folders: their manifests. Tables are read by Python itself.

use std::path::PathBuf;

use pyo3::prelude::*;
use rattlemap::store::finished_map;

use crate::problem::Problem;

/// Returns the manifest of the folder of a map or a diagram, as JSON.
#[pyfunction]
pub(crate) fn manifest(folder: PathBuf) -> PyResult<String> {
    Ok(finished_map::read_tables(&folder).map_err(Problem::from)?.to_string())
}
