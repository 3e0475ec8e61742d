//! On how many attractors do the starts of a cell end?
//!
//! Runs that end in chaos count as one attractor together: nothing in a record tells two chaotic
//! attractors apart. Runs that end on a cycle are compared on the reference: two cycles are the
//! same if the last strobe state of one lies on the other, within [`SAME`] of the motion's size,
//! and one period divides the other (at a flip, noise makes a multiple of a period). Newton's method
//! shows where the cycle is that a run was still on its way to. Symmetry-conjugate
//! orbits count as one: where a symmetric cycle has split they always coexist, and that says nothing.
//! Contact-free motion is one attractor however far it still is from it. Runs that are undecided
//! or failed count for nothing.
//!
//! So the number is a lower bound, with one exception: a chaotic transient that outlives the
//! budget is called chaos, and counts beside the cycle that it ends on.

use rayon::prelude::*;

use crate::map::engine::Flows;
use crate::map::plan::Plan;
use crate::record::Record;
use crate::record::classify::classify;
use crate::record::distance::{apart, farther};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, State};
use rattlemap_dynamics::orbit::Class;
use rattlemap_dynamics::reference::{Stop, Trajectory};
use rattlemap_dynamics::stability::{StrobeMap, refine};

/// States this close, relative to the motion's size, lie on the same cycle. Engines confirm a
/// period from as far away where the approach is slow.
pub const SAME: f64 = 3e-2;

/// And a cycle this close to a run's last state is the run's own: engines measure by the whole motion.
const ITS_OWN: f64 = 2.0 * SAME;

/// Attractors found per cell, by id; none if every cell has one start.
///
/// # Panics
/// If there are not as many records as runs.
pub fn attractors(plan: &Plan, records: &[Record]) -> Option<Vec<u8>> {
    assert_eq!(plan.run_count(), records.len(), "one record per run");
    if plan.start_count() == 1 {
        return None;
    }
    let cells = plan.cell_count();
    let flows = Flows::new(plan);
    let count = |id: usize| {
        let runs = records[id..].iter().step_by(cells);
        let cell = plan.cell(id as u32);
        let mut found = Found::new(plan.law(cell.law));
        flows.with(cell.flow, |flow| runs.for_each(|record| found.take(flow, record)));
        found.count()
    };
    Some((0..cells).into_par_iter().map(count).collect())
}

/// The attractors of one cell.
struct Found {
    law: Law,
    chaos: bool,
    cycles: Vec<Seen>,
}

impl Found {
    fn new(law: Law) -> Found {
        Found { law, chaos: false, cycles: Vec::new() }
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
                let other = Seen::from(flow, self.law, record.strobe, period);
                let is_known = |cycle: &Seen| {
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

/// A cycle, as the reference runs through it.
struct Seen {
    period: u32,
    /// Its strobe states, and those of its symmetry-conjugate orbit.
    points: Vec<State>,
    /// Where the motion is one cycle later.
    last: State,
    is_non_impacting: bool,
}

impl Seen {
    fn from(flow: &Flow, law: Law, strobe: State, period: u32) -> Seen {
        let mut seen = Seen { period, points: vec![strobe], last: strobe, is_non_impacting: false };
        let cycle = refine(&Trajectory::new(flow, law, strobe), StrobeMap::Periods(period));
        if let Some(cycle) = cycle.filter(|cycle| cycle.is_stable())
            && seen.distance(flow, &cycle.state, &strobe) < ITS_OWN
        {
            (seen.points, seen.last) = (vec![cycle.state], cycle.state);
        }
        // A motion that stops here is known by the state that it had.
        let _: Result<(), Stop> = seen.run(flow, law);
        seen
    }

    fn run(&mut self, flow: &Flow, law: Law) -> Result<(), Stop> {
        let mut trajectory = Trajectory::new(flow, law, self.last);
        for _ in 0..self.period {
            // The mirror image of a motion is a motion, half a period later.
            let mut half = trajectory.clone();
            half.advance_to(0.5 * flow.period, &mut ())?;
            trajectory.advance_period(&mut ())?;
            if flow.mirror_symmetric(&law) {
                self.points.push(half.state().map(|x| -x));
            }
            self.points.push(trajectory.state());
        }
        self.last = trajectory.state();
        let is_certain = flow.non_impacting().is_some_and(|free| free.is_certain(self.last));
        self.is_non_impacting = is_certain && trajectory.meshing().is_none();
        Ok(())
    }

    /// Whether it, or its symmetry-conjugate orbit, comes through a state of a cycle of `period`.
    fn passes(&self, flow: &Flow, state: &State, period: u32) -> bool {
        let related = self.period.is_multiple_of(period) || period.is_multiple_of(self.period);
        related && self.points.iter().any(|point| self.distance(flow, point, state) < SAME)
    }

    /// The distance of two states relative to the size of the motion, but not to less than the
    /// scale of length and what that is as a velocity.
    fn distance(&self, flow: &Flow, a: &State, b: &State) -> f64 {
        let largest = |i: usize, j: usize| {
            self.points.iter().flat_map(|y| [y[i].abs(), y[j].abs()]).fold(0.0, f64::max)
        };
        let position = largest(0, 2).max(flow.length);
        let velocity = largest(1, 3).max(flow.omega * position);
        let units = [position, velocity];
        (0..4).map(|i| apart(a[i], b[i]) / units[i % 2]).fold(0.0, farther)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::GearPair;

    #[test]
    fn a_state_that_is_no_number_lies_on_no_cycle() {
        let flow = Flow::new(&GearPair::paper(0.5).oscillator().unwrap());
        let seen =
            |point: State| Seen { period: 1, points: vec![point], last: point, is_non_impacting: false };
        let state = [0.1, 0.2, -0.1, 0.3];
        assert!(seen(state).passes(&flow, &state, 1));
        for i in 0..4 {
            for value in [f64::NAN, f64::INFINITY] {
                let mut lost = state;
                lost[i] = value;
                assert!(!seen(state).passes(&flow, &lost, 1) && !seen(lost).passes(&flow, &state, 1));
                assert!(!seen(lost).passes(&flow, &lost, 1), "{i}: {value}");
            }
        }
    }
}
