//! A cycle given by its states at phase 0 and half a period later, computed by the reference.

use crate::record::distance::{apart, farther};
use rattlemap_dynamics::model::{Law, STATE, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{Stop, Trajectory};
use rattlemap_dynamics::stability::{StrobeMap, refine};

/// Relative distance within which a state belongs to a cycle. Engines confirm a period at this distance if the motion
/// approaches its cycle slowly.
pub const CYCLE_TOLERANCE: f64 = 3e-2;

/// Relative distance within which a cycle found by Newton's method is the one that a run approaches. It is twice as
/// large because engines measure distances relative to the whole motion.
const REFINEMENT_TOLERANCE: f64 = 2.0 * CYCLE_TOLERANCE;

/// A periodic motion.
#[derive(Clone, Debug)]
pub(crate) struct StrobeCycle {
    pub(crate) period: u32,
    /// Strobe states: the first, and one after each period.
    pub(crate) points: Vec<State>,
    /// States half a period after each strobe state.
    pub(crate) halves: Vec<State>,
    /// The state one cycle after the first strobe state.
    pub(crate) last: State,
    pub(crate) is_non_impacting: bool,
    /// Whether the mirror image of each motion is a motion, half a period later.
    pub(crate) mirrors: bool,
}

impl StrobeCycle {
    /// Returns the cycle that a run approaches, found by Newton's method; without success the motion from its last
    /// state.
    pub(crate) fn from(flow: &Flow, law: Law, strobe: State, period: u32) -> StrobeCycle {
        StrobeCycle::refined(flow, law, strobe, period)
            .unwrap_or_else(|| StrobeCycle::through(flow, law, strobe, period))
    }

    /// Returns the stable cycle near a state, if Newton's method finds one.
    pub(crate) fn refined(flow: &Flow, law: Law, strobe: State, period: u32) -> Option<StrobeCycle> {
        let cycle = refine(&Trajectory::new(flow, law, strobe), StrobeMap::Periods(period))?;
        let is_its_own =
            StrobeCycle::at(strobe, period).distance(flow, &cycle.state, &strobe) < REFINEMENT_TOLERANCE;
        (cycle.is_stable() && is_its_own).then(|| StrobeCycle::through(flow, law, cycle.state, period))
    }

    /// Follows the motion from a state for `period` periods.
    pub(crate) fn through(flow: &Flow, law: Law, state: State, period: u32) -> StrobeCycle {
        let mut cycle =
            StrobeCycle { mirrors: flow.mirror_symmetric(&law), ..StrobeCycle::at(state, period) };
        // If the reference stops early, the cycle is described by the states so far.
        let _: Result<(), Stop> = cycle.run(flow, law);
        cycle
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

    /// Returns the strobe states of the symmetry-conjugate orbit.
    fn mirrored(&self) -> impl Iterator<Item = State> {
        let halves: &[State] = if self.mirrors { &self.halves } else { &[] };
        halves.iter().map(|half| half.map(|x| -x))
    }

    /// Whether the cycle, or its symmetry-conjugate orbit, passes through a state of a cycle of `period`.
    pub(crate) fn passes(&self, flow: &Flow, state: &State, period: u32) -> bool {
        let is_close = |point: State| self.distance(flow, &point, state) < CYCLE_TOLERANCE;
        self.is_related(period)
            && (self.points.iter().copied().any(is_close) || self.mirrored().any(is_close))
    }

    /// Whether one period divides the other. Near a period doubling, rounding can turn a period into a multiple.
    pub(crate) fn is_related(&self, period: u32) -> bool {
        self.period.is_multiple_of(period) || period.is_multiple_of(self.period)
    }

    /// Returns the units of displacements and velocities: the largest of the motion, but at least the scale of length
    /// and the corresponding velocity.
    pub(crate) fn units(&self, flow: &Flow) -> [f64; 2] {
        let all = || self.points.iter().copied().chain(self.mirrored());
        let largest = |from: usize| {
            let entries = all().flat_map(|y| (from..STATE).step_by(2).map(move |i| y[i].abs()));
            entries.fold(0.0, f64::max)
        };
        let position = largest(0).max(flow.length);
        [position, largest(1).max(flow.omega * position)]
    }

    /// Returns the distance of two states in the units of the cycle.
    pub(crate) fn distance(&self, flow: &Flow, a: &State, b: &State) -> f64 {
        distance(self.units(flow), a, b)
    }
}

/// Returns the largest difference of the components of two states, in units of displacement and velocity.
pub(crate) fn distance(units: [f64; 2], a: &State, b: &State) -> f64 {
    (0..STATE).map(|i| apart(a[i], b[i]) / units[i % 2]).fold(0.0, farther)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::{GearPair, state};

    #[test]
    fn a_state_with_nan_or_infinity_is_on_no_cycle() {
        let flow = Flow::new(&GearPair::paper(0.5).oscillator().unwrap());
        let through = |point: State| StrobeCycle::at(point, 1);
        let state = state(&[0.1, 0.2, -0.1, 0.3]);
        assert!(through(state).passes(&flow, &state, 1));
        for i in 0..4 {
            for value in [f64::NAN, f64::INFINITY] {
                let mut broken = state;
                broken[i] = value;
                assert!(
                    !through(state).passes(&flow, &broken, 1) && !through(broken).passes(&flow, &state, 1)
                );
                assert!(!through(broken).passes(&flow, &broken, 1), "{i}: {value}");
            }
        }
    }
}
