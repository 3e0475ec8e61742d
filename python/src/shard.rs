//! Parts of maps for other processes, and the maps of all parts.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::cli;
use rattlemap::job;
use rattlemap::job::engine_choice::{Ask, Who};
use rattlemap::map::plan::Plan;
use rattlemap::map::shard::Shard;
use rattlemap::store;
use rattlemap::store::folder::Folder;
use rattlemap::store::merge::{MergeError, Parts, Progress};
use rattlemap::store::shard::{self, FinishedShard};
use rayon::ThreadPoolBuilder;

use crate::engines::{Out, Task, ask};
use crate::map::Made;
use crate::problem::Problem;
use crate::scene::Scene;
use crate::waiting::{self, Watch};

/// Refuses a map that cannot be dealt out to so many shards, whose engine is left open, that does not fit this machine
/// or whose folder cannot be used.
#[pyfunction]
#[pyo3(signature = (scene, count, engine, precision, adapter=None, out=None, force=false))]
pub(crate) fn check_shards(
    scene: &Scene,
    count: u32,
    engine: &str,
    precision: Option<&str>,
    adapter: Option<&str>,
    out: Option<PathBuf>,
    force: bool,
) -> PyResult<()> {
    let (shard, _) = asked(1, count, engine, precision, adapter)?;
    job::capacity::fits_merged(&scene.scene, out.as_deref()).map_err(Problem::from)?;
    let plan = Plan::new(&scene.scene);
    shard.check(&plan).map_err(|error| Problem::scene(format!("--shard {error}")))?;
    if let Some(out) = out {
        // As when the shards are merged.
        let force = force || !Folder::holds_results(&out);
        Folder::check(&out, force, store::map::names()).map_err(Problem::from)?;
    }
    Ok(())
}

/// A shard, and who is to compute it.
fn asked(
    index: u32,
    count: u32,
    engine: &str,
    precision: Option<&str>,
    adapter: Option<&str>,
) -> Result<(Shard, Ask), Problem> {
    let shard = Shard::new(index, count)
        .map_err(|error| Problem::scene(format!("--shard {index}/{count}: {error}")))?;
    let ask = ask(engine, precision, adapter)?;
    match ask.engine {
        Who::Auto => Err(Problem::engine(cli::open_engine(shard))),
        _ => Ok((shard, ask)),
    }
}

/// Computes the shard `index`, from 1, of `count` into the folder `out`, which then is what `map --shard` makes; goes on
/// with what is kept there where `resume` says so. The processor's part takes so many threads, or all. Returns the names
/// of its files.
#[pyfunction]
#[pyo3(signature = (scene, index, count, engine, precision, out, resume=false, threads=None, progress=None, adapter=None))]
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
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
    adapter: Option<&str>,
) -> PyResult<Vec<String>> {
    let (shard, ask) = asked(index, count, engine, precision, adapter)?;
    let task = Task {
        scene: Arc::clone(&scene.scene),
        sets: scene.sets.clone(),
        ask,
        shard: Some(shard),
        out: Some(Out { path: out, force: false, resume }),
    };
    task.check()?;
    // 0 is what the machine has.
    let pool = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|error| Problem::engine(format!("no threads to compute with: {error}")))?;
    waiting::run(py, progress, move |watch| pool.install(|| compute(&task, shard, watch)))
}

fn compute(task: &Task, shard: Shard, watch: &Watch) -> Result<Option<Vec<String>>, Problem> {
    let plan = Plan::new(&task.scene);
    shard.check(&plan).map_err(|error| Problem::scene(format!("--shard {error}")))?;
    plan.check()?;
    let Some(out) = &task.out else { return Ok(None) };
    let folder = out.open(watch)?;
    let Some(integrated) = task.integrate(&plan, Some(&folder), watch)? else { return Ok(None) };
    let (device, processor) = (integrated.engine.device(), job::processor::described());
    let run = integrated.run(task, &device, &processor);
    let finished =
        FinishedShard { shard, scene: &task.scene, plan: &plan, run: &run, tally: &integrated.work.tally };
    Ok(Some(shard::write(&folder, &finished)?))
}

/// Makes the map of all its shards, in any order: `rattlemap merge`. The records go to the folder `out`, and where `writes`
/// says so all that a map's folder has.
#[pyfunction]
#[pyo3(signature = (parts, out, force=false, writes=true, progress=None))]
pub(crate) fn merge<'py>(
    py: Python<'py>,
    parts: Vec<PathBuf>,
    out: PathBuf,
    force: bool,
    writes: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let out = Out { path: out, force, resume: false };
    waiting::run(py, progress, move |watch| gather(&parts, out, writes, watch))?.told(py)
}

fn gather(parts: &[PathBuf], out: Out, writes: bool, watch: &Watch) -> Result<Option<Made>, Problem> {
    let parts = Parts::open(parts)?;
    parts.refuse(&out.path)?;
    job::capacity::fits_merged(parts.scene(), Some(&out.path))?;
    // A run that ended before it kept anything has left nothing else.
    let force = out.force || !Folder::holds_results(&out.path);
    let folder = Out { force, ..out }.open(watch)?;
    let go_on = |Progress { done, of }| {
        watch.tell(done, of);
        !watch.is_halted()
    };
    let gathered = match parts.gather(&folder, go_on) {
        Err(MergeError::Stopped) => return Ok(None),
        gathered => gathered?,
    };
    let map = gathered.in_memory()?;
    let files = if writes { gathered.write(&folder)?.files } else { Vec::new() };
    Ok(Some(Made { map, why: String::new(), warnings: Vec::new(), files }))
}
