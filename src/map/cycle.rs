//! A cycle as the reference runs through it: where it passes at phase 0, and half a period later.

use crate::record::distance::{apart, farther};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, State};
use rattlemap_dynamics::reference::{Stop, Trajectory};
use rattlemap_dynamics::stability::{StrobeMap, refine};

/// States this close, relative to the motion's size, lie on the same cycle. Engines confirm a
/// period from as far away where the approach is slow.
pub const CYCLE_TOLERANCE: f64 = 3e-2;

/// And a cycle this close to a run's last state is the run's own: engines measure by the whole motion.
const REFINEMENT_TOLERANCE: f64 = 2.0 * CYCLE_TOLERANCE;

/// A cycle.
#[derive(Clone, Debug)]
pub(crate) struct StrobeCycle {
    pub(crate) period: u32,
    /// Its strobe states: the first, and one after every period.
    pub(crate) points: Vec<State>,
    /// Its states half a period after these.
    pub(crate) halves: Vec<State>,
    /// Where the motion is one cycle later.
    pub(crate) last: State,
    pub(crate) is_non_impacting: bool,
    /// Whether the mirror image of a motion is a motion.
    pub(crate) mirrors: bool,
}

impl StrobeCycle {
    /// The cycle that a run was on its way to, by Newton's method; the motion from its last state if that finds none.
    pub(crate) fn from(flow: &Flow, law: Law, strobe: State, period: u32) -> StrobeCycle {
        StrobeCycle::refined(flow, law, strobe, period)
            .unwrap_or_else(|| StrobeCycle::through(flow, law, strobe, period))
    }

    /// The stable cycle close by, if Newton's method finds one.
    pub(crate) fn refined(flow: &Flow, law: Law, strobe: State, period: u32) -> Option<StrobeCycle> {
        let cycle = refine(&Trajectory::new(flow, law, strobe), StrobeMap::Periods(period))?;
        let is_its_own =
            StrobeCycle::at(strobe, period).distance(flow, &cycle.state, &strobe) < REFINEMENT_TOLERANCE;
        (cycle.is_stable() && is_its_own).then(|| StrobeCycle::through(flow, law, cycle.state, period))
    }

    /// The motion from a state, for so many periods.
    pub(crate) fn through(flow: &Flow, law: Law, state: State, period: u32) -> StrobeCycle {
        let mut seen = StrobeCycle { mirrors: flow.mirror_symmetric(&law), ..StrobeCycle::at(state, period) };
        // A motion that stops here is known by the state that it had.
        let _: Result<(), Stop> = seen.run(flow, law);
        seen
    }

    fn at(state: State, period: u32) -> StrobeCycle {
        StrobeCycle {
            period,
            points: vec![state],
            halves: Vec::new(),
            last: state,
            is_non_impacting: false,
            mirrors: false,
        }
    }

    fn run(&mut self, flow: &Flow, law: Law) -> Result<(), Stop> {
        let mut trajectory = Trajectory::new(flow, law, self.last);
        for _ in 0..self.period {
            let mut half = trajectory.clone();
            half.advance_to(0.5 * flow.period, &mut ())?;
            trajectory.advance_period(&mut ())?;
            self.halves.push(half.state());
            self.points.push(trajectory.state());
        }
        self.last = trajectory.state();
        let is_certain = flow.non_impacting().is_some_and(|free| free.is_certain(self.last));
        self.is_non_impacting = is_certain && trajectory.meshing().is_none();
        Ok(())
    }

    /// Strobe states of its symmetry-conjugate orbit: the mirror image of a motion is a motion, half a period later.
    fn mirrored(&self) -> impl Iterator<Item = State> {
        let halves: &[State] = if self.mirrors { &self.halves } else { &[] };
        halves.iter().map(|half| half.map(|x| -x))
    }

    /// Whether it, or its symmetry-conjugate orbit, comes through a state of a cycle of `period`.
    pub(crate) fn passes(&self, flow: &Flow, state: &State, period: u32) -> bool {
        let is_close = |point: State| self.distance(flow, &point, state) < CYCLE_TOLERANCE;
        self.is_related(period)
            && (self.points.iter().copied().any(is_close) || self.mirrored().any(is_close))
    }

    /// Whether one period divides the other: at a flip, noise makes a multiple of a period.
    pub(crate) fn is_related(&self, period: u32) -> bool {
        self.period.is_multiple_of(period) || period.is_multiple_of(self.period)
    }

    /// What distances are relative to: the size of the motion, but not less than the scale of length and what that is
    /// as a velocity.
    pub(crate) fn units(&self, flow: &Flow) -> [f64; 2] {
        let all = || self.points.iter().copied().chain(self.mirrored());
        let largest = |i: usize, j: usize| all().flat_map(|y| [y[i].abs(), y[j].abs()]).fold(0.0, f64::max);
        let position = largest(0, 2).max(flow.length);
        [position, largest(1, 3).max(flow.omega * position)]
    }

    /// The distance of two states.
    pub(crate) fn distance(&self, flow: &Flow, a: &State, b: &State) -> f64 {
        distance(self.units(flow), a, b)
    }
}

/// The distance of two states in these units.
pub(crate) fn distance(units: [f64; 2], a: &State, b: &State) -> f64 {
    (0..4).map(|i| apart(a[i], b[i]) / units[i % 2]).fold(0.0, farther)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::GearPair;

    #[test]
    fn a_state_that_is_no_number_lies_on_no_cycle() {
        let flow = Flow::new(&GearPair::paper(0.5).oscillator().unwrap());
        let seen = |point: State| StrobeCycle::at(point, 1);
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
