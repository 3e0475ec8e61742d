//! Computes a map or a shard of one: opens the engine, creates or resumes the record file, integrates, finishes.

use std::panic;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, mpsc};
use std::thread::{self, ScopedJoinHandle};
use std::time::{Duration, Instant};

use crate::findings::effect;
use crate::gpu::Precision;
use crate::job::engine_choice::{self, ChosenEngine, EngineKind, EngineRequest};
use crate::job::error::JobError;
use crate::job::observer::Observer;
use crate::job::processor;
use crate::job::size::{self, Free};
use crate::map::engine::Engine;
use crate::map::plan::Plan;
use crate::map::scene::{Scene, Steps};
use crate::map::schedule::Refined;
use crate::map::shard::Shard;
use crate::map::sweep::{self, SweepError};
use crate::record::classify::status;
use crate::record::{Record, RecordStore, Records};
use crate::show::cells::{Cells, Survey};
use crate::store;
use crate::store::error::OutputError;
use crate::store::finished_map::FinishedMap;
use crate::store::folder::Folder;
use crate::store::in_memory;
use crate::store::inventory::{self, Finding};
use crate::store::manifest::OWN_COMMIT;
use crate::store::map::{Provenance, Run};
use crate::store::record_file::{Identity, RECORDS};
use crate::store::run_records::{RunRecords, Work};
use crate::store::shard::{self, FinishedShard};
use rattlemap_dynamics::orbit::Status;

/// A map, or a shard of one, to be computed.
#[derive(Clone, Debug)]
pub struct MapJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The `--set` arguments that the scene was loaded with; manifests list them.
    pub sets: &'a [String],
    /// The requested engine.
    pub engine: EngineRequest,
    /// The shard to compute. None: the whole map.
    pub shard: Option<Shard>,
    /// Whether to continue from the records in the folder, if it has any.
    pub resume: bool,
}

