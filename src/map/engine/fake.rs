//! An engine without physics, for tests.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::{EngineError, Properties};
use crate::map::plan::Cell;
use crate::record::Record;

/// Computes records by a rule, with a chosen amount of memory and a chosen failure.
pub struct Fake {
    /// Computes the record of a cell.
    pub rule: fn(&Cell) -> Record,
    /// Number of calls of `advance` until a cell ends, at least one.
    pub advances: fn(&Cell) -> u32,
    /// Number of calls of `advance` before the engine is lost; none means never.
    pub advances_left: Option<usize>,
    /// Largest number of cells under way.
    pub memory_cells: usize,
    /// Cells under way, each with the number of calls of `advance` until it ends.
    under_way: Vec<(u32, Cell)>,
}

impl Fake {
    /// Builds an engine that never fails and computes every cell in one call.
    pub fn new(rule: fn(&Cell) -> Record) -> Fake {
        let under_way = Vec::new();
        Fake { rule, advances: |_| 1, advances_left: None, memory_cells: usize::MAX, under_way }
    }

    /// Builds an engine that is lost after `advances` calls of `advance`.
    pub fn lost_after(advances: usize, rule: fn(&Cell) -> Record) -> Fake {
        Fake { advances_left: Some(advances), ..Fake::new(rule) }
    }

    /// Builds an engine with memory for `memory_cells` cells.
    pub fn with_memory(memory_cells: usize, rule: fn(&Cell) -> Record) -> Fake {
        Fake { memory_cells, ..Fake::new(rule) }
    }

    /// Builds an engine that needs `advances(cell)` calls of `advance` for a cell.
    pub fn slow(advances: fn(&Cell) -> u32, rule: fn(&Cell) -> Record) -> Fake {
        Fake { advances, ..Fake::new(rule) }
    }

    pub(super) fn begin(&mut self, cells: &[Cell]) -> Result<(), EngineError> {
        let count = self.under_way.len() + cells.len();
        if count > self.memory_cells {
            return Err(EngineError::OutOfMemory { device: "fake".to_owned(), cells: count });
        }
        self.under_way.extend(cells.iter().map(|cell| ((self.advances)(cell).max(1), *cell)));
        Ok(())
    }

    pub(super) fn advance(&mut self) -> Result<Vec<(u32, Record)>, EngineError> {
        match &mut self.advances_left {
            Some(0) => {
                let (device, reason) = ("fake".to_owned(), "by request of the test".to_owned());
                return Err(EngineError::Lost { device, reason });
            }
            Some(left) => *left -= 1,
            None => {}
        }
        let passed = self.under_way.iter().map(|&(left, _)| left).min().unwrap_or(0);
        self.under_way.iter_mut().for_each(|(left, _)| *left -= passed);
        let ended: Vec<_> = self.under_way.extract_if(.., |&mut (left, _)| left == 0).collect();
        Ok(ended.iter().map(|(_, cell)| (cell.id, (self.rule)(cell))).collect())
    }
}

impl Properties for Fake {
    fn name(&self) -> &'static str {
        "fake"
    }

    fn device(&self) -> String {
        "fake".to_owned()
    }

    fn least_batch(&self) -> usize {
        16
    }

    fn stop_on(&mut self, _: &Arc<AtomicBool>) {}
}
