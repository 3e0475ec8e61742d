//! Cells on an engine: what maps and shards have in common.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rattlemap::cli;
use rattlemap::gpu::Precision;
use rattlemap::map::engine::{Engine, Loss};
use rattlemap::map::engine_choice::{self, Ask, Chosen};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene;
use rattlemap::map::schedule::Schedule;
use rattlemap::map::shard::Shard;
use rattlemap::map::sweep;
use rattlemap::output::map::Run;
use rattlemap::output::shard::Tally;
use rattlemap::output::{self, Folder, Identity, Order, RECORDS, RecordFile, RecordFileError, unfinished};
use rattlemap::record::Record;

use crate::problem::Problem;
use crate::waiting::Watch;

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
    /// Opens it.
    pub(crate) fn open(&self) -> Result<Folder, Problem> {
        if self.resume && !self.path.join(RECORDS).is_file() && Folder::holds_results(&self.path) {
            return Err(RecordFileError::NothingToResume { folder: self.path.clone() }.into());
        }
        let folder = Folder::open(&self.path, self.force || self.resume)?;
        folder.refuse_links(output::map::names())?;
        Ok(folder)
    }
}

/// Cells that have all been computed.
pub(crate) struct Integrated<'p> {
    pub(crate) engine: Engine<'p>,
    /// Why that engine.
    pub(crate) why: String,
    /// Of adapters that failed, a line each.
    pub(crate) warnings: Vec<String>,
    pub(crate) schedule: Schedule,
    /// By run; none of a shard whose cells need no others.
    pub(crate) records: Vec<Record>,
    pub(crate) tally: Tally,
    opening: Duration,
    elapsed: Duration,
    elapsed_before: Duration,
    resumed: usize,
}

impl Integrated<'_> {
    /// Who computed them and in what time.
    pub(crate) fn run<'a>(&self, task: &'a Task, device: &'a str, processor: &'a str) -> Run<'a> {
        Run {
            sets: &task.sets,
            engine: self.engine.name(),
            precision: self.engine.precision(),
            device,
            adapter: self.engine.adapter(),
            cards: self.engine.cards(),
            processor,
            opening: self.opening,
            elapsed: self.elapsed,
            elapsed_before: self.elapsed_before,
            resumed_cells: self.resumed,
            lane_grid: self.engine.steps_per_period(),
            refined: None,
            without_effect: Vec::new(),
            merged: None,
        }
    }
}

impl Task {
    /// Refuses what does not fit this machine.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        let out = self.out.as_ref().map(|out| &*out.path);
        Ok(cli::fits(&self.scene, self.shard, self.ask.engine, out)?)
    }

    /// Computes all cells and keeps them in the folder, if there is one. None if it was told to end before.
    pub(crate) fn integrate<'p>(
        &self,
        plan: &'p Plan,
        folder: Option<&Folder>,
        watch: &Watch,
    ) -> Result<Option<Integrated<'p>>, Problem> {
        let clock = Instant::now();
        let chosen = pollster::block_on(engine_choice::open(plan, &self.ask))?;
        let Chosen { mut engine, why, warnings, .. } = chosen;
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
        let mut schedule = Schedule::of(plan, self.shard);
        let count = if self.shard.is_none() || schedule.reads_records() { plan.run_count() } else { 0 };
        let mut records = vec![Record::default(); count];
        let mut tally = Tally::default();
        let mut kept = match folder {
            Some(folder) => {
                Some(self.open_records(folder, plan, &engine, &mut schedule, &mut records, &mut tally)?)
            }
            None => None,
        };
        if let Some(kept) = &kept
            && let Some(damage) = kept.file.damage()
        {
            let (path, count) = (kept.folder.path().join(RECORDS), kept.file.count());
            warnings.lock().unwrap_or_else(PoisonError::into_inner).push(format!(
                "{}: {damage}; what is damaged is dropped: {count} are kept, the others computed again",
                path.display()
            ));
        }
        let resumed = kept.as_ref().map_or(0, |kept| kept.file.count());
        let elapsed_before = kept.as_ref().map_or(Duration::ZERO, |kept| kept.elapsed_before);
        let clock = Instant::now();
        let mut done = resumed;
        watch.tell(done, schedule.expected());
        let keep = |batch: &[(u32, Record)], expected| {
            tally.take(plan, batch);
            if let Some(kept) = &mut kept {
                kept.file.append(batch)?;
                unfinished::keep_elapsed(kept.folder, elapsed_before + clock.elapsed())?;
            }
            done += batch.len();
            watch.tell(done, expected);
            Ok(())
        };
        let swept = sweep::run(plan, &mut schedule, &mut engine, &mut records, watch.halt(), keep);
        if !pollster::block_on(swept)? {
            return Ok(None);
        }
        let elapsed = clock.elapsed();
        let warnings = std::mem::take(&mut *warnings.lock().unwrap_or_else(PoisonError::into_inner));
        Ok(Some(Integrated {
            engine,
            why,
            warnings,
            schedule,
            records,
            tally,
            opening,
            elapsed,
            elapsed_before,
            resumed,
        }))
    }

    /// The record file, and what it holds already.
    fn open_records<'f>(
        &self,
        folder: &'f Folder,
        plan: &Plan,
        engine: &Engine<'_>,
        schedule: &mut Schedule,
        records: &mut [Record],
        tally: &mut Tally,
    ) -> Result<Kept<'f>, Problem> {
        let path = folder.path().join(RECORDS);
        let identity =
            Identity::new(engine.name(), engine.precision(), &engine.device(), self.scene.identity())
                .of_shard(self.shard);
        let resumes = self.out.as_ref().is_some_and(|out| out.resume) && path.is_file();
        let (file, elapsed_before) = if resumes {
            let order = if schedule.takes_any_order() { Order::Any } else { Order::AsKept };
            let take = |batch: &[(u32, Record)]| {
                tally.take(plan, batch);
                plan.admits(batch) && sweep::replay(schedule, records, batch)
            };
            (RecordFile::resume(&path, &identity, order, take)?, unfinished::elapsed(folder))
        } else {
            (RecordFile::create(&path, &identity)?, Duration::ZERO)
        };
        if elapsed_before.is_zero() {
            unfinished::clear(folder)?;
        } else {
            unfinished::keep_elapsed(folder, elapsed_before)?;
        }
        output::map::begin(folder, &self.scene)?;
        Ok(Kept { folder, file, elapsed_before })
    }
}

/// What outlives cells that are interrupted.
struct Kept<'f> {
    folder: &'f Folder,
    file: RecordFile,
    /// How long earlier runs took.
    elapsed_before: Duration,
}
