//! Which cells are integrated, in which order, and which need not be. Pure.
//!
//! Without `[refine]` every cell is, in Morton order. With it the map is adaptive: cells of a
//! coarse grid first, then what lies in blocks in which cells are known to differ (in
//! class, period, and symmetry or word where they are asked for; in a map of basins in the attractor), or that touch one whose corners do,
//! down to single cells. The rest is filled from the corners around it. An audit then
//! integrates a random sample of the filled cells. If it finds too many of them wrong, and more
//! than chance may put there, blocks filled with what is wrong are halved and the audit is
//! repeated; if not, only the blocks with wrong cells are refined on.
//!
//! Where cells follow their neighbours (`start.policy = "up"` or `"down"`), every row of cells
//! starts from the last states of the row before. Several starts per cell are
//! further runs over all cells, one start after the other: what runs side by side starts alike.
//!
//! What is asked for follows from the records that have done, not from their order. So nobody waits for the
//! slowest cell but what depends on it, and a run that was interrupted goes on by replaying its records.

mod adaptive;
mod audit;
mod basins;
mod blocks;
mod errors;
mod fill;
mod follow;
mod label;
#[cfg(test)]
mod tests;
mod tiling;

pub use audit::Audit;
pub use errors::{Deviation, Errors};

use adaptive::Adaptive;
use follow::Follow;

use crate::map::plan::{Cell, Plan};
use crate::map::shard::Shard;
use crate::record::Record;

/// The order of work on a map: which cells are asked for, and which of them have their records.
pub struct Schedule {
    /// Cells in the order in which they were asked for.
    sequence: Vec<u32>,
    /// Places of it that were handed out, and how many had been before the last time.
    begun: usize,
    begun_before: usize,
    /// How many records have done.
    done: usize,
    /// By run.
    states: Vec<RunState>,
    /// Where the last row begins.
    row: usize,
    strategy: Strategy,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum RunState {
    Unrequested,
    Requested,
    Done,
}

/// What requests for cells.
enum Strategy {
    /// All are asked for from the beginning.
    Whole,
    /// Rows that follow each other.
    Follow(Follow),
    /// Blocks that differ.
    Adaptive(Box<Adaptive>),
}

/// What became of an adaptive map.
#[derive(Clone, Debug, PartialEq)]
pub struct Refined {
    /// Cells that were integrated.
    pub integrated: usize,
    /// Cells that were filled.
    pub filled: usize,
    /// Steps that had to follow each other: the coarse grid, the halvings of the block that was halved most, the
    /// samples of the audits.
    pub rounds: usize,
    /// Fraction of the filled cells that the scene lets be wrong.
    pub max_error: f64,
    /// Audits in order; the last one found no more wrong cells than the scene allows, unless
    /// nothing was left to refine or blocks had been halved as often as they may.
    pub audits: Vec<Audit>,
    /// Of a map of basins: for every cell the one that it was filled from, itself where it was integrated.
    pub filled_from: Vec<u32>,
}

impl Schedule {
    /// The schedule of a plan.
    pub fn new(plan: &Plan) -> Schedule {
        Schedule::of(plan, None)
    }

    /// The schedule of a part of a plan, or of all of it.
    ///
    /// # Panics
    /// If there is a part of an adaptive map, which [`Shard::check`] refuses.
    pub fn of(plan: &Plan, shard: Option<Shard>) -> Schedule {
        assert!(shard.is_none() || plan.refine().is_none(), "an adaptive map is not dealt out");
        let mut sequence = Vec::new();
        let strategy = match plan.refine() {
            Some(refine) => Strategy::Adaptive(Box::new(Adaptive::new(plan, refine, &mut sequence))),
            None if plan.policy().follows() => {
                let follow = Follow::new(plan, shard);
                sequence = follow.row();
                Strategy::Follow(follow)
            }
            None => {
                let all = || (0..plan.run_count()).map(|place| plan.run_at(place)).collect();
                sequence = shard.map_or_else(all, |shard| shard.runs(plan));
                Strategy::Whole
            }
        };
        let states = vec![RunState::Unrequested; plan.run_count()];
        let mut schedule =
            Schedule { sequence, begun: 0, begun_before: 0, done: 0, states, row: 0, strategy };
        schedule.note_requested(0);
        schedule
    }

