//! Bifurcation diagrams.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::map::scene::Scene as Read;
use rattlemap::map::{bifurcation as diagram, plan};
use rattlemap::store::bifurcation::DiagramArguments;
use rattlemap::store::in_memory;

use crate::arrays::columns;
use crate::problem::Problem;
use crate::scene::{For, Scene};
use crate::waiting::{self, Watch};

/// Computes a diagram: its manifest, the table of its columns as text, and its points by column.
#[pyfunction]
#[pyo3(signature = (scene, progress=None))]
pub(crate) fn bifurcation<'py>(
    py: Python<'py>,
    scene: &Scene,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (read, sets, read_for) = (Arc::clone(&scene.scene), scene.sets.clone(), scene.read_for.clone());
    let made = waiting::run(py, progress, move |watch| compute(&read, &sets, &read_for, watch))?;
    let told = PyDict::new(py);
    told.set_item("manifest", made.manifest)?;
    told.set_item("columns", made.columns)?;
    told.set_item("points", columns(py, made.points)?)?;
    told.set_item("kinds", made.kinds)?;
    told.set_item("directions", made.directions)?;
    Ok(told)
}

fn compute(
    scene: &Read,
    sets: &[String],
    read_for: &For,
    watch: &Watch,
) -> Result<Option<in_memory::Diagram>, Problem> {
    plan::check_line(scene)?;
    let cells = scene.line();
    let count = diagram::column_count(cells.len(), scene.start());
    let clock = Instant::now();
    let ended = AtomicUsize::new(0);
    let report = |done| watch.tell(ended.fetch_max(done, Ordering::Relaxed).max(done), count);
    let columns = diagram::run_until(&cells, scene.start(), &scene.orbit_settings(), &report, watch.halt())?;
    let Some(columns) = columns else { return Ok(None) };
    let asked = DiagramArguments { sets, along: read_for.along.as_ref() };
    Ok(Some(in_memory::diagram(scene, asked, &columns, clock.elapsed())?))
}
