//! The schedule: which cells are integrated, and in which order. Pure.
//!
//! Without `[refine]` every cell is integrated, in Morton order. With it the map is adaptive. The cells of a coarse
//! grid come first. A block of cells is then halved if cells in it are known to differ, or if it touches a block whose
//! corners differ, down to single cells. Cells differ in class and period, and in symmetry, word or pattern if the
//! scene requests them; in a map of basins they differ in the attractor. The other cells are filled from the corners
//! around them. An audit integrates a random sample of the filled cells. If significantly more of them are wrong than
//! allowed, blocks filled with the most frequently wrong values are halved and the audit is repeated. Otherwise only
//! the blocks with wrong cells are halved.
//!
//! If cells follow their neighbours (`start.policy = "up"` or `"down"`), every row of cells starts from the last states
//! of the preceding row. Several starts per cell are further runs over all cells, one start after the other, so that
//! simultaneous runs start alike.
//!
//! Requests depend on the records that have arrived, not on their order. So no cell waits for a slow cell unless it
//! depends on it, and an interrupted run continues by replaying its records.

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
use crate::record::{Record, Records, RecordsMut};

/// The order of work on a map: the requested cells, and which of them have their records.
pub struct Schedule {
    /// Cells in the order of their requests.
    sequence: Vec<u32>,
    /// Number of places of the sequence that were begun, now and before the last call of `next`.
    begun: usize,
    begun_before: usize,
    /// Number of records that have arrived.
    done: usize,
    /// State of each run.
    states: Vec<RunState>,
    /// Place in the sequence where the last row begins.
    row: usize,
    strategy: Strategy,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum RunState {
    Unrequested,
    Requested,
    Done,
}

/// The rule that requests cells.
enum Strategy {
    /// All cells are requested at the beginning.
    Whole,
    /// Rows are requested one after the other.
    Follow(Follow),
    /// Blocks with different cells are refined.
    Adaptive(Box<Adaptive>),
}

/// Result of an adaptive map.
#[derive(Clone, Debug, PartialEq)]
pub struct Refined {
    /// Number of integrated cells.
    pub integrated: usize,
    /// Number of filled cells.
    pub filled: usize,
    /// Number of consecutive steps: the coarse grid, the halvings of the block that was halved most, and the samples of
    /// audits.
    pub rounds: usize,
    /// Allowed fraction of wrong filled cells.
    pub max_error: f64,
    /// Audits in order. The last one found at most the allowed fraction of wrong cells, unless no more blocks could be
    /// halved.
    pub audits: Vec<Audit>,
    /// For a map of basins, the cell from which each cell was filled; itself if it was integrated. Otherwise empty.
    pub filled_from: Vec<u32>,
}

impl Schedule {
    /// Builds the schedule of a plan.
    pub fn new(plan: &Plan) -> Schedule {
        Schedule::of(plan, None)
    }

    /// Builds the schedule of a shard of a plan, or of the whole plan.
    ///
    /// # Panics
    /// For a shard of an adaptive map, which [`Shard::check`] refuses.
    pub fn of(plan: &Plan, shard: Option<Shard>) -> Schedule {
        assert!(shard.is_none() || plan.refine().is_none(), "an adaptive map has no shards");
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

    /// Returns the ids of the cells requested so far.
    pub fn sequence(&self) -> &[u32] {
        &self.sequence
    }

    /// Returns up to `count` cells to begin next; none if the next requests depend on cells under way, or if the map is
    /// finished.
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

    /// Whether no further cell will be requested, and all have begun.
    pub fn has_begun_all(&self) -> bool {
        matches!(self.strategy, Strategy::Whole) && self.begun == self.sequence.len()
    }

    /// Takes back the cells that [`Schedule::next`] returned last, because they could not be begun.
    pub fn return_last(&mut self) {
        self.begun = self.begun_before;
    }

    /// Whether a cell is requested and has no record yet.
    pub fn is_waiting_for(&self, id: u32) -> bool {
        self.states.get(id as usize) == Some(&RunState::Requested)
    }

    /// Whether records may be accepted in any order, because no cell depends on another.
    pub fn takes_any_order(&self) -> bool {
        matches!(self.strategy, Strategy::Whole)
    }

    /// Prepares for records that are accepted next. This is only faster: it evaluates them in parallel.
    pub fn prepare(&mut self, records: &[(u32, Record)]) {
        if let Strategy::Adaptive(adaptive) = &mut self.strategy {
            adaptive.prepare(records);
        }
    }

    /// Whether the schedule reads records of other cells. Otherwise `records` may be empty in [`Schedule::take`].
    pub fn reads_records(&self) -> bool {
        !matches!(self.strategy, Strategy::Whole)
    }

    /// Accepts the record of a requested cell. `records` are those of all runs, including this one, if the schedule
    /// reads them.
    pub fn take(&mut self, id: u32, records: &(impl Records + ?Sized)) {
        self.states[id as usize] = RunState::Done;
        self.done += 1;
        let end = self.sequence.len();
        if let Strategy::Adaptive(adaptive) = &mut self.strategy {
            adaptive.take(id, &records.record(id as usize), &mut self.sequence);
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

    /// Whether every requested cell has its record.
    pub fn is_finished(&self) -> bool {
        self.done == self.sequence.len()
    }

    /// Returns the number of runs that are expected so far.
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

    /// Fills the cells that were not integrated and returns the result; none unless the map is adaptive.
    pub fn finish(&self, records: &mut (impl RecordsMut + ?Sized)) -> Option<Refined> {
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
