//! Parts of maps for other processes, and the maps of all parts.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use rattlemap::cli;
use rattlemap::map::engine_choice::Who;
use rattlemap::map::plan::Plan;
use rattlemap::map::shard::Shard;
use rattlemap::output::merge::{MergeError, Parts, Progress};
use rattlemap::output::shard::{self, Finished};
use rattlemap::output::{self, Folder};

use crate::engines::{Out, Task, ask};
use crate::problem::Problem;
use crate::scene::Scene;
use crate::waiting::{self, Watch};

/// Computes the shard `index`, from 1, of `count` into the folder `out`, which then is what `map --shard` makes; goes on
/// with what is kept there where `resume` says so. Returns the names of its files.
#[pyfunction]
#[pyo3(signature = (scene, index, count, engine, precision, out, resume=false, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
#[pyo3(name = "shard")]
pub(crate) fn of_map<'py>(
    py: Python<'py>,
    scene: &Scene,
    index: u32,
    count: u32,
    engine: &str,
    precision: Option<&str>,
    out: PathBuf,
    resume: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<String>> {
    let shard = Shard::new(index, count)
        .map_err(|error| Problem::scene(format!("--shard {index}/{count}: {error}")))?;
    let ask = ask(engine, precision)?;
    if ask.engine == Who::Auto {
        return Err(Problem::engine(cli::open_engine(shard)).into());
    }
    let task = Task {
        scene: Arc::clone(&scene.scene),
        sets: scene.sets.clone(),
        ask,
        shard: Some(shard),
        out: Some(Out { path: out, force: false, resume }),
    };
    task.check()?;
    waiting::run(py, progress, move |watch| compute(&task, shard, watch))
}

fn compute(task: &Task, shard: Shard, watch: &Watch) -> Result<Option<Vec<String>>, Problem> {
    let plan = Plan::new(&task.scene);
    shard.check(&plan).map_err(|error| Problem::scene(format!("--shard {error}")))?;
    plan.check()?;
    let Some(out) = &task.out else { return Ok(None) };
    let folder = out.open()?;
    let Some(integrated) = task.integrate(&plan, Some(&folder), watch)? else { return Ok(None) };
    let (device, processor) = (integrated.engine.device(), cli::described_processor());
    let run = integrated.run(task, &device, &processor);
    let finished = Finished { shard, scene: &task.scene, plan: &plan, run: &run, tally: &integrated.tally };
    Ok(Some(shard::write(&folder, &finished)?))
}

/// Makes the map of all its shards in the folder `out`, in any order: `rattlemap merge`. Returns the names of its files.
#[pyfunction]
#[pyo3(signature = (parts, out, force=false, progress=None))]
pub(crate) fn merge<'py>(
    py: Python<'py>,
    parts: Vec<PathBuf>,
    out: PathBuf,
    force: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<String>> {
    waiting::run(py, progress, move |watch| gather(&parts, out, force, watch))
}

fn gather(
    parts: &[PathBuf],
    out: PathBuf,
    force: bool,
    watch: &Watch,
) -> Result<Option<Vec<String>>, Problem> {
    let parts = Parts::open(parts)?;
    parts.refuse(&out)?;
    cli::fits(parts.scene(), None, Who::Cpu, Some(&out))?;
    // A run that ended before it kept anything has left nothing else.
    let folder = Folder::open(&out, force || !Folder::holds_results(&out))?;
    folder.refuse_links(output::map::names())?;
    let go_on = |Progress { done, of }| {
        watch.tell(done, of);
        !watch.is_halted()
    };
    match parts.gather(&folder, go_on) {
        Err(MergeError::Stopped) => Ok(None),
        gathered => Ok(Some(gathered?.write(&folder)?.files)),
    }
}