impl<'a> MapJob<'a> {
    /// A job that computes the whole map from its first cell.
    pub fn new(scene: &'a Scene, engine: EngineRequest) -> MapJob<'a> {
        MapJob { scene, sets: &[], engine, shard: None, resume: false }
    }

    /// Checks the request, and that the map fits this machine. Returns the free memory and disk space.
    ///
    /// # Errors
    /// [`JobError`] if the scene is not a map's, no engine can satisfy the request, a shard's engine is not named, the folder
    /// cannot be written, or memory or disk are too small.
    pub fn check(&self, out: Option<&Path>) -> Result<Free, JobError> {
        let axes = self.scene.axes().len();
        if axes != 2 && self.scene.list().is_none() {
            return Err(JobError::Usage(format!(
                "a map has two axes or a list of cells, and this scene has {axes} axes"
            )));
        }
        require_engine(self.shard, self.engine.kind)?;
        engine_choice::check(&self.engine)?;
        out.map_or(Ok(()), Folder::check_writable)?;
        let free = Free::for_output(out);
        size::check_map(self.scene, self.shard, self.engine.kind, &free).map(|()| free)
    }

    /// Numbers the cells and checks that each has a motion.
    ///
    /// # Errors
    /// [`JobError`] if a cell has no motion, or the map cannot be divided into this number of shards.
    pub fn plan(&self) -> Result<Plan, JobError> {
        let clock = Instant::now();
        let mut plan = Plan::new(self.scene);
        if let Some(shard) = self.shard {
            shard.check(&plan).map_err(|error| JobError::Usage(format!("--shard {error}")))?;
        }
        plan.check()?;
        plan.planning = clock.elapsed();
        Ok(plan)
    }

    /// Number of runs to compute.
    pub fn run_count(&self, plan: &Plan) -> usize {
        self.shard.map_or(plan.run_count(), |shard| shard.run_count(plan))
    }

    /// Whether the folder holds this shard, finished and undamaged. Then no engine has to be opened.
    pub fn is_finished_shard(&self, plan: &Plan, out: &Path) -> bool {
        let Some(shard) = self.shard else { return false };
        let (engine, precision) = match self.engine.kind {
            EngineKind::Gpu => ("gpu", self.engine.precision.unwrap_or(Precision::F32)),
            EngineKind::Cpu | EngineKind::Auto => ("cpu", Precision::F64),
        };
        let is_same = |identity: &Identity| {
            // Any device is accepted: merging compares devices.
            let own = Identity::new(engine, precision.name(), identity.device(), self.scene.identity());
            identity.differences(&own.of_shard(Some(shard))).is_empty()
        };
        let Ok(part) = FinishedMap::open_part(out) else { return false };
        let path = out.join(RECORDS);
        let Some(identity) = Identity::read(&path).ok().flatten().filter(is_same) else { return false };
        let findings = inventory::check(out, &part.manifest().files);
        let is_good = findings.is_ok_and(|list| !list.iter().any(Finding::is_lost));
        // Matching hashes are not enough: on a network disk without locks a second run may have spoilt the records before
        // the first one computed their hash.
        let count =
            || Work::new(plan, Some(shard), false).read(&path, &identity).map_or(0, |extent| extent.count);
        is_good && part.is_of(self.scene, self.sets) && count() == shard.run_count(plan)
    }

    /// Opens the engine for a map in a folder, or in memory if there is none. A resumed map keeps its engine unless another
    /// is named. The folder is unchanged until [`OpenMap::begin`].
    ///
    /// # Errors
    /// [`JobError::Engine`].
    pub fn open<'p>(
        &'p self,
        plan: &'p Plan,
        folder: Option<&'p Folder>,
        observer: Arc<dyn Observer>,
    ) -> Result<OpenMap<'p>, JobError> {
        if self.scene.sample().is_some() {
            let text = "start.sample: shares of attractors are computed by `rattlemap map SCENE`, not by this command";
            return Err(JobError::Usage(text.to_owned()));
        }
        let clock = Instant::now();
        let request = self.engine_request(folder.map(Folder::path));
        let chosen = pollster::block_on(engine_choice::open(plan, &request))?;
        let ChosenEngine { engine, reason } = chosen;
        let opening = clock.elapsed();
        Ok(OpenMap { job: self, plan, folder, observer, engine, reason, opening })
    }

    /// The engine to open: the requested one, or that of the records to be resumed if the request leaves it open.
    pub(crate) fn engine_request(&self, folder: Option<&Path>) -> EngineRequest {
        let request = self.engine.clone();
        let is_open = request.kind == EngineKind::Auto && request.precision.is_none();
        let Some(folder) = folder.filter(|_| self.resume && is_open) else { return request };
        match Identity::read(&folder.join(RECORDS)) {
            Ok(Some(identity)) if identity.engine() == "cpu" && request.adapter.is_none() => {
                EngineRequest { kind: EngineKind::Cpu, ..request }
            }
            Ok(Some(identity)) => {
                let precision = Precision::named(identity.precision());
                EngineRequest { kind: EngineKind::Gpu, precision, ..request }
            }
            // `OpenMap::begin` reports an unreadable file.
            Ok(None) | Err(_) => request,
        }
    }
}

/// Checks that the engine of a shard is not `auto`.
///
/// # Errors
/// [`JobError::Usage`] if a shard's engine is `auto`.
pub fn require_engine(shard: Option<Shard>, kind: EngineKind) -> Result<(), JobError> {
    match (shard, kind) {
        (Some(shard), EngineKind::Auto) => Err(JobError::Usage(format!(
            "--shard {shard}: --engine auto may choose different engines on different machines, and their shards cannot be \
             merged; give all shards the same engine: --engine cpu, or --engine gpu (in f32 by default)"
        ))),
        _ => Ok(()),
    }
}

/// A map, or a shard of one, whose engine is open.
pub struct OpenMap<'p> {
    job: &'p MapJob<'p>,
    plan: &'p Plan,
    /// The folder; none for a map in memory.
    pub folder: Option<&'p Folder>,
    observer: Arc<dyn Observer>,
    /// The engine.
    pub engine: Engine<'p>,
    /// Reason for the choice of the engine. Empty if the request left no choice.
    pub reason: String,
    /// Time that it took to open the engine.
    pub opening: Duration,
}

