//! The event-driven reference as an engine: one cell per task on all processor cores.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rayon::prelude::*;
use web_time::Instant;

use super::flows::Flows;
use super::{LARGEST_BATCH, Properties, measured_record};
use crate::map::plan::{Cell, Plan};
use crate::record::Record;
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::measure_until;

/// Time after which a batch begins no more cells and returns those that have ended.
const BATCH_TIME: Duration = Duration::from_secs(2);

/// Cells under way per core at most. It bounds the memory for cells that take little time.
const MOST_PER_CORE: usize = 1 << 13;

/// Number in place of that of a cell that waits for the next batch. A map has fewer runs.
const LEFT: u32 = u32::MAX;

/// Returns the largest number of cells under way.
pub(crate) fn largest_batch(cores: usize) -> usize {
    LARGEST_BATCH.min(MOST_PER_CORE * cores)
}

/// The event-driven reference.
pub struct Cpu<'p> {
    plan: &'p Plan,
    flows: Flows<'p>,
    under_way: Vec<Cell>,
    /// Flag that stops the computation.
    halt: Arc<AtomicBool>,
}

impl<'p> Cpu<'p> {
    /// Builds an engine for the cells of a plan.
    pub fn new(plan: &'p Plan) -> Cpu<'p> {
        Cpu { plan, flows: Flows::new(plan), under_way: Vec::new(), halt: Arc::default() }
    }

    /// Computes all cells before it returns. The records have the order of the cells.
    pub fn compute(&self, cells: &[Cell]) -> Vec<Record> {
        // Nobody can raise the flag of this engine, so every cell has a record.
        cells.par_iter().with_max_len(1).map(|cell| self.cell(cell).unwrap_or_default()).collect()
    }

    pub(super) fn begin(&mut self, cells: &[Cell]) {
        self.under_way.extend(cells);
    }

    pub(super) fn advance(&mut self) -> Vec<(u32, Record)> {
        let cells = std::mem::take(&mut self.under_way);
        let clock = Instant::now();
        // Costs of cells differ by a factor of 1000, so each task has one cell. If many are slow, some wait for the
        // next call.
        let are_left = AtomicBool::new(false);
        let mut ended: Vec<(u32, Record)> = cells
            .par_iter()
            .with_max_len(1)
            .enumerate()
            .map(|(i, cell)| {
                let has_time = i == 0 || clock.elapsed() < BATCH_TIME;
                let record = has_time.then(|| self.cell(cell)).flatten();
                record.map_or_else(
                    || {
                        are_left.store(true, Ordering::Relaxed);
                        (LEFT, Record::default())
                    },
                    |record| (cell.id, record),
                )
            })
            .collect();
        self.flows.keep(&cells);
        // Records are large: none is read or moved if all cells have ended.
        if are_left.into_inner() {
            let left = cells.iter().zip(&ended).filter(|(_, (id, _))| *id == LEFT);
            self.under_way.extend(left.map(|(cell, _)| *cell));
            ended.retain(|(id, _)| *id != LEFT);
        }
        ended
    }

    /// Computes a cell; none if the flag is raised.
    fn cell(&self, cell: &Cell) -> Option<Record> {
        let (law, budget) = (self.plan.law(cell.law), self.plan.budget());
        let of = |flow: &Flow| measure_until(flow, law, cell.start, budget, &self.halt);
        self.flows.with(cell.flow, of).map(|measured| measured_record(&measured, self.plan.needs()))
    }
}

impl Properties for Cpu<'_> {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn device(&self) -> String {
        "event-driven reference".to_owned()
    }

    fn stop_on(&mut self, halt: &Arc<AtomicBool>) {
        self.halt = Arc::clone(halt);
    }

    fn least_batch(&self) -> usize {
        64 * rayon::current_num_threads()
    }

    fn largest_batch(&self) -> usize {
        largest_batch(rayon::current_num_threads())
    }
}
