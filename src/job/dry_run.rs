//! Estimates the memory, disk space and time of a map. Writes nothing.

use std::path::Path;
use std::sync::Arc;

use crate::job::engine_choice::EngineKind;
use crate::job::error::JobError;
use crate::job::forecast::{self, Forecast};
use crate::job::map::{MapJob, OpenMap};
use crate::job::model_engine;
use crate::job::observer::Observer;
use crate::job::size::{Free, Size};
use crate::map::plan::Plan;
use crate::map::sweep::SweepError;
use crate::store::folder::{Folder, FolderError};
use crate::store::map;
use crate::store::record_file::{Identity, RECORDS};
use crate::store::run_records::{self, Work};

/// Estimate of a map's memory, disk space and time.
#[derive(Clone, Debug)]
pub struct DryRun {
    /// Whether the folder contains files, and the run needs `--resume` or `--force`.
    pub is_taken: bool,
    /// Number of runs of the map or shard.
    pub runs: usize,
    /// Number of runs whose records are already in the folder.
    pub stored: usize,
    /// Name of the engine.
    pub engine: &'static str,
    /// Precision of the engine.
    pub precision: &'static str,
    /// Device of the engine, as manifests name it.
    pub device: String,
    /// Reason for the choice of the engine. Empty if the request left no choice.
    pub reason: String,
    /// The engine's code for the model, why, and what its motion costs.
    pub model: String,
    /// Memory of the host, in bytes.
    pub host_memory: u64,
    /// Largest memory on graphics devices, in bytes. None for the CPU engine.
    pub device_memory: Option<u64>,
    /// Disk space, in bytes.
    pub disk: u64,
    /// Free memory and disk space.
    pub free: Free,
    /// Seconds that it took to open the engine.
    pub open_seconds: f64,
    /// Predicted time of integration.
    pub forecast: Forecast,
    /// Whether the map is adaptive. An adaptive map integrates fewer cells than predicted.
    pub is_adaptive: bool,
}

impl DryRun {
    /// Opens the engine and computes a sample of the cells, whose records are discarded. Notes and warnings about the
    /// engine go to the observer.
    ///
    /// # Errors
    /// [`JobError`] if the folder cannot be used, or the engine cannot be opened or fails.
    pub fn of(
        job: &MapJob<'_>,
        plan: &Plan,
        out: &Path,
        force: bool,
        free: Free,
        observer: Arc<dyn Observer>,
    ) -> Result<DryRun, JobError> {
        if job.resume {
            run_records::require_records(out)?;
        }
        let is_taken = match Folder::check(out, force || job.resume, map::names_of(job.scene)) {
            Err(FolderError::NotEmpty { .. }) => true,
            checked => checked.map(|()| false)?,
        };
        if let Some(warning) = forecast::long_cells(plan) {
            observer.warn(&warning);
        }
        let job = MapJob { engine: job.engine_request(Some(out)), ..job.clone() };
        let OpenMap { mut engine, reason, opening, .. } = job.open(plan, None, observer)?;
        let stored = if job.resume {
            let identity =
                Identity::new(engine.name(), engine.precision(), &engine.device(), job.scene.identity())
                    .of_coordinates(job.scene.coordinates())
                    .of_shard(job.shard);
            let path = out.join(RECORDS);
            if path.is_file() { Work::new(plan, job.shard, false).read(&path, &identity)?.count } else { 0 }
        } else {
            0
        };
        let runs = job.run_count(plan);
        let forecast =
            Forecast::of(plan, &mut engine, runs.saturating_sub(stored)).map_err(SweepError::Engine)?;
        let size = Size::of(job.scene, job.shard);
        let kind = if engine.device_bytes().is_some() { EngineKind::Gpu } else { EngineKind::Cpu };
        Ok(DryRun {
            is_taken,
            runs,
            stored,
            engine: engine.name(),
            precision: engine.precision(),
            device: engine.device(),
            reason,
            model: model_engine::described(&plan.oscillator(0)),
            host_memory: size.memory(kind),
            device_memory: engine.device_bytes(),
            disk: size.disk,
            free,
            open_seconds: opening.as_secs_f64(),
            forecast,
            is_adaptive: plan.refine().is_some(),
        })
    }

    /// Whether the predicted time is an upper bound: the map is adaptive, and the whole sample ended in time.
    pub fn is_upper_bound(&self) -> bool {
        self.is_adaptive && self.forecast.interval.is_some()
    }
}
