//! Rows that follow the attractor: each cell starts where its neighbour in the row before ended.

use crate::map::plan::{Plan, followed};
use crate::map::scene::Start;
use crate::record::Record;
use rattlemap_dynamics::model::{REST, State};

/// Where a map that follows its neighbours stands.
pub(super) struct Follow {
    columns: usize,
    rows: usize,
    is_down: bool,
    /// Rows before the one under way.
    done: usize,
    /// Starts of the row under way, by column.
    starts: Vec<State>,
}

impl Follow {
    pub(super) fn new(plan: &Plan) -> Follow {
        let [columns, rows] = plan.counts();
        let is_down = plan.policy() == Start::Down;
        Follow { columns, rows, is_down, done: 0, starts: vec![REST; columns] }
    }

    pub(super) fn cell_count(&self) -> usize {
        self.columns * self.rows
    }

    /// The cells of the row under way, by column.
    pub(super) fn row(&self) -> Vec<u32> {
        let j = if self.is_down { self.rows - 1 - self.done } else { self.done };
        (j * self.columns..(j + 1) * self.columns).map(|id| id as u32).collect()
    }

    /// Where the cell in a column of the row under way starts.
    pub(super) fn start(&self, column: usize) -> State {
        self.starts[column]
    }

    /// The next row, now that this one has its records; none after the last.
    pub(super) fn next(&mut self, records: &[Record]) -> Vec<u32> {
        if self.done + 1 == self.rows {
            return Vec::new();
        }
        self.starts = self.row().into_iter().map(|id| followed(records.get(id as usize))).collect();
        self.done += 1;
        self.row()
    }
}
