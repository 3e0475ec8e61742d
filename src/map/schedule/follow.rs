//! Rows that follow the attractor: each cell starts in the last state of its neighbour in the preceding row.

use crate::map::plan::{Plan, followed};
use crate::map::scene::Start;
use crate::map::shard::Shard;
use crate::record::Records;
use rattlemap_dynamics::model::{REST, State};

/// State of a map whose cells follow their neighbours.
pub(super) struct Follow {
    /// Number of cells in a row of the map, and the columns that are computed.
    width: usize,
    columns: Vec<u32>,
    rows: usize,
    is_down: bool,
    /// Number of finished rows.
    done: usize,
    /// Starts of the current row.
    starts: Vec<State>,
}

impl Follow {
    pub(super) fn new(plan: &Plan, shard: Option<Shard>) -> Follow {
        let [width, rows] = plan.counts();
        let columns = shard.map_or_else(|| (0..width as u32).collect(), |shard| shard.columns(plan));
        let (is_down, starts) = (plan.policy() == Start::Down, vec![REST; columns.len()]);
        Follow { width, columns, rows, is_down, done: 0, starts }
    }

    pub(super) fn cell_count(&self) -> usize {
        self.columns.len() * self.rows
    }

    /// Returns the cells of the current row, by column.
    pub(super) fn row(&self) -> Vec<u32> {
        let j = if self.is_down { self.rows - 1 - self.done } else { self.done };
        self.columns.iter().map(|column| (j * self.width) as u32 + column).collect()
    }

    /// Returns the start of a cell of the current row, by its place there.
    pub(super) fn start(&self, place: usize) -> State {
        self.starts[place]
    }

    /// Returns the next row after the current one has its records; empty after the last row.
    pub(super) fn next(&mut self, records: &(impl Records + ?Sized)) -> Vec<u32> {
        if self.done + 1 == self.rows {
            return Vec::new();
        }
        self.starts = self.row().into_iter().map(|id| followed(records.get(id as usize).as_ref())).collect();
        self.done += 1;
        self.row()
    }
}
