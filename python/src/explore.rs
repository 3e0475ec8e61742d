//! Pages that compute a map on demand.

use std::sync::Arc;

use pyo3::prelude::*;
use rattlemap::job::explore;

use crate::scene::Scene;
use crate::worker::{self, Collector};

/// Returns the page of a scene as HTML.
#[pyfunction]
#[pyo3(signature = (scene, progress=None))]
pub(crate) fn explore_page(
    py: Python<'_>,
    scene: &Scene,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (scene, sets) = (Arc::clone(&scene.scene), scene.sets.clone());
    worker::run(py, progress, move |watch| {
        let page = explore::page(&scene, &sets, Arc::new(Collector::new(watch)), watch.halt())?;
        Ok(page.map(|page| String::from_utf8_lossy(&page).into_owned()))
    })
}
