//! Records of a run that may be interrupted: stored as cells end, and taken up again when the run resumes.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use thiserror::Error;

use crate::map::engine::Engine;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::schedule::Schedule;
use crate::map::shard::Shard;
use crate::map::sweep;
use crate::record::{Record, RecordStore};
use crate::store::error::OutputError;
use crate::store::folder::{Folder, FolderError};
use crate::store::record_file::{Extent, Identity, Order, RECORDS, RecordFile, RecordFileError};
use crate::store::shard::Tally;
use crate::store::{map, unfinished};

/// Longest time between two waits for the disk while records are stored.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);

/// Why records cannot be stored in a folder.
#[derive(Debug, Error)]
pub enum RunRecordsError {
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The record file belongs to another run, or cannot be read or written.
    #[error(transparent)]
    Records(#[from] RecordFileError),
    /// Another file of the folder cannot be written or removed.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A map or a shard that is being computed.
pub struct Work<'p> {
    /// All cells of the map.
    pub plan: &'p Plan,
    /// The cells to integrate, and their order.
    pub schedule: Schedule,
    /// Records by run. Empty for a shard whose cells do not depend on each other.
    pub records: RecordStore,
    /// Counts over the records so far.
    pub tally: Tally,
    shard: Option<Shard>,
}

impl<'p> Work<'p> {
    /// Returns the work on a map, or on a shard of it, before its first cell. Strobe states are kept on request, and if the
    /// map's files need them.
    pub fn new(plan: &'p Plan, shard: Option<Shard>, with_strobes: bool) -> Work<'p> {
        let mut work = Work::without_records(plan, shard);
        if shard.is_none() || work.schedule.reads_records() {
            work.records = RecordStore::new(plan.run_count(), with_strobes || plan.reads_strobes());
        }
        work
    }

    /// Returns work that keeps no records, for checking those of a shard.
    pub(crate) fn without_records(plan: &'p Plan, shard: Option<Shard>) -> Work<'p> {
        let (schedule, tally) = (Schedule::of(plan, shard), Tally::default());
        Work { plan, schedule, records: RecordStore::default(), tally, shard }
    }

    /// Whether records behind damage can be taken up.
    pub(crate) fn order(&self) -> Order {
        if self.schedule.takes_any_order() { Order::Any } else { Order::Sequential }
    }

    /// Takes up a stored batch. Returns false if the plan has no such records or the schedule does not wait for them.
    pub(crate) fn replay(&mut self, batch: &[(u32, Record)]) -> bool {
        self.plan.admits(batch) && sweep::replay(&mut self.schedule, &mut self.records, batch)
    }

    /// Takes up all records of a file.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file belongs to another run, cannot be read, or has records of other cells.
    pub fn read(&mut self, path: &Path, identity: &Identity) -> Result<Extent, RecordFileError> {
        RecordFile::read(path, identity, self.order(), |batch| self.replay(batch))
    }
}

/// Refuses to resume in a folder that has results but no records.
///
/// # Errors
/// [`RecordFileError::NothingToResume`].
pub fn require_records(out: &Path) -> Result<(), RecordFileError> {
    match out.join(RECORDS).is_file() || !Folder::holds_results(out) {
        true => Ok(()),
        false => Err(RecordFileError::NothingToResume { folder: out.to_owned() }),
    }
}

/// Opens a new folder for the map of a scene; with `force` or `resume` also the folder of an earlier run.
///
/// # Errors
/// [`RunRecordsError`] if the folder cannot be used, or if there is nothing in it to resume but other files.
pub fn open_folder(out: &Path, scene: &Scene, force: bool, resume: bool) -> Result<Folder, RunRecordsError> {
    if resume {
        require_records(out)?;
    }
    let folder = Folder::open(out, force || resume)?;
    folder.prepare(map::names_of(scene))?;
    Ok(folder)
}

/// The record file of a run under way, and the time spent on it.
pub struct RunRecords<'f> {
    file: RecordFile,
    folder: &'f Folder,
    /// Number of records of earlier runs.
    pub resumed: usize,
    /// Unit of the counts: cells or runs.
    unit: &'static str,
    /// Time that earlier runs spent.
    pub elapsed_before: Duration,
    clock: Instant,
    /// Time in which this run stored records.
    pub storing: Duration,
}

impl<'f> RunRecords<'f> {
    /// Creates the record file of a run; with `resume` takes up the records of an existing one. Tables and figures of an
    /// earlier run are removed, unless all records are there.
    ///
    /// # Errors
    /// [`RunRecordsError`] if the records belong to another run, or a file cannot be read or written.
    pub fn open(
        folder: &'f Folder,
        scene: &Scene,
        engine: &Engine<'_>,
        resume: bool,
        work: &mut Work<'_>,
    ) -> Result<RunRecords<'f>, RunRecordsError> {
        let path = folder.path().join(RECORDS);
        let identity = Identity::of_run(engine, scene, work.shard);
        let (file, elapsed_before) = if resume && path.is_file() {
            let order = work.order();
            let take = |batch: &[(u32, Record)]| {
                work.tally.take(work.plan, batch);
                work.replay(batch)
            };
            (RecordFile::resume(&path, &identity, order, take)?, unfinished::elapsed(folder))
        } else {
            (RecordFile::create(&path, &identity)?, Duration::ZERO)
        };
        // The time is stored before the manifest, which may contain it, is removed.
        if elapsed_before.is_zero() {
            unfinished::clear(folder)?;
        } else {
            unfinished::store_elapsed(folder, elapsed_before)?;
        }
        // A finished run keeps its files until they are written again.
        if !resume || file.damage().is_some() || !work.schedule.is_finished() {
            map::begin(folder, scene)?;
        }
        let resumed = file.count();
        let unit = work.plan.unit();
        Ok(RunRecords {
            file,
            folder,
            resumed,
            unit,
            elapsed_before,
            clock: Instant::now(),
            storing: Duration::ZERO,
        })
    }

