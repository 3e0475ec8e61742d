//! An engine without physics.

use super::EngineError;
use crate::plan::{Batch, Cell};
use crate::record::Record;

/// Makes records by a rule, has as much memory as it is told, and is lost when it is told.
pub struct Fake {
    /// The record of a cell.
    pub rule: fn(&Cell) -> Record,
    /// Batches it computes before it is lost; none means that it never is.
    pub batches_left: Option<usize>,
    /// Most cells of a batch that it has memory for.
    pub memory_cells: usize,
}

impl Fake {
    /// An engine that never fails.
    pub fn new(rule: fn(&Cell) -> Record) -> Fake {
        Fake { rule, batches_left: None, memory_cells: usize::MAX }
    }

    pub(super) fn run(&mut self, batch: &Batch) -> Result<Vec<Record>, EngineError> {
        let (device, cells) = ("fake".to_owned(), batch.cells.len());
        if cells > self.memory_cells {
            return Err(EngineError::OutOfMemory { device, cells });
        }
        match &mut self.batches_left {
            Some(0) => return Err(EngineError::Lost { device, reason: "as it was told".to_owned() }),
            Some(left) => *left -= 1,
            None => {}
        }
        Ok(batch.cells.iter().map(self.rule).collect())
    }
}
