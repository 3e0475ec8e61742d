//! Cells on an engine: what maps and shards have in common.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rattlemap::gpu::Precision;
use rattlemap::job;
use rattlemap::job::engine_choice::{self, Ask, Chosen};
use rattlemap::job::resumed_engine;
use rattlemap::map::engine::{Engine, Loss};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene;
use rattlemap::map::shard::Shard;
use rattlemap::map::sweep;
use rattlemap::record::Record;
use rattlemap::store::folder::{Folder, FolderError};
use rattlemap::store::map::{Provenance, Run};
use rattlemap::store::run_records::{RunRecords, RunRecordsError, Work, open_folder};

use crate::problem::Problem;
use crate::waiting::{self, Watch};

/// Which engine is asked for.
///
/// # Errors
/// If there is none of the name, or it does not know the precision or have adapters.
pub(crate) fn ask(engine: &str, precision: Option<&str>, adapter: Option<&str>) -> Result<Ask, Problem> {
    let named = |name: &str| {
        let known = Precision::ALL.into_iter().find(|precision| precision.name() == name);
        known.ok_or_else(|| Problem::engine(format!("the precision {name:?} is none of f32 and f64")))
    };
    let adapter = match adapter {
        Some(text) if text.trim().is_empty() => {
            let must = "it must be a number or part of a name that `rattlemap devices` lists, or all";
            return Err(Problem::engine(format!("the adapter {text:?}: {must}")));
        }
        // Whatever it says, it can be read.
        adapter => adapter.and_then(|text| text.parse().ok()),
    };
    let ask = Ask { engine: engine.parse()?, precision: precision.map(named).transpose()?, adapter };
    engine_choice::check(&ask)?;
    Ok(ask)
}

/// What is computed, by whom, and where it is kept.
pub(crate) struct Task {
    pub(crate) scene: Arc<Scene>,
    pub(crate) sets: Vec<String>,
    pub(crate) ask: Ask,
    pub(crate) shard: Option<Shard>,
    pub(crate) out: Option<Out>,
}

/// A folder that records are kept in.
pub(crate) struct Out {
    pub(crate) path: PathBuf,
    pub(crate) force: bool,
    pub(crate) resume: bool,
}

impl Out {
    /// Opens it; waits where a computation of this process, which was left to itself, may still have it.
    pub(crate) fn open(&self, watch: &Watch) -> Result<Folder, Problem> {
        loop {
            match open_folder(&self.path, self.force, self.resume) {
                Err(RunRecordsError::Folder(FolderError::InUse { .. }))
                    if waiting::is_anything_left() && !watch.is_halted() =>
                {
                    thread::sleep(waiting::TICK);
                }
                opened => return Ok(opened?),
            }
        }
    }
}

/// Cells that have all been computed.
pub(crate) struct Integrated<'p> {
    pub(crate) engine: Engine<'p>,
    /// Why that engine.
    pub(crate) why: String,
    /// Of adapters that failed, a line each.
    pub(crate) warnings: Vec<String>,
    pub(crate) work: Work<'p>,
    opening: Duration,
    elapsed: Duration,
    elapsed_before: Duration,
    resumed: usize,
}

impl Integrated<'_> {
    /// Who computed them and in what time.
    pub(crate) fn run<'a>(&self, task: &'a Task, device: &'a str, processor: &'a str) -> Run<'a> {
        let made = Provenance { engine: self.engine.name(), precision: self.engine.precision(), device };
        Run {
            opening: self.opening,
            elapsed: self.elapsed,
            elapsed_before: self.elapsed_before,
            resumed_cells: self.resumed,
            ..Run::new(made, &task.sets, processor).on(&self.engine)
        }
    }
}

impl Task {
    /// Refuses what does not fit this machine.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        let out = self.out.as_ref().map(|out| &*out.path);
        Ok(job::capacity::fits(&self.scene, self.shard, self.ask.engine, out)?)
    }

    /// Computes all cells and keeps them in the folder, if there is one. None if it was told to end before.
    pub(crate) fn integrate<'p>(
        &self,
        plan: &'p Plan,
        folder: Option<&Folder>,
        watch: &Watch,
    ) -> Result<Option<Integrated<'p>>, Problem> {
        let clock = Instant::now();
        let ask = match &self.out {
            Some(out) if out.resume => resumed_engine::engine_of(self.ask.clone(), &out.path),
            _ => self.ask.clone(),
        };
        let chosen = pollster::block_on(engine_choice::open(plan, &ask))?;
        let Chosen { mut engine, why, mut warnings, notes } = chosen;
        // Cards that are left out.
        warnings.extend(notes);
        let warnings = Arc::new(Mutex::new(warnings));
        let lost = Arc::clone(&warnings);
        engine.listen(move |Loss { adapter, cells, reason }| {
            let told = format!("adapter {adapter} was lost ({reason}); {cells} cells went to the others");
            lost.lock().unwrap_or_else(PoisonError::into_inner).push(told);
        });
        let opening = clock.elapsed();
        if watch.is_halted() {
            return Ok(None);
        }
        let mut work = Work::new(plan, self.shard);
        let resumes = self.out.as_ref().is_some_and(|out| out.resume);
        let opened = folder
            .map(|folder| RunRecords::open(folder, &self.scene, &engine, resumes, &mut work))
            .transpose();
        let mut kept = opened?;
        let damage = kept.as_ref().and_then(|kept| kept.damage());
        warnings.lock().unwrap_or_else(PoisonError::into_inner).extend(damage);
        let resumed = kept.as_ref().map_or(0, RunRecords::resumed);
        let elapsed_before = kept.as_ref().map_or(Duration::ZERO, RunRecords::elapsed_before);
        let clock = Instant::now();
        let mut done = resumed;
        let Work { schedule, records, tally, .. } = &mut work;
        watch.tell(done, schedule.expected());
        let keep = |batch: &[(u32, Record)], expected| {
            tally.take(plan, batch);
            if let Some(kept) = &mut kept {
                kept.store(batch)?;
            }
            done += batch.len();
            watch.tell(done, expected);
            Ok(())
        };
        let swept = sweep::run(plan, schedule, &mut engine, records, watch.halt(), keep);
        if !pollster::block_on(swept)? {
            return Ok(None);
        }
        let elapsed = clock.elapsed();
        let warnings = std::mem::take(&mut *warnings.lock().unwrap_or_else(PoisonError::into_inner));
        Ok(Some(Integrated { engine, why, warnings, work, opening, elapsed, elapsed_before, resumed }))
    }
}