    /// Stores batches of records until their sender is dropped, and calls `take` with each. They are on the disk a second
    /// after they were sent, if the disk is fast enough, and all of them in the end.
    ///
    /// # Errors
    /// [`RunRecordsError`], for instance if the disk is full.
    pub fn store(
        &mut self,
        batches: &Receiver<Vec<(u32, Record)>>,
        mut take: impl FnMut(&[(u32, Record)]),
    ) -> Result<(), RunRecordsError> {
        let (mut synced, mut is_synced) = (Instant::now(), true);
        loop {
            let left = if is_synced { SYNC_INTERVAL } else { SYNC_INTERVAL.saturating_sub(synced.elapsed()) };
            let received = batches.recv_timeout(left);
            let clock = Instant::now();
            if let Ok(batch) = &received {
                take(batch);
                self.file.append(batch)?;
                is_synced = false;
            }
            let is_over = received == Err(RecvTimeoutError::Disconnected);
            if !is_synced && (is_over || synced.elapsed() >= SYNC_INTERVAL) {
                self.file.sync()?;
                unfinished::store_elapsed(self.folder, self.elapsed_before + self.elapsed())?;
                (synced, is_synced) = (Instant::now(), true);
            }
            self.storing += clock.elapsed();
            if is_over {
                return Ok(());
            }
        }
    }

    /// Number of records in the file.
    pub fn count(&self) -> usize {
        self.file.count()
    }

    /// Describes damage to the records of earlier runs, if there is any.
    pub fn damage(&self) -> Option<String> {
        let unit = self.unit;
        let (path, count, damage) = (self.folder.path().join(RECORDS), self.resumed, self.file.damage()?);
        Some(format!("{}: {damage}; {count} {unit} are kept, the others are computed again", path.display()))
    }

    /// Time since this run began.
    fn elapsed(&self) -> Duration {
        self.clock.elapsed()
    }
}
