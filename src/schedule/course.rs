//! Cells in an order that follows from the records taken up so far.

use super::Refined;
use super::adaptive::Adaptive;
use super::follow::Follow;
use crate::plan::{Cell, Plan};
use crate::record::Record;

/// The cells that are asked for, and by what rule more of them are.
#[derive(Clone)]
pub(super) struct Course {
    sequence: Vec<u32>,
    /// By place: cells in the longest chain that led there.
    depths: Vec<u32>,
    /// Records taken up, in whatever order they came.
    taken: usize,
    /// Where the last row begins.
    row: usize,
    rule: Rule,
}

/// What asks for cells.
#[derive(Clone)]
enum Rule {
    /// All are asked for from the beginning.
    Whole,
    /// Rows that follow each other.
    Follow(Follow),
    /// Blocks that differ.
    Adaptive(Box<Adaptive>),
}

impl Course {
    pub(super) fn new(plan: &Plan) -> Course {
        let mut sequence = Vec::new();
        let rule = match plan.refine() {
            Some(refine) => Rule::Adaptive(Box::new(Adaptive::new(plan, refine, &mut sequence))),
            None if plan.policy().follows() => {
                let follow = Follow::new(plan);
                sequence = follow.row();
                Rule::Follow(follow)
            }
            None => {
                sequence = every_run(plan);
                Rule::Whole
            }
        };
        Course { depths: vec![1; sequence.len()], sequence, taken: 0, row: 0, rule }
    }

    /// Ids of the cells that are asked for by now.
    pub(super) fn sequence(&self) -> &[u32] {
        &self.sequence
    }

    /// How many of them have been taken up.
    pub(super) fn taken(&self) -> usize {
        self.taken
    }

    /// Takes up the record of a cell of the sequence; `records` are those of all runs, this one included.
    pub(super) fn take(&mut self, id: u32, records: &[Record]) {
        self.taken += 1;
        if let Rule::Adaptive(adaptive) = &mut self.rule {
            adaptive.take(id, &records[id as usize], &mut self.sequence);
        }
        let depth = 1 + self.depths[self.taken - 1];
        self.depths.resize(self.sequence.len(), depth);
        if self.taken == self.sequence.len() {
            self.settle(records);
        }
    }

    /// Goes on once everything that was asked for has been taken up.
    fn settle(&mut self, records: &[Record]) {
        let end = self.sequence.len();
        match &mut self.rule {
            Rule::Whole => {}
            Rule::Follow(follow) => {
                self.sequence.extend(follow.next(records));
                self.row = end;
            }
            Rule::Adaptive(adaptive) => adaptive.settle(records, &mut self.sequence),
        }
        let depth = 1 + self.depths.iter().max().copied().unwrap_or(0);
        self.depths.resize(self.sequence.len(), depth);
    }

    /// Runs that there will be, as far as is known by now.
    pub(super) fn expected(&self) -> usize {
        match &self.rule {
            Rule::Follow(follow) => follow.cell_count(),
            Rule::Whole | Rule::Adaptive(_) => self.sequence.len(),
        }
    }

    /// The cell at a place of the sequence; where cells follow their neighbours, of its last row.
    pub(super) fn cell(&self, plan: &Plan, place: usize) -> Cell {
        let cell = plan.cell(self.sequence[place]);
        match &self.rule {
            Rule::Follow(follow) => Cell { start: follow.start(place - self.row), ..cell },
            Rule::Whole | Rule::Adaptive(_) => cell,
        }
    }

    /// Fills what was not integrated and says how it went; none where every cell was.
    pub(super) fn finish(&self, records: &mut [Record]) -> Option<Refined> {
        let Rule::Adaptive(adaptive) = &self.rule else { return None };
        let filled = adaptive.fill(records);
        Some(Refined {
            integrated: self.sequence.len(),
            filled,
            rounds: self.depths.iter().max().map_or(0, |&depth| depth as usize),
            audits: adaptive.audits().to_vec(),
        })
    }
}

/// All cells in the plan's order, for every start.
fn every_run(plan: &Plan) -> Vec<u32> {
    let cells = plan.cell_count() as u32;
    let of = |nth: u32| plan.order().iter().map(move |id| nth * cells + id);
    (0..plan.start_count() as u32).flat_map(of).collect()
}
