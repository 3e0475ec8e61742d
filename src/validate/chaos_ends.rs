//! Transient chaos: a random sample of the map's chaotic cells is followed for many more periods.
//!
//! No finite time shows that chaos lasts. The share of cells whose chaos ends in the further periods measures how many cells of
//! the map are called chaotic only because the map stopped early.

use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::Subject;
use super::cell::Cell;
use super::rate::Rate;
use crate::map::random::Random;
use crate::record::classify::classify;
use crate::record::{Record, Records, valid};
use rattlemap_dynamics::orbit::Class;

/// Default number of further periods.
pub const CHAOS_PERIODS: u32 = 6000;

/// One cell is followed for this number of cells in the sample.
const SAMPLES_PER_CELL: usize = 5;

/// Result of the further periods.
#[derive(Clone, Debug, PartialEq)]
pub struct ChaosEnds {
    /// Number of further periods, after all periods of the map.
    pub periods: u32,
    /// Number of integrated chaotic runs in the map.
    pub runs: usize,
    /// Cells whose chaos ended, among the followed ones.
    pub rate: Rate,
    /// Cells whose chaos ended, by id.
    pub ended: Vec<ChaosEnd>,
}

/// A cell whose chaos ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChaosEnd {
    /// The run, as in [`Plan::cell`](crate::map::plan::Plan::cell).
    pub id: u32,
    /// Indices of its cell.
    pub indices: [usize; 2],
    /// Its class after the chaos.
    pub class: Class,
    /// Number of periods from the start after which the class after the chaos was known.
    pub periods_run: u32,
}

/// Draws chaotic runs to follow for a validation with `samples` cells. Returns them, and the number of integrated chaotic runs.
pub fn draw_chaos(records: &dyn Records, samples: usize, seed: u64) -> (Vec<u32>, usize) {
    let is_chaotic =
        |record: &Record| record.valid & valid::FILLED == 0 && classify(record) == Class::Chaotic;
    let chaotic = (0..).zip(records.iter()).filter(|(_, record)| is_chaotic(record));
    let mut ids: Vec<u32> = chaotic.map(|(id, _)| id).collect();
    let (runs, count) = (ids.len(), ids.len().min(samples.div_ceil(SAMPLES_PER_CELL)));
    Random::new(seed).draw(&mut ids, count);
    ids.truncate(count);
    ids.sort_unstable();
    (ids, runs)
}

/// Follows chaotic runs on the reference, from their starts, for `periods` more periods than the map. `report` is called after
/// each run, from any thread. The result means nothing once `halt` is set.
pub fn follow_chaos(
    subject: &Subject<'_>,
    (ids, runs): (&[u32], usize),
    periods: u32,
    report: &(dyn Fn() + Sync),
    halt: &AtomicBool,
) -> ChaosEnds {
    let follow = |&id: &u32| {
        let record = Cell::new(subject, id, halt).followed(periods);
        report();
        let class = classify(&record);
        let indices = subject.plan.indices(id);
        (class != Class::Chaotic).then_some(ChaosEnd { id, indices, class, periods_run: record.periods_run })
    };
    let ended: Vec<ChaosEnd> = ids.par_iter().with_max_len(1).filter_map(follow).collect();
    ChaosEnds { periods, runs, rate: Rate::new(ended.len(), ids.len()), ended }
}
