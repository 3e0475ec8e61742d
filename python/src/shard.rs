//! Shards of maps, and maps of all their shards.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::job::engine_choice::EngineRequest;
use rattlemap::job::map::require_engine;
use rattlemap::job::size::check_merge;
use rattlemap::map::plan::Plan;
use rattlemap::map::shard::Shard;
use rattlemap::store;
use rattlemap::store::folder::Folder;
use rattlemap::store::merge::{MergeError, Parts};
use rayon::ThreadPoolBuilder;

use crate::map::MapResult;
use crate::problem::Problem;
use crate::scene::Scene;
use crate::task::{Out, Task, request};
use crate::worker::{self, Watch};

/// Checks that a map can be computed in this number of shards and merged into a folder.
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
    let (shard, _) = shard_request(1, count, engine, precision, adapter)?;
    check_merge(&scene.scene, out.as_deref()).map_err(Problem::from)?;
    let plan = Plan::new(&scene.scene);
    shard.check(&plan).map_err(|error| Problem::scene(format!("--shard {error}")))?;
    if let Some(out) = out {
        // A folder without results may be replaced, as in `merge`.
        let force = force || !Folder::holds_results(&out);
        Folder::check(&out, force, store::map::names_of(&scene.scene)).map_err(Problem::from)?;
    }
    Ok(())
}

fn shard_request(
    index: u32,
    count: u32,
    engine: &str,
    precision: Option<&str>,
    adapter: Option<&str>,
) -> Result<(Shard, EngineRequest), Problem> {
    let shard = Shard::new(index, count)
        .map_err(|error| Problem::scene(format!("--shard {index}/{count}: {error}")))?;
    let request = request(engine, precision, adapter)?;
    require_engine(Some(shard), request.kind).map_err(Problem::engine)?;
    Ok((shard, request))
}

/// Computes shard `index` of `count`, counted from 1, into the folder `out`, like `map --shard`. The CPU engine
/// uses `threads` threads, by default all. Returns the files' names.
#[pyfunction]
#[pyo3(signature = (scene, index, count, engine, precision, out, threads=None, progress=None, adapter=None))]
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
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
    adapter: Option<&str>,
) -> PyResult<Vec<String>> {
    let (shard, engine) = shard_request(index, count, engine, precision, adapter)?;
    let task = Task {
        scene: Arc::clone(&scene.scene),
        sets: scene.sets.clone(),
        engine,
        shard: Some(shard),
        out: Some(Out { path: out, force: false, resume: false }),
    };
    task.check()?;
    // 0 means as many threads as the machine has.
    let pool = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|error| Problem::engine(format!("cannot start threads: {error}")))?;
    worker::run(py, progress, move |watch| {
        pool.install(|| task.compute(watch, |_, run, _| Ok(run.write_shard()?)))
    })
}

/// Combines the shards of a map, in any order, like `rattlemap merge`. The folder `out` receives the records, and with
/// `writes` all other files of a map.
#[pyfunction]
#[pyo3(signature = (parts, out, force=false, writes=true))]
pub(crate) fn merge<'py>(
    py: Python<'py>,
    parts: Vec<PathBuf>,
    out: PathBuf,
    force: bool,
    writes: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let out = Out { path: out, force, resume: false };
    worker::run(py, None, move |watch| gather(&parts, out, writes, watch))?.into_dict(py)
}

fn gather(parts: &[PathBuf], out: Out, writes: bool, watch: &Watch) -> Result<Option<MapResult>, Problem> {
    let parts = Parts::open(parts)?;
    parts.refuse(&out.path)?;
    check_merge(parts.scene(), Some(&out.path))?;
    // A folder without results may be replaced. A run that was killed at its start leaves one.
    let force = out.force || !Folder::holds_results(&out.path);
    let folder = Out { force, ..out }.open(parts.scene(), watch)?;
    let gathered = match parts.gather(&folder, |_| !watch.is_halted()) {
        Err(MergeError::Stopped) => return Ok(None),
        gathered => gathered?,
    };
    let map = gathered.in_memory()?;
    if writes {
        gathered.write(&folder)?;
    }
    Ok(Some(MapResult { map, warnings: Vec::new() }))
}