impl<'p> OpenMap<'p> {
    /// Creates the record file in the folder, or continues with its records. Without a folder, records stay in memory.
    ///
    /// # Errors
    /// [`JobError`] if the records belong to another map, or a file cannot be read or written.
    pub fn begin(self) -> Result<MapRun<'p>, JobError> {
        let MapJob { scene, resume, shard, .. } = *self.job;
        if let Some(raised) = raised_steps(scene, &self.engine) {
            self.observer.note(&raised);
        }
        // The caller of a map in memory may read everything.
        let mut work = Work::new(self.plan, shard, self.folder.is_none());
        let records = match self.folder {
            Some(folder) => Some(RunRecords::open(folder, scene, &self.engine, resume, &mut work)?),
            None => None,
        };
        if let Some(damage) = records.as_ref().and_then(RunRecords::damage) {
            self.observer.warn(&damage);
        }
        let done = records.as_ref().map_or(0, RunRecords::count);
        let (device, processor) = (self.engine.device(), processor::described());
        Ok(MapRun { open: self, device, processor, work, records, done, elapsed: Duration::ZERO })
    }
}

/// A map, or a shard of one, that is being computed.
pub struct MapRun<'p> {
    /// The map with its engine.
    pub open: OpenMap<'p>,
    device: String,
    processor: String,
    work: Work<'p>,
    /// None for a map in memory.
    records: Option<RunRecords<'p>>,
    done: usize,
    elapsed: Duration,
}

impl<'p> MapRun<'p> {
    /// Number of runs that are done.
    pub fn done(&self) -> usize {
        self.done
    }

    /// Whether stored records were damaged.
    pub fn is_damaged(&self) -> bool {
        self.records.as_ref().is_some_and(|records| records.damage().is_some())
    }

    /// Computes the remaining runs. A thread of its own stores their records. Returns false if `halt` was raised before the
    /// last one ended.
    ///
    /// # Errors
    /// [`SweepError`] if the engine fails or a record cannot be stored. Stored records can be resumed.
    pub fn integrate(&mut self, halt: &Arc<AtomicBool>) -> Result<bool, SweepError> {
        let clock = Instant::now();
        let MapRun { open: OpenMap { engine, observer, .. }, records: stored, work, done, .. } = self;
        let Work { plan, schedule, records, tally, .. } = work;
        // `sweep::run` keeps the records that a schedule reads. The thread that writes the file keeps those of other maps.
        let mut unread = RecordStore::default();
        let (read, mut kept) = match schedule.reads_records() {
            true => (records, None),
            false => (&mut unread, Some(records).filter(|records| records.count() > 0)),
        };
        let mut is_first = *done == 0;
        observer.progress(*done, schedule.expected());
        let is_finished = thread::scope(|scope| {
            // The channel holds no batch, because each may take hundreds of megabytes.
            let (sender, batches) = mpsc::sync_channel(0);
            let take = |batch: &[(u32, Record)]| {
                tally.take(plan, batch);
                if let Some(kept) = &mut kept {
                    kept.put_all(batch);
                }
            };
            let (writer, mut take) = match stored {
                Some(stored) => (Some(scope.spawn(move || stored.store(&batches, take))), None),
                None => (None, Some(take)),
            };
            let store = |batch: Vec<(u32, Record)>, expected| {
                *done += batch.len();
                if let Some(failed) = all_failed(&batch, plan.unit()).filter(|_| is_first) {
                    observer.warn(&failed);
                }
                is_first = false;
                observer.progress(*done, expected);
                match &mut take {
                    Some(take) => take(&batch),
                    // Sending fails if the writer has ended with an error, which is returned below.
                    None => sender.send(batch)?,
                }
                Ok(())
            };
            let swept = pollster::block_on(sweep::run(plan, schedule, engine, read, halt, store));
            drop(sender);
            match writer.map(ScopedJoinHandle::join) {
                Some(Ok(Err(error))) => Err(SweepError::Store(error.into())),
                Some(Err(panic)) => panic::resume_unwind(panic),
                _ => swept,
            }
        })?;
        self.elapsed = clock.elapsed();
        Ok(is_finished)
    }

