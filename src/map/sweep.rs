//! The run of a map: gives cells to an engine as soon as the schedule requests them, and stores their records.

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use web_time::Instant;

use crate::map::engine::{Engine, EngineError};
use crate::map::plan::Plan;
use crate::map::schedule::Schedule;
use crate::record::{Record, RecordsMut};

/// Target time in seconds until some of the cells under way have ended: little work is lost on an interruption, and the
/// overhead per batch stays small.
const BATCH_SECONDS: f64 = 1.0;

/// Longest time that records wait until they are stored.
const STORE_INTERVAL: Duration = Duration::from_millis(500);

/// A batch of at least this many records is not joined to others, because joining would copy it.
const LARGE: usize = 1 << 14;

/// Cells per core in an engine's smallest batch.
const ROUNDS_OF_CORES: usize = 64;

/// Why a sweep ended early.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The engine failed. Records that were stored before remain valid.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// Records could not be stored.
    #[error(transparent)]
    Store(Box<dyn Error + Send + Sync>),
}

/// Runs the cells that a schedule requests. Puts their records into `records`, by run, if the schedule reads them; otherwise
/// `records` may be empty. Calls `store` with new records and the number of runs that are expected so far: for each
/// large batch, and about twice a second. Stops soon after `halt` is raised. Returns whether the map is finished.
///
/// The number of cells under way is adapted so that some end within about a second; records do not depend on it. It is
/// halved if the cells do not fit into the engine's memory.
///
/// # Errors
/// [`SweepError`]. Records that were given to `store` before remain valid.
pub async fn run(
    plan: &Plan,
    schedule: &mut Schedule,
    engine: &mut Engine<'_>,
    records: &mut (impl RecordsMut + ?Sized),
    halt: &Arc<AtomicBool>,
    mut store: impl FnMut(Vec<(u32, Record)>, usize) -> Result<(), Box<dyn Error + Send + Sync>>,
) -> Result<bool, SweepError> {
    engine.stop_on(halt);
    let mut pace = Pace {
        cells: engine.least_batch(),
        least: (engine.least_batch() / ROUNDS_OF_CORES).max(1),
        most: engine.largest_batch(),
    };
    let mut under_way = 0;
    let mut unstored = Vec::new();
    let mut last_stored = Instant::now();
    while !schedule.is_finished() {
        let next = schedule.next(plan, pace.cells.saturating_sub(under_way).min(engine.room()));
        let clock = Instant::now();
        let ended = match engine.begin(&next).await {
            Err(EngineError::OutOfMemory { .. }) if pace.halve(under_way + next.len()) => {
                schedule.return_last();
                continue;
            }
            Err(error) => Err(error),
            Ok(()) => {
                under_way += next.len();
                assert!(under_way > 0, "a schedule that is not finished has cells to begin");
                let until = if schedule.has_begun_all() { 0 } else { under_way / 2 };
                engine.advance(until).await
            }
        };
        let elapsed = clock.elapsed();
        let is_halted = halt.load(Ordering::Relaxed);
        let mut stored = Vec::new();
        let (is_over, failure) = match ended {
            Err(error) => (true, Some(error)),
            Ok(ended) => {
                pace.adapt(under_way, ended.len(), elapsed);
                under_way -= ended.len();
                schedule.prepare(&ended);
                ended.iter().for_each(|(id, record)| take(schedule, records, *id, record));
                if ended.len().max(unstored.len()) < LARGE {
                    unstored.extend(ended);
                } else if !ended.is_empty() {
                    stored = std::mem::replace(&mut unstored, ended);
                }
                (schedule.is_finished() || is_halted, None)
            }
        };
        let is_time = is_over || last_stored.elapsed() >= STORE_INTERVAL;
        let due = if is_time { std::mem::take(&mut unstored) } else { Vec::new() };
        for batch in [stored, due].into_iter().filter(|batch| !batch.is_empty()) {
            store(batch, schedule.expected()).map_err(SweepError::Store)?;
            last_stored = Instant::now();
        }
        failure.map_or(Ok(()), Err)?;
        if is_halted && !schedule.is_finished() {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Repeats the stored records of an interrupted run in their order. Returns false if the schedule does not wait for one
/// of them.
pub fn replay(
    schedule: &mut Schedule,
    records: &mut (impl RecordsMut + ?Sized),
    stored: &[(u32, Record)],
) -> bool {
    schedule.prepare(stored);
    stored.iter().all(|(id, record)| {
        let is_expected = schedule.is_waiting_for(*id);
        if is_expected {
            take(schedule, records, *id, record);
        }
        is_expected
    })
}

fn take(schedule: &mut Schedule, records: &mut (impl RecordsMut + ?Sized), id: u32, record: &Record) {
    if (id as usize) < records.count() {
        records.put(id as usize, record);
    }
    schedule.take(id, records);
}

/// Controls the number of cells under way.
struct Pace {
    cells: usize,
    /// Number that keeps every core busy with one cell, however slow it is.
    least: usize,
    most: usize,
}

impl Pace {
    /// Halves the number of cells for good, after `tried` cells did not fit into the memory. Returns false for one cell.
    fn halve(&mut self, tried: usize) -> bool {
        self.most = tried / 2;
        self.cells = self.most;
        self.most > 0
    }

    /// Adapts the number of cells to [`BATCH_SECONDS`], by a factor of at most 4, because costs differ between parts of
    /// a map. `ended` of `under_way` cells ended within `elapsed`. The last cells of a map are ignored: they are too
    /// few to measure.
    fn adapt(&mut self, under_way: usize, ended: usize, elapsed: Duration) {
        if 2 * under_way < self.cells || 4 * ended < under_way {
            return;
        }
        let factor = (BATCH_SECONDS / elapsed.as_secs_f64().max(1e-3)).clamp(0.25, 4.0);
        self.cells = ((under_way as f64 * factor) as usize).clamp(self.least.min(self.most), self.most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_cells_under_way_aims_at_one_second() {
        let mut pace = Pace { cells: 100, least: 8, most: 1000 };
        pace.adapt(100, 60, Duration::from_millis(500));
        assert_eq!(pace.cells, 200);
        pace.adapt(200, 200, Duration::from_nanos(1));
        assert_eq!(pace.cells, 800);
        // The last cells are ignored.
        pace.adapt(10, 10, Duration::from_secs(2));
        pace.adapt(800, 10, Duration::from_secs(20));
        assert_eq!(pace.cells, 800);
        pace.adapt(800, 400, Duration::from_secs(100));
        assert_eq!(pace.cells, 200);
        // Every core has a cell, even if each takes minutes.
        for _ in 0..4 {
            pace.adapt(pace.cells, pace.cells, Duration::from_secs(100));
        }
        assert_eq!(pace.cells, 8);
        assert!(pace.halve(200));
        pace.adapt(100, 100, Duration::from_nanos(1));
        assert_eq!(pace.cells, 100);
        assert!(!pace.halve(1));
    }
}
