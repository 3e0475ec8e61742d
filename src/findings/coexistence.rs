//! Coexistence: the number of attractors that the starts of a cell reach.
//!
//! Two periodic runs have one attractor if the last strobe state of one is on the cycle of the other, within a relative
//! distance of [`CYCLE_TOLERANCE`](crate::map::cycle::CYCLE_TOLERANCE), and if one period divides the other. Near a
//! period doubling, rounding can turn a period into a multiple. Newton's method finds the cycle that an unsettled run
//! approaches. Symmetry-conjugate orbits count as one attractor, because they always coexist after a symmetric cycle
//! has split. Contact-free motion is one attractor, even if a run has not reached it yet. All chaotic runs share one
//! attractor, because records do not distinguish chaotic attractors. Undecided and failed runs are ignored.
//!
//! The number is a lower bound, with one exception: a chaotic transient longer than the budget counts as chaos, in
//! addition to the cycle that it reaches later.

use rayon::prelude::*;

use crate::map::cycle::StrobeCycle;
use crate::map::engine::Flows;
use crate::map::plan::Plan;
use crate::record::classify::classify;
use crate::record::{Record, Records};
use rattlemap_dynamics::model::Law;
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::Class;

/// Counts the attractors of each cell, by id; returns none if every cell has one start.
///
/// # Panics
/// If the number of records is not that of the runs.
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
        let runs = runs.map(|run| records.record(run));
        flows.with(cell.flow, |flow| CellAttractors::count(flow, plan.law(cell.law), runs))
    };
    Some((0..cells).into_par_iter().map(count).collect())
}

/// Whether two periodic motions of a cell are one attractor.
pub(crate) fn is_one(flow: &Flow, law: Law, motions: [Record; 2]) -> bool {
    CellAttractors::count(flow, law, motions.into_iter()) == 1
}

/// Attractors of one cell.
struct CellAttractors {
    law: Law,
    chaos: bool,
    torus: bool,
    cycles: Vec<StrobeCycle>,
}

impl CellAttractors {
    /// Counts the attractors that runs of a cell reach.
    fn count(flow: &Flow, law: Law, runs: impl Iterator<Item = Record>) -> u8 {
        let mut found = CellAttractors { law, chaos: false, torus: false, cycles: Vec::new() };
        runs.for_each(|record| found.take(flow, &record));
        (found.cycles.len() + usize::from(found.chaos) + usize::from(found.torus)) as u8
    }

    fn take(&mut self, flow: &Flow, record: &Record) {
        match classify(record) {
            Class::Chaotic => self.chaos = true,
            Class::QuasiPeriodic => self.torus = true,
            Class::Periodic { period } if record.strobe().iter().all(|x| x.is_finite()) => {
                if self.cycles.iter().any(|cycle| cycle.passes(flow, &record.strobe(), period)) {
                    return;
                }
                let other = StrobeCycle::from(flow, self.law, record.strobe(), period);
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