    /// Finishes a whole map: fills the cells of an adaptive one and analyses all records together. All runs must be done.
    pub fn finish(self) -> ComputedMap<'p> {
        let mut run = self;
        let plan = run.work.plan;
        let refined = run.work.schedule.finish(&mut run.work.records);
        let survey = Survey::of(plan, &run.work.records, refined);
        let without_effect = effect::names(plan, &run.work.records, run.open.engine.precision());
        ComputedMap { run, survey, without_effect }
    }

    /// Finishes a whole map without analysing it: returns its records and the refinement of an adaptive one.
    pub(crate) fn into_records(self) -> (RecordStore, Option<Refined>) {
        let Work { schedule, mut records, .. } = self.work;
        let refined = schedule.finish(&mut records);
        (records, refined)
    }

    /// Describes the run for manifests.
    pub fn description(&self) -> Run<'_> {
        let OpenMap { job, engine, opening, .. } = &self.open;
        let provenance = Provenance {
            engine: engine.name(),
            precision: engine.precision(),
            device: &self.device,
            commit: OWN_COMMIT,
        };
        let run = Run {
            planning: self.open.plan.planning,
            opening: *opening,
            elapsed: self.elapsed,
            ..Run::new(provenance, job.sets, &self.processor).on(engine)
        };
        match &self.records {
            None => run,
            Some(records) => Run {
                storing: records.storing,
                elapsed_before: records.elapsed_before,
                resumed_cells: records.resumed,
                ..run
            },
        }
    }

    /// Writes the files of a shard next to its records. Returns their names; none for a whole map or without a folder.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    pub fn write_shard(&self) -> Result<Vec<String>, OutputError> {
        let run = self.description();
        match (self.open.folder, self.finished_shard(&run)) {
            (Some(folder), Some(finished)) => shard::write(folder, &finished),
            _ => Ok(Vec::new()),
        }
    }

    /// The shard and its description, for its manifest. None for a whole map.
    pub fn finished_shard<'a>(&'a self, run: &'a Run<'a>) -> Option<FinishedShard<'a>> {
        let (job, Work { plan, tally, .. }) = (self.open.job, &self.work);
        Some(FinishedShard { shard: job.shard?, scene: job.scene, plan, run, tally })
    }
}

/// A map whose cells are all computed.
pub struct ComputedMap<'p> {
    /// The run that computed them.
    pub run: MapRun<'p>,
    survey: Survey,
    without_effect: Vec<String>,
}

impl ComputedMap<'_> {
    /// The cells, for tables and figures.
    pub fn cells(&self) -> Cells<'_> {
        let MapRun { open, work, .. } = &self.run;
        let cells = Cells::new(open.job.scene, work.plan, &work.records).surveyed(&self.survey);
        cells.computed_by(open.engine.name())
    }

    /// Describes the run for the manifest.
    pub fn description(&self) -> Run<'_> {
        Run { without_effect: self.without_effect.clone(), ..self.run.description() }
    }

    /// Writes the files that the scene lists, if there is a folder. Returns their names.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    pub fn write(&self) -> Result<Vec<String>, OutputError> {
        let Some(folder) = self.run.open.folder else { return Ok(Vec::new()) };
        store::map::write(folder, &self.cells(), &self.description())
    }

    /// Returns the manifest and the columns of the map.
    ///
    /// # Errors
    /// [`OutputError`] if a result cannot be converted.
    pub fn in_memory(&self) -> Result<in_memory::Map, OutputError> {
        in_memory::map(&self.cells(), &self.description())
    }
}

/// Describes a batch in which every run failed.
fn all_failed(batch: &[(u32, Record)], unit: &str) -> Option<String> {
    if !batch.iter().all(|(_, record)| status(record).is_failure()) {
        return None;
    }
    let count = |of: Status| batch.iter().filter(|(_, record)| status(record) == of).count();
    let counts = Status::ALL.iter().map(|&of| (count(of), of.name())).filter(|&(count, _)| count > 0);
    let list: Vec<String> = counts.map(|(count, name)| format!("{count} {name}")).collect();
    Some(format!(
        "all of the first {} {unit} failed ({}); the others may fail, too: Ctrl-C ends the run",
        batch.len(),
        list.join(", ")
    ))
}

/// Describes how many steps lanes take if the scene's number is too small.
fn raised_steps(scene: &Scene, engine: &Engine<'_>) -> Option<String> {
    let Steps::PerPeriod(steps) = scene.integration().steps_per_period else { return None };
    let [least, most] = engine.steps_per_period().filter(|&[_, most]| most > steps)?;
    let range = if least == most { most.to_string() } else { format!("{least} to {most}") };
    Some(format!(
        "integration.steps_per_period = {steps} is raised to {range}: lanes need an even number of at least this size"
    ))
}
