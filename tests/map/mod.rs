//! Tests of maps: plans, schedules, engines, starts, basins.

use std::sync::Arc;

use rattlemap::map::engine::Engine;
use rattlemap::map::plan::Plan;
use rattlemap::map::schedule::Schedule;
use rattlemap::map::sweep::{self, SweepError};
use rattlemap::record::Record;

mod audit;
mod axes;
mod basins;
mod models;
mod phase;
mod runs;
mod shares;
mod starts;

/// A map computed by a sweep, or the part before an error.
struct Swept {
    end: Result<bool, SweepError>,
    schedule: Schedule,
    records: Vec<Record>,
    /// Ids of the computed runs, in order.
    stored: Vec<u32>,
}

/// Continues a map after the records of `before`.
fn swept(plan: &Plan, engine: &mut Engine<'_>, before: &[(u32, Record)]) -> Swept {
    let (mut schedule, mut stored) = (Schedule::new(plan), Vec::new());
    let mut records = vec![Record::default(); plan.run_count()];
    assert!(sweep::replay(&mut schedule, &mut records, before));
    let store = |batch: Vec<(u32, Record)>, expected: usize| {
        assert!(expected <= plan.run_count());
        stored.extend(batch.iter().map(|(id, _)| *id));
        Ok(())
    };
    let halt = Arc::default();
    let end = pollster::block_on(sweep::run(plan, &mut schedule, engine, &mut records, &halt, store));
    Swept { end, schedule, records, stored }
}

/// Computes the first run of every cell, in batches of `size`.
fn computed(plan: &Plan, engine: &mut Engine<'_>, size: usize) -> Vec<Record> {
    let mut records = vec![Record::default(); plan.cell_count()];
    for from in (0..records.len()).step_by(size) {
        let cells = plan.cells(from..records.len().min(from + size));
        let batch = pollster::block_on(engine.run(&cells)).unwrap();
        assert_eq!(batch.len(), cells.len());
        cells.iter().zip(batch).for_each(|(cell, record)| records[cell.id as usize] = record);
    }
    records
}
