//! Jobs that compute a map or a shard of one.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use rattlemap::gpu::Precision;
use rattlemap::job::engine_choice::{self, AdapterTextError, EngineRequest};
use rattlemap::job::map::{MapJob, MapRun};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene;
use rattlemap::map::shard::Shard;
use rattlemap::store::folder::{Folder, FolderError};
use rattlemap::store::run_records::{RunRecordsError, open_folder};

use crate::problem::Problem;
use crate::worker::{self, Collector, Watch};

/// Reads a request for an engine.
///
/// # Errors
/// [`Problem`] if no engine has the name, or it cannot have the precision or the adapter.
pub(crate) fn request(
    engine: &str,
    precision: Option<&str>,
    adapter: Option<&str>,
) -> Result<EngineRequest, Problem> {
    let named = |name: &str| {
        Precision::named(name)
            .ok_or_else(|| Problem::engine(format!("unknown precision {name:?}; it must be f32 or f64")))
    };
    let on = |text: &str| {
        text.parse()
            .map_err(|error: AdapterTextError| Problem::engine(format!("the adapter {text:?}: {error}")))
    };
    let request = EngineRequest {
        kind: engine.parse()?,
        precision: precision.map(named).transpose()?,
        adapter: adapter.map(on).transpose()?,
    };
    engine_choice::check(&request)?;
    Ok(request)
}

/// A map or a shard to compute.
pub(crate) struct Task {
    pub(crate) scene: Arc<Scene>,
    pub(crate) sets: Vec<String>,
    pub(crate) engine: EngineRequest,
    pub(crate) shard: Option<Shard>,
    pub(crate) out: Option<Out>,
}

/// The folder of a job.
pub(crate) struct Out {
    pub(crate) path: PathBuf,
    pub(crate) force: bool,
    pub(crate) resume: bool,
}

impl Out {
    /// Opens the folder. Waits while an abandoned computation of this process may still use it.
    pub(crate) fn open(&self, scene: &Scene, watch: &Watch) -> Result<Folder, Problem> {
        loop {
            // Read first: the abandoned computation may end between a failed attempt and its evaluation.
            let may_wait = worker::has_abandoned_work();
            match open_folder(&self.path, scene, self.force, self.resume) {
                Err(RunRecordsError::Folder(FolderError::InUse { .. })) if may_wait && !watch.is_halted() => {
                    thread::sleep(worker::TICK);
                }
                opened => return Ok(opened?),
            }
        }
    }
}

impl Task {
    fn job(&self) -> MapJob<'_> {
        MapJob {
            scene: &self.scene,
            sets: &self.sets,
            engine: self.engine.clone(),
            shard: self.shard,
            resume: self.out.as_ref().is_some_and(|out| out.resume),
        }
    }

    /// Checks the request, and that the map fits this machine.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        self.job().check(self.out.as_ref().map(|out| &*out.path))?;
        Ok(())
    }

    /// Computes all runs, and gives them to `finish` with the warnings. Returns none if the computation was halted.
    pub(crate) fn compute<T>(
        &self,
        watch: &Arc<Watch>,
        finish: impl FnOnce(&Plan, MapRun<'_>, Vec<String>) -> Result<T, Problem>,
    ) -> Result<Option<T>, Problem> {
        let job = self.job();
        let plan = job.plan()?;
        let folder = self.out.as_ref().map(|out| out.open(&self.scene, watch)).transpose()?;
        let observer = Arc::new(Collector::new(watch));
        let opened = job.open(&plan, folder.as_ref(), observer.clone())?;
        if watch.is_halted() {
            return Ok(None);
        }
        let mut run = opened.begin()?;
        if !run.integrate(watch.halt())? {
            return Ok(None);
        }
        finish(&plan, run, observer.lines()).map(Some)
    }
}
