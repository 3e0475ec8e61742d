//! The run of a map. Cells go to an engine as soon as the schedule requests for them; records are kept as they come.

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use web_time::Instant;

use crate::map::engine::{Engine, EngineError};
use crate::map::plan::Plan;
use crate::map::schedule::Schedule;
use crate::record::Record;

/// What cells should take until some have ended: short enough to lose them, long enough not to be noticed.
const BATCH_SECONDS: f64 = 1.0;

/// Records that came after the last ones were kept wait no longer than this.
const KEPT_AFTER: Duration = Duration::from_millis(500);

/// Most cells under way per card, lest those of a fast engine fill the memory.
const LARGEST_BATCH: usize = 1 << 20;

/// Why a sweep ended before its last cell.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The engine failed. Batches that were kept before are kept.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A batch could not be kept.
    #[error(transparent)]
    Keep(Box<dyn Error + Send + Sync>),
}

/// Runs the cells that a schedule requests for, puts their records into `records` (by
/// run; empty where neither the schedule reads them nor anybody else) and hands them to `keep` about once a second, with the number of runs that are prepared by
/// now. It ends before, and soon, once `halt` is raised. True if the map is finished.
///
/// So many cells are under way that some end in about a second; records do not depend on it. If there are too many
/// for the engine's memory it gets half as many.
///
/// # Errors
/// [`SweepError`], after which everything handed to `keep` before is still good.
pub async fn run(
    plan: &Plan,
    schedule: &mut Schedule,
    engine: &mut Engine<'_>,
    records: &mut [Record],
    halt: &Arc<AtomicBool>,
    mut keep: impl FnMut(&[(u32, Record)], usize) -> Result<(), Box<dyn Error + Send + Sync>>,
) -> Result<bool, SweepError> {
    engine.stop_on(halt);
    let mut pace = Pace { cells: engine.least_batch(), most: LARGEST_BATCH * engine.card_count() };
    let mut under_way = 0;
    let (mut unkept, mut last_kept, mut last_ended) = (Vec::new(), Instant::now(), Instant::now());
    while !schedule.is_finished() {
        let next = schedule.next(plan, pace.cells.saturating_sub(under_way).min(engine.room()));
        // Several cards go on meanwhile.
        let clock = if engine.card_count() > 1 { last_ended } else { Instant::now() };
        let ended = match engine.begin(&next).await {
            Err(EngineError::OutOfMemory { .. }) if pace.halve(under_way + next.len()) => {
                schedule.return_last();
                continue;
            }
            Err(error) => Err(error),
            Ok(()) => {
                under_way += next.len();
                assert!(under_way > 0, "a schedule that is not finished has cells to begin");
                engine.advance(under_way / 2).await
            }
        };
        last_ended = Instant::now();
        let is_halted = halt.load(Ordering::Relaxed);
        let is_over = match &ended {
            Err(_) => true,
            Ok(ended) => {
                pace.adapt(under_way, ended.len(), last_ended - clock);
                under_way -= ended.len();
                schedule.prepare(ended);
                for &(id, record) in ended {
                    put(records, id, record);
                    schedule.take(id, records);
                }
                unkept.extend_from_slice(ended);
                schedule.is_finished() || is_halted
            }
        };
        if !unkept.is_empty() && (is_over || last_kept.elapsed() >= KEPT_AFTER) {
            keep(&unkept, schedule.expected()).map_err(SweepError::Keep)?;
            unkept.clear();
            last_kept = Instant::now();
        }
        ended?;
        if is_halted && !schedule.is_finished() {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Takes up records of an interrupted run, in the order in which they were kept. False if the schedule does not
/// wait for one of them.
pub fn replay(schedule: &mut Schedule, records: &mut [Record], kept: &[(u32, Record)]) -> bool {
    schedule.prepare(kept);
    kept.iter().all(|&(id, record)| {
        let is_waited_for = schedule.is_waiting_for(id);
        if is_waited_for {
            put(records, id, record);
            schedule.take(id, records);
        }
        is_waited_for
    })
}

fn put(records: &mut [Record], id: u32, record: Record) {
    if let Some(place) = records.get_mut(id as usize) {
        *place = record;
    }
}

/// How many cells are under way.
struct Pace {
    cells: usize,
    most: usize,
}

impl Pace {
    /// Makes them fewer for good; false if it was one cell already.
    fn halve(&mut self, tried: usize) -> bool {
        self.most = tried / 2;
        self.cells = self.most;
        self.most > 0
    }

    /// Aims at a second, by no more than a factor of 4 at a time: costs differ from one part of a map to the
    /// next. Of `under_way` cells `ended` did in the time that elapsed; the last few, which are waited for, say
    /// nothing.
    fn adapt(&mut self, under_way: usize, ended: usize, elapsed: Duration) {
        if 2 * under_way < self.cells || 4 * ended < under_way {
            return;
        }
        let factor = (BATCH_SECONDS / elapsed.as_secs_f64().max(1e-3)).clamp(0.25, 4.0);
        self.cells = ((under_way as f64 * factor) as usize).clamp(1, self.most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_under_way_aim_at_a_second() {
        let mut pace = Pace { cells: 100, most: 1000 };
        pace.adapt(100, 60, Duration::from_millis(500));
        assert_eq!(pace.cells, 200);
        pace.adapt(200, 200, Duration::from_nanos(1));
        assert_eq!(pace.cells, 800);
        // The slowest few.
        pace.adapt(10, 10, Duration::from_secs(2));
        pace.adapt(800, 10, Duration::from_secs(20));
        assert_eq!(pace.cells, 800);
        pace.adapt(800, 400, Duration::from_secs(100));
        assert_eq!(pace.cells, 200);
        assert!(pace.halve(200));
        pace.adapt(100, 100, Duration::from_nanos(1));
        assert_eq!(pace.cells, 100);
        assert!(!pace.halve(1));
    }
}
