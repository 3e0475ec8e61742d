//! Maps: computed like `rattlemap map`, returned as columns, and written to a folder if there is one.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::show::layers::{SharedColors, shared_colors};
use rattlemap::store::folder::Folder;
use rattlemap::store::in_memory;

use crate::arrays::columns;
use crate::scene::Scene;
use crate::task::{Out, Task, request};
use crate::worker;

/// A map for Python.
pub(crate) struct MapResult {
    pub(crate) map: in_memory::Map,
    pub(crate) warnings: Vec<String>,
}

impl MapResult {
    /// Returns the map as a dictionary.
    pub(crate) fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("manifest", self.map.manifest)?;
        dict.set_item("columns", columns(py, self.map.columns)?)?;
        dict.set_item("texts", self.map.texts)?;
        dict.set_item("attractors", self.map.attractors)?;
        dict.set_item("warnings", self.warnings)?;
        Ok(dict)
    }
}

/// Computes a map.
#[pyfunction]
#[pyo3(signature = (scene, engine, precision=None, out=None, force=false, resume=false, progress=None, adapter=None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn map<'py>(
    py: Python<'py>,
    scene: &Scene,
    engine: &str,
    precision: Option<&str>,
    out: Option<PathBuf>,
    force: bool,
    resume: bool,
    progress: Option<&Bound<'py, PyAny>>,
    adapter: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let task = Task {
        scene: Arc::clone(&scene.scene),
        sets: scene.sets.clone(),
        engine: request(engine, precision, adapter)?,
        shard: None,
        out: out.map(|path| Out { path, force, resume }),
    };
    task.check()?;
    let result = worker::run(py, progress, move |watch| {
        task.compute(watch, |_, run, mut warnings| {
            let map = run.finish();
            map.write()?;
            let removed = map.run.open.folder.map_or_else(Vec::new, Folder::removed);
            if resume && !removed.is_empty() {
                warnings.push(format!("removed files of the earlier run: {}", removed.join(", ")));
            }
            Ok(MapResult { map: map.in_memory()?, warnings })
        })
    })?;
    result.into_dict(py)
}

/// Red, green and blue. It is a tuple, because Python would receive an array of bytes as `bytes`.
type Rgb = (u8, u8, u8);

/// Returns the colours of the program's figures: those with names, and the sequence for other items.
#[pyfunction]
pub(crate) fn colors() -> (BTreeMap<&'static str, Rgb>, Vec<Rgb>) {
    let SharedColors { named, in_a_row } = shared_colors();
    let parts = |[red, green, blue]: [u8; 3]| (red, green, blue);
    (
        named.into_iter().map(|(name, color)| (name, parts(color))).collect(),
        in_a_row.into_iter().map(parts).collect(),
    )
}
