//! Bifurcation diagrams.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::map::scene::Scene as LibraryScene;
use rattlemap::map::{bifurcation as diagram, plan};
use rattlemap::store::bifurcation::DiagramArguments;
use rattlemap::store::in_memory;

use crate::arrays::columns;
use crate::problem::Problem;
use crate::scene::{Scene, Use};
use crate::worker::{self, Watch};

/// Computes a diagram: its manifest, the table of its columns as text, and its points by column.
#[pyfunction]
#[pyo3(signature = (scene, progress=None))]
pub(crate) fn bifurcation<'py>(
    py: Python<'py>,
    scene: &Scene,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (library, sets, purpose) = (Arc::clone(&scene.scene), scene.sets.clone(), scene.purpose.clone());
    let result = worker::run(py, progress, move |watch| compute(&library, &sets, &purpose, watch))?;
    let dict = PyDict::new(py);
    dict.set_item("manifest", result.manifest)?;
    dict.set_item("columns", result.columns)?;
    dict.set_item("points", columns(py, result.points)?)?;
    dict.set_item("kinds", result.kinds)?;
    dict.set_item("directions", result.directions)?;
    Ok(dict)
}

fn compute(
    scene: &LibraryScene,
    sets: &[String],
    purpose: &Use,
    watch: &Watch,
) -> Result<Option<in_memory::Diagram>, Problem> {
    plan::check_line(scene)?;
    let cells = scene.line();
    let count = diagram::column_count(cells.len(), scene.start());
    let clock = Instant::now();
    let ended = AtomicUsize::new(0);
    let report = |done| watch.set_progress(ended.fetch_max(done, Ordering::Relaxed).max(done), count);
    let columns = diagram::run_until(&cells, scene.start(), &scene.orbit_settings(), &report, watch.halt())?;
    let Some(columns) = columns else { return Ok(None) };
    let arguments = DiagramArguments { sets, along: purpose.along.as_ref() };
    Ok(Some(in_memory::diagram(scene, arguments, &columns, clock.elapsed())?))
}