    /// Ids of the cells to integrate, as far as they are known by now.
    pub fn sequence(&self) -> &[u32] {
        &self.sequence
    }

    /// Up to `count` cells to begin next; none while what comes next depends on cells under way, or if
    /// the map is finished.
    pub fn next(&mut self, plan: &Plan, count: usize) -> Vec<Cell> {
        let mut cells = Vec::new();
        self.begun_before = self.begun;
        while cells.len() < count && self.begun < self.sequence.len() {
            if self.states[self.sequence[self.begun] as usize] == RunState::Requested {
                cells.push(self.cell(plan, self.begun));
            }
            self.begun += 1;
        }
        cells
    }

    /// Takes back what [`Schedule::next`] handed out last, which could not be begun.
    pub fn return_last(&mut self) {
        self.begun = self.begun_before;
    }

    /// Whether a cell is asked for and has no record yet.
    pub fn is_waiting_for(&self, id: u32) -> bool {
        self.states.get(id as usize) == Some(&RunState::Requested)
    }

    /// Whether records may be taken up in any order: no cell depends on another.
    pub fn takes_any_order(&self) -> bool {
        matches!(self.strategy, Strategy::Whole)
    }

    /// Looks at records that are taken up next: all at once is faster, and the same.
    pub fn prepare(&mut self, records: &[(u32, Record)]) {
        if let Strategy::Adaptive(adaptive) = &mut self.strategy {
            adaptive.prepare(records);
        }
    }

    /// Whether it reads the records of other cells: else there need be none when one is taken up.
    pub fn reads_records(&self) -> bool {
        !matches!(self.strategy, Strategy::Whole)
    }

    /// Takes up the record of a cell that it waits for; `records` are those of all runs, this one included, if it reads
    /// them.
    pub fn take(&mut self, id: u32, records: &[Record]) {
        self.states[id as usize] = RunState::Done;
        self.done += 1;
        let end = self.sequence.len();
        if let Strategy::Adaptive(adaptive) = &mut self.strategy {
            adaptive.take(id, &records[id as usize], &mut self.sequence);
        }
        if self.done == self.sequence.len() {
            match &mut self.strategy {
                Strategy::Whole => {}
                Strategy::Follow(follow) => {
                    self.sequence.extend(follow.next(records));
                    self.row = end;
                }
                Strategy::Adaptive(adaptive) => adaptive.settle(records, &mut self.sequence),
            }
        }
        self.note_requested(end);
    }

    fn note_requested(&mut self, from: usize) {
        for &id in &self.sequence[from..] {
            self.states[id as usize] = RunState::Requested;
        }
    }

    /// Whether every cell that is asked for has its record.
    pub fn is_finished(&self) -> bool {
        self.done == self.sequence.len()
    }

    /// Runs that there will be, as far as is known by now.
    pub fn expected(&self) -> usize {
        match &self.strategy {
            Strategy::Follow(follow) => follow.cell_count(),
            Strategy::Whole | Strategy::Adaptive(_) => self.sequence.len(),
        }
    }

    fn cell(&self, plan: &Plan, place: usize) -> Cell {
        let cell = plan.cell(self.sequence[place]);
        match &self.strategy {
            Strategy::Follow(follow) => Cell { start: follow.start(place - self.row), ..cell },
            Strategy::Whole | Strategy::Adaptive(_) => cell,
        }
    }

    /// Fills what was not integrated and says how it went; none where every cell was.
    pub fn finish(&self, records: &mut [Record]) -> Option<Refined> {
        let Strategy::Adaptive(adaptive) = &self.strategy else { return None };
        let (filled, filled_from) = adaptive.fill(records);
        Some(Refined {
            integrated: self.sequence.len(),
            filled,
            rounds: adaptive.rounds(),
            max_error: adaptive.max_error(),
            audits: adaptive.audits().to_vec(),
            filled_from,
        })
    }
}
