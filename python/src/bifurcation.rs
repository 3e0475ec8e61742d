//! Bifurcation diagrams.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use pyo3::prelude::*;
use rattlemap::map::{bifurcation as diagram, plan};
use rattlemap::store::bifurcation::DiagramArguments;
use rattlemap::store::in_memory;

use crate::scene::Scene;
use crate::worker;

/// Computes a diagram. Returns its manifest, `bifurcation_columns.csv` and `bifurcation.csv`.
#[pyfunction]
#[pyo3(signature = (scene, progress=None))]
pub(crate) fn bifurcation(
    py: Python<'_>,
    scene: &Scene,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, String, String)> {
    let (scene, sets, along) = (Arc::clone(&scene.scene), scene.sets.clone(), scene.purpose.along.clone());
    worker::run(py, progress, move |watch| {
        plan::check_line(&scene)?;
        let cells = scene.line();
        let count = diagram::column_count(cells.len(), scene.start());
        let clock = Instant::now();
        let ended = AtomicUsize::new(0);
        let report = |done| watch.set_progress(ended.fetch_max(done, Ordering::Relaxed).max(done), count);
        let settings = scene.orbit_settings();
        let columns = diagram::run_until(&cells, scene.start(), &settings, &report, watch.halt())?;
        let Some(columns) = columns else { return Ok(None) };
        let arguments = DiagramArguments { sets: &sets, along: along.as_ref() };
        Ok(Some(in_memory::diagram(&scene, arguments, &columns, clock.elapsed())?))
    })
}
