//! On how many attractors do the starts of a cell end?
//!
//! Runs that end in chaos count as one attractor together: nothing in a record tells two chaotic
//! attractors apart. Runs that end on a cycle are compared on the reference: two cycles are the
//! same if the last strobe state of one lies on the other, within [`CYCLE_TOLERANCE`] of the motion's size,
//! and one period divides the other (at a flip, noise makes a multiple of a period). Newton's method
//! shows where the cycle is that a run was still on its way to. Symmetry-conjugate
//! orbits count as one: where a symmetric cycle has split they always coexist, and that says nothing.
//! Contact-free motion is one attractor however far it still is from it. Runs that are undecided
//! or failed count for nothing.
//!
//! So the number is a lower bound, with one exception: a chaotic transient that outlives the
//! budget is called chaos, and counts beside the cycle that it ends on.

use rayon::prelude::*;

use crate::map::cycle::StrobeCycle;
use crate::map::engine::Flows;
use crate::map::plan::Plan;
use crate::record::classify::classify;
use crate::record::{Record, Records};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::Law;
use rattlemap_dynamics::orbit::Class;

pub use crate::map::cycle::CYCLE_TOLERANCE;

/// Attractors found per cell, by id; none if every cell has one start.
///
/// # Panics
/// If there are not as many records as runs.
pub fn attractors(plan: &Plan, records: &(impl Records + ?Sized)) -> Option<Vec<u8>> {
    assert_eq!(plan.run_count(), records.count(), "one record per run");
    if plan.start_count() == 1 {
        return None;
    }
    let cells = plan.cell_count();
    let flows = Flows::new(plan);
    let count = |id: usize| {
        let runs = (id..records.count()).step_by(cells);
        let cell = plan.cell(id as u32);
        let mut found = CellAttractors::new(plan.law(cell.law));
        flows.with(cell.flow, |flow| runs.for_each(|run| found.take(flow, &records.record(run))));
        found.count()
    };
    Some((0..cells).into_par_iter().map(count).collect())
}

/// The attractors of one cell.
struct CellAttractors {
    law: Law,
    chaos: bool,
    cycles: Vec<StrobeCycle>,
}

impl CellAttractors {
    fn new(law: Law) -> CellAttractors {
        CellAttractors { law, chaos: false, cycles: Vec::new() }
    }

    fn count(&self) -> u8 {
        (self.cycles.len() + usize::from(self.chaos)) as u8
    }

    fn take(&mut self, flow: &Flow, record: &Record) {
        match classify(record) {
            Class::Chaotic => self.chaos = true,
            Class::Periodic { period } if record.strobe.iter().all(|x| x.is_finite()) => {
                if self.cycles.iter().any(|cycle| cycle.passes(flow, &record.strobe, period)) {
                    return;
                }
                let other = StrobeCycle::from(flow, self.law, record.strobe, period);
                let is_known = |cycle: &StrobeCycle| {
                    cycle.is_non_impacting && other.is_non_impacting
                        || cycle.passes(flow, &other.last, period)
                };
                if !self.cycles.iter().any(is_known) {
                    self.cycles.push(other);
                }
            }
            Class::Periodic { .. } | Class::Undecided | Class::Failed => {}
        }
    }
}
