//! Maps: what `rattlemap map` computes, handed back as columns and, where asked for, written to a folder, too.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::findings::effect;
use rattlemap::job;
use rattlemap::map::plan::Plan;
use rattlemap::show::cells::{Cells, Survey};
use rattlemap::store::in_memory::SharedColors;
use rattlemap::store::map::Run;
use rattlemap::store::{self, in_memory};

use crate::arrays::columns;
use crate::engines::{Out, Task, ask};
use crate::problem::Problem;
use crate::scene::Scene;
use crate::waiting::{self, Watch};

/// What a map came to.
pub(crate) struct Made {
    pub(crate) map: in_memory::Map,
    /// Why that engine.
    pub(crate) why: String,
    pub(crate) warnings: Vec<String>,
    pub(crate) files: Vec<String>,
}

impl Made {
    /// What Python gets.
    pub(crate) fn told(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let told = PyDict::new(py);
        told.set_item("manifest", self.map.manifest)?;
        told.set_item("columns", columns(py, self.map.columns)?)?;
        told.set_item("texts", self.map.texts)?;
        told.set_item("attractors", self.map.attractors)?;
        told.set_item("why", self.why)?;
        told.set_item("warnings", self.warnings)?;
        told.set_item("files", self.files)?;
        Ok(told)
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
        ask: ask(engine, precision, adapter)?,
        shard: None,
        out: out.map(|path| Out { path, force, resume }),
    };
    task.check()?;
    waiting::run(py, progress, move |watch| compute(&task, watch))?.told(py)
}

/// None if it was told to end before the last cell.
fn compute(task: &Task, watch: &Watch) -> Result<Option<Made>, Problem> {
    let plan = Plan::new(&task.scene);
    plan.check()?;
    let folder = task.out.as_ref().map(|out| out.open(watch)).transpose()?;
    let Some(mut integrated) = task.integrate(&plan, folder.as_ref(), watch)? else { return Ok(None) };
    let refined = integrated.work.schedule.finish(&mut integrated.work.records);
    let records = &integrated.work.records;
    let survey = Survey::of(&plan, records, refined);
    let cells = Cells::new(&task.scene, &plan, records).surveyed(&survey);
    let (device, processor) = (integrated.engine.device(), job::processor::described());
    let run = Run {
        without_effect: effect::names(&plan, records, integrated.engine.precision()),
        ..integrated.run(task, &device, &processor)
    };
    let files = match &folder {
        Some(folder) => store::map::write(folder, &cells, &run)?,
        None => Vec::new(),
    };
    Ok(Some(Made {
        map: in_memory::map(&cells, &run)?,
        why: integrated.why,
        warnings: integrated.warnings,
        files,
    }))
}

/// Red, green and blue. A list of bytes would be Python's `bytes`.
type Rgb = (u8, u8, u8);

/// Colours of the program's figures: by name, and of things in a row.
#[pyfunction]
pub(crate) fn colors() -> (BTreeMap<&'static str, Rgb>, Vec<Rgb>) {
    let SharedColors { named, in_a_row } = in_memory::colors();
    let parts = |[red, green, blue]: [u8; 3]| (red, green, blue);
    (
        named.into_iter().map(|(name, color)| (name, parts(color))).collect(),
        in_a_row.into_iter().map(parts).collect(),
    )
}
