//! Comparison of states at a phase far from events, for a motion with an event at phase 0.
//!
//! Rounding puts an event at phase 0 before or after the strobe. An impact changes the velocity there, so that strobe
//! states alternate between both sides of the jump. States at another phase have no jump nearby, and the class, the
//! period, the word and the multipliers do not depend on the phase.

use std::f64::consts::TAU;

use super::instant::after_events;
use super::quantities::Quantities;
use super::reading::{EventLog, ON_STROBE_TURNS};
use crate::model::{Law, Side, State};
use crate::motion::Flow;
use crate::motion::{Allowance, Trajectory};

/// States are compared at half a turn if no event is nearer to it than this, in turns. Half a turn adds no sine to the force.
const CLEARANCE: f64 = 1.0 / 16.0;

/// A phase far from the events of a motion, and the motion's state there.
#[derive(Clone, Debug)]
pub(super) struct Section {
    /// The flow whose phase 0 is this phase.
    pub(super) flow: Box<Flow>,
    /// The state of the motion at this phase.
    pub(super) start: State,
    /// The phase, in turns.
    turns: f64,
}

impl Section {
    /// Finds the phase from the events of the `periods` forcing periods that follow the state `strobe` at phase 0; none
    /// if the motion cannot be continued, or if the state at the phase does not determine the kind of contact.
    pub(super) fn of(
        flow: &Flow,
        law: Law,
        strobe: State,
        periods: u32,
        allowance: Allowance<'_>,
    ) -> Option<Section> {
        let mut trajectory = Trajectory::<0>::new(flow, law, flow.in_front(strobe)).allowing(allowance);
        let mut log = EventLog::new(flow, 0);
        for _ in 0..periods {
            trajectory.advance_period(&mut log).ok()?;
        }
        let mut phases: Vec<f64> = log.events.iter().map(|event| event.t_mod_period / flow.period).collect();
        phases.extend([0.0, 1.0]);
        phases.sort_by(f64::total_cmp);
        let is_half_clear = phases.iter().all(|phase| (phase - 0.5).abs() >= CLEARANCE);
        let widest = || phases.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        let turns = if is_half_clear { 0.5 } else { widest().map(|gap| 0.5 * (gap[0] + gap[1]))? };
        trajectory.advance_to(turns * flow.period, &mut ()).ok()?;
        let (section, start) = (Box::new(flow.at_phase(turns)), trajectory.state());
        let is_determined = Trajectory::<0>::new(&section, law, start).meshing() == trajectory.meshing();
        is_determined.then_some(Section { flow: section, start, turns })
    }

    /// Converts a state at this phase to the state at the next phase 0. Also returns the wall of the lasting contact there. If an event
    /// lies within `tolerance` turns of phase 0, the state is that after the event.
    pub(super) fn strobe(&self, law: Law, state: State, tolerance: f64) -> Option<(State, Option<Side>)> {
        let mut trajectory = Trajectory::<0>::new(&self.flow, law, state);
        trajectory.advance_to(self.time_to_strobe(), &mut ()).ok()?;
        let (state, meshing) = after_events(&trajectory, tolerance * self.flow.period);
        Some((self.flow.rigid_modes.shifted_back(state), meshing))
    }

    /// Converts quantities whose time begins at this phase to times since phase 0.
    pub(super) fn quantities(&self, mut quantities: Quantities) -> Quantities {
        for displacement in &mut quantities.displacements {
            let turned = displacement.harmonic[1] - self.turns * TAU;
            displacement.harmonic[1] = turned.sin().atan2(turned.cos());
        }
        quantities
    }

    /// Converts the events of a cycle of `periods` forcing periods, whose times begin at this phase, to times since the next phase 0. An
    /// event at phase 0 ends the cycle, because the strobe is the state after the event. `times` gives the time of an event in the cycle
    /// and since the last phase 0.
    pub(super) fn shifted<T: Clone>(
        &self,
        events: &[T],
        periods: u32,
        times: impl Fn(&mut T) -> [&mut f64; 2],
    ) -> Vec<T> {
        let period = self.flow.period;
        let cycle = f64::from(periods) * period;
        let rounding = ON_STROBE_TURNS * period;
        let mut list: Vec<T> = events.to_vec();
        for event in &mut list {
            let [time, t_mod_period] = times(event);
            let t = *time - self.time_to_strobe();
            let nearest = (t / period).round() * period;
            let t = if (t - nearest).abs() < rounding { nearest } else { t };
            *time = if t <= 0.0 { t + cycle } else { t };
            *t_mod_period = if t == nearest { 0.0 } else { *time % period };
        }
        list.sort_by(|a, b| times(&mut a.clone())[0].total_cmp(times(&mut b.clone())[0]));
        list
    }

    fn time_to_strobe(&self) -> f64 {
        (1.0 - self.turns) * self.flow.period
    }
}
