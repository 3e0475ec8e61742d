//! The run of a map: cells go through an engine as soon as they are asked for, records are kept in their order.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use thiserror::Error;

use crate::engine::{Engine, EngineError};
use crate::plan::{Batch, Plan};
use crate::record::Record;
use crate::schedule::Schedule;

/// What cells should take until some have ended: short enough to lose them, long enough not to be noticed.
const BATCH_SECONDS: f64 = 1.0;

/// Most cells under way, lest those of a fast engine fill the memory.
const LARGEST_BATCH: usize = 1 << 20;

/// Why a sweep ended before its last cell.
#[derive(Debug, Error)]
pub enum SweepError {
    /// The engine failed. Batches that were kept before are kept.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A batch could not be kept.
    #[error("{0:#}")]
    Keep(anyhow::Error),
}

/// Runs the cells of a schedule from place `from` on, puts their records into `records` (by
/// run) and hands what is next in the sequence to `keep`, with the number of places that are foreseen by
/// now; `keep` says whether to go on. True if the map is finished.
///
/// So many cells are under way that some end in about a second; records do not depend on it, nor does
/// their order. If there are too many for the engine's memory it gets half as many.
///
/// # Errors
/// [`SweepError`], after which everything handed to `keep` before is still good.
pub async fn run(
    plan: &Plan,
    schedule: &mut Schedule,
    engine: &mut Engine<'_>,
    records: &mut [Record],
    from: usize,
    mut keep: impl FnMut(&Batch, &[Record], usize) -> anyhow::Result<ControlFlow<()>>,
) -> Result<bool, SweepError> {
    let mut pace = Pace { cells: engine.least_batch(), most: LARGEST_BATCH };
    let (mut place, mut under_way) = (from, 0);
    while !schedule.is_finished() {
        let next = schedule.next(plan, pace.cells.saturating_sub(under_way));
        match engine.begin(&next).await {
            Err(EngineError::OutOfMemory { .. }) if pace.halve(under_way + next.len()) => {
                schedule.take_back();
                continue;
            }
            other => other?,
        }
        under_way += next.len();
        assert!(under_way > 0, "a schedule that is not finished has cells to begin");
        let clock = Instant::now();
        let ended = engine.advance(under_way / 2).await?;
        pace.adapt(under_way, ended.len(), clock.elapsed());
        under_way -= ended.len();
        for (id, record) in ended {
            records[id as usize] = record;
            schedule.come(id, records);
        }
        while !schedule.ready(place).is_empty() {
            let ready = schedule.ready(place);
            let batch = schedule.batch(plan, place, ready.len());
            let computed: Vec<Record> = batch.cells.iter().map(|cell| records[cell.id as usize]).collect();
            place = ready.end;
            schedule.keep(place, records);
            let stops = keep(&batch, &computed, schedule.expected()).map_err(SweepError::Keep)?.is_break();
            if stops && !schedule.is_finished() {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Takes up the records of an interrupted run, a batch that begins at `place`. False if the
/// schedule has no such places.
pub fn replay(
    plan: &Plan,
    schedule: &mut Schedule,
    records: &mut [Record],
    place: usize,
    computed: &[Record],
) -> bool {
    let batch = schedule.batch(plan, place, computed.len());
    for (cell, record) in batch.cells.iter().zip(computed) {
        records[cell.id as usize] = *record;
        schedule.come(cell.id, records);
    }
    schedule.keep(batch.places.end, records);
    batch.cells.len() == computed.len()
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

    /// Aims at a second, by no more than a factor of 4 at a time: costs differ from one part
    /// of a map to the next. Of `under_way` cells `ended` did in the time that elapsed; the last few, which are waited
    /// for, say nothing.
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
