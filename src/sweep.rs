//! The run of a map: batch after batch through an engine, each kept before the next begins.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use thiserror::Error;

use crate::engine::{Engine, EngineError};
use crate::plan::{Batch, Plan};
use crate::record::Record;
use crate::schedule::Schedule;

/// What a batch should take: short enough to lose one, long enough not to be noticed.
const BATCH_SECONDS: f64 = 1.0;

/// Most cells of a batch, lest a fast engine's batch fills the memory.
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
/// run) and hands every batch to `keep`, with the number of places that are foreseen by now;
/// `keep` says whether to go on. True if the map is finished.
///
/// Batches grow and shrink so that each takes about a second; records do not depend on it.
/// A batch too large for the engine's memory is tried again with half as many cells.
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
    let mut place = from;
    while place < schedule.sequence().len() || schedule.extend(records) {
        let batch = schedule.batch(plan, place, pace.cells);
        let clock = Instant::now();
        let computed = match engine.run(&batch).await {
            Err(EngineError::OutOfMemory { .. }) if pace.halve(batch.cells.len()) => continue,
            other => other?,
        };
        place = batch.places.end;
        pace.adapt(batch.cells.len(), clock.elapsed());
        store(&batch, &computed, records);
        let stops = keep(&batch, &computed, schedule.expected()).map_err(SweepError::Keep)?.is_break();
        if stops && (place < schedule.sequence().len() || schedule.extend(records)) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Puts the records of a batch where its cells belong.
fn store(batch: &Batch, computed: &[Record], records: &mut [Record]) {
    for (cell, record) in batch.cells.iter().zip(computed) {
        records[cell.id as usize] = *record;
    }
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
    if place == schedule.sequence().len() && !schedule.extend(records) {
        return false;
    }
    let batch = schedule.batch(plan, place, computed.len());
    store(&batch, computed, records);
    batch.cells.len() == computed.len()
}

/// How many cells the next batch has.
struct Pace {
    cells: usize,
    most: usize,
}

impl Pace {
    /// Makes batches smaller for good; false if they have one cell already.
    fn halve(&mut self, tried: usize) -> bool {
        self.most = tried / 2;
        self.cells = self.most;
        self.most > 0
    }

    /// Aims at a second, by no more than a factor of 4 at a time: costs differ from one part
    /// of a map to the next.
    fn adapt(&mut self, cells: usize, elapsed: Duration) {
        let factor = (BATCH_SECONDS / elapsed.as_secs_f64().max(1e-3)).clamp(0.25, 4.0);
        self.cells = ((cells as f64 * factor) as usize).clamp(1, self.most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_aim_at_a_second() {
        let mut pace = Pace { cells: 100, most: 1000 };
        pace.adapt(100, Duration::from_millis(500));
        assert_eq!(pace.cells, 200);
        pace.adapt(200, Duration::from_nanos(1));
        assert_eq!(pace.cells, 800);
        pace.adapt(800, Duration::from_secs(100));
        assert_eq!(pace.cells, 200);
        assert!(pace.halve(200));
        pace.adapt(100, Duration::from_nanos(1));
        assert_eq!(pace.cells, 100);
        assert!(!pace.halve(1));
    }
}
