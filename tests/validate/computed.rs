//! What the reference makes of a whole plan.

use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::record::Record;

/// Every record of a plan by the CPU engine, by id.
pub(crate) fn computed(plan: &Plan) -> Vec<Record> {
    let mut engine = Engine::Cpu(Cpu::new(plan));
    let cells = plan.cells(0..plan.cell_count());
    let mut records = vec![Record::default(); plan.cell_count()];
    for (cell, record) in cells.iter().zip(pollster::block_on(engine.run(&cells)).unwrap()) {
        records[cell.id as usize] = record;
    }
    records
}
