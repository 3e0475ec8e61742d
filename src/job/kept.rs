//! A map on its way into a folder: what is to be done, what has been, what is kept should it be interrupted.

use std::path::Path;
use std::time::{Duration, Instant};

use thiserror::Error;

use crate::gpu::Precision;
use crate::job::engine_choice::{Ask, Who};
use crate::map::engine::Engine;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::schedule::Schedule;
use crate::map::shard::Shard;
use crate::map::sweep;
use crate::record::Record;
use crate::store::error::OutputError;
use crate::store::folder::{Folder, FolderError};
use crate::store::record_file::{Identity, Order, RECORDS, RecordFile, RecordFileError};
use crate::store::shard::Tally;
use crate::store::{map, unfinished};

/// Why records cannot be kept in a folder.
#[derive(Debug, Error)]
pub enum KeptError {
    /// The folder is not to be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Its records are another run's, or cannot be read or written.
    #[error(transparent)]
    Records(#[from] RecordFileError),
    /// Another of its files cannot be written or removed.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// What is to be done, and what has been.
pub struct Work<'p> {
    /// All cells.
    pub plan: &'p Plan,
    /// Which of them are integrated, and when.
    pub schedule: Schedule,
    /// By run; none of a shard whose cells need no others.
    pub records: Vec<Record>,
    /// What has come so far, in numbers.
    pub tally: Tally,
    shard: Option<Shard>,
}

impl<'p> Work<'p> {
    /// Nothing is done yet of a map, or of a shard of it.
    pub fn new(plan: &'p Plan, shard: Option<Shard>) -> Work<'p> {
        let schedule = Schedule::of(plan, shard);
        let count = if shard.is_none() || schedule.reads_records() { plan.run_count() } else { 0 };
        Work { plan, schedule, records: vec![Record::default(); count], tally: Tally::default(), shard }
    }
}

/// Opens a new folder, an earlier run's with `force`, an interrupted one's with `resume`.
///
/// # Errors
/// [`KeptError`] if it may not be used, or holds results without records.
pub fn open_folder(out: &Path, force: bool, resume: bool) -> Result<Folder, KeptError> {
    // A run that ended before it kept anything has left nothing else.
    if resume && !out.join(RECORDS).is_file() && Folder::holds_results(out) {
        return Err(RecordFileError::NothingToResume { folder: out.to_owned() }.into());
    }
    let folder = Folder::open(out, force || resume)?;
    folder.refuse_links(map::names())?;
    Ok(folder)
}

/// The engine that was asked for; where that is left open, the one whose records the folder has.
#[must_use]
pub fn engine_of(asked: Ask, folder: &Path) -> Ask {
    if asked.engine != Who::Auto || asked.precision.is_some() {
        return asked;
    }
    match Identity::read(&folder.join(RECORDS)) {
        Ok(Some(identity)) if identity.engine() == "cpu" && asked.adapter.is_none() => {
            Ask { engine: Who::Cpu, ..asked }
        }
        Ok(Some(identity)) => {
            let precision = Precision::ALL.into_iter().find(|p| p.name() == identity.precision());
            Ask { engine: Who::Gpu, precision, ..asked }
        }
        // What is wrong with the file is said when it is resumed.
        Ok(None) | Err(_) => asked,
    }
}

/// In which order a schedule takes up records again.
pub fn order(schedule: &Schedule) -> Order {
    if schedule.takes_any_order() { Order::Any } else { Order::AsKept }
}

/// What outlives a run that is interrupted.
pub struct Kept<'f> {
    file: RecordFile,
    folder: &'f Folder,
    resumed: usize,
    /// What is counted.
    unit: &'static str,
    elapsed_before: Duration,
    clock: Instant,
}

impl<'f> Kept<'f> {
    /// Begins the records of a run; with `resume` takes up those that are there, if there are any. What an earlier run
    /// made of records goes.
    ///
    /// # Errors
    /// [`KeptError`] if the records are another run's, or a file cannot be read or written.
    pub fn open(
        folder: &'f Folder,
        scene: &Scene,
        engine: &Engine<'_>,
        resume: bool,
        work: &mut Work<'_>,
    ) -> Result<Kept<'f>, KeptError> {
        let path = folder.path().join(RECORDS);
        let identity = Identity::new(engine.name(), engine.precision(), &engine.device(), scene.identity())
            .of_shard(work.shard);
        let (file, elapsed_before) = if resume && path.is_file() {
            let Work { plan, schedule, records, tally, .. } = work;
            let order = order(schedule);
            let take = |batch: &[(u32, Record)]| {
                tally.take(plan, batch);
                plan.admits(batch) && sweep::replay(schedule, records, batch)
            };
            (RecordFile::resume(&path, &identity, order, take)?, unfinished::elapsed(folder))
        } else {
            (RecordFile::create(&path, &identity)?, Duration::ZERO)
        };
        // The manifest, which may have that time, too, goes next.
        if elapsed_before.is_zero() {
            unfinished::clear(folder)?;
        } else {
            unfinished::keep_elapsed(folder, elapsed_before)?;
        }
        map::begin(folder, scene)?;
        let resumed = file.count();
        Ok(Kept { file, folder, resumed, unit: work.plan.unit(), elapsed_before, clock: Instant::now() })
    }

    /// Keeps what has ended: it is on the disk then.
    ///
    /// # Errors
    /// [`KeptError`], for instance on a full disk.
    pub fn keep(&mut self, batch: &[(u32, Record)]) -> Result<(), KeptError> {
        self.file.append(batch)?;
        Ok(unfinished::keep_elapsed(self.folder, self.elapsed_before + self.elapsed())?)
    }

    /// How many records there are.
    pub fn count(&self) -> usize {
        self.file.count()
    }

    /// How many of them earlier runs left.
    pub fn resumed(&self) -> usize {
        self.resumed
    }

    /// What was no good of those, if anything was, in words.
    pub fn damage(&self) -> Option<String> {
        let unit = self.unit;
        let (path, count, damage) = (self.folder.path().join(RECORDS), self.resumed, self.file.damage()?);
        Some(format!(
            "{}: {damage}; what is damaged is dropped: {count} {unit} are kept, the others computed again",
            path.display()
        ))
    }

    /// Where they are.
    pub fn folder(&self) -> &'f Folder {
        self.folder
    }

    /// How long earlier runs integrated.
    pub fn elapsed_before(&self) -> Duration {
        self.elapsed_before
    }

    /// How long ago this one began.
    pub fn elapsed(&self) -> Duration {
        self.clock.elapsed()
    }
}
