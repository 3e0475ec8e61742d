//! Walls that only push: contact behind the wall is open while spring and damper would pull.
//!
//! The state alone determines whether contact is open. The force is continuous where contact opens and closes, so tangents do not jump
//! there.

use super::step_verdict::{Crossing, StepVerdict};
use super::{Mode, PairMotion};
use crate::model::Side;
use crate::motion::{EventKind, Observer};
use crate::pair::certificate::{Verdict, judge};
use crate::pair::flow::{DomainKind, Gap, LinearFlow, Phasor, PushingForce, Step};

impl<const N: usize> PairMotion<'_, N> {
    /// Returns the force of a pushing wall and its first two derivatives in a domain.
    #[cold]
    #[inline(never)]
    pub(super) fn wall_force(&self, side: Side, linear: &LinearFlow, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        let force = self.flow.pushing[side.index()].as_deref();
        force.map_or([f64::INFINITY; 3], |force| force.rates(linear, q, phasor))
    }

    /// Whether contact with an elastic wall is closed for a gap on the wall or behind it: always, if the wall may pull. If the force is 0,
    /// its first nonzero derivative decides.
    pub(super) fn closes(&self, side: Side) -> bool {
        let Some(force) = &self.flow.pushing[side.index()] else { return true };
        let rates = force.rates(self.flow.domain(DomainKind::Free), &self.q, &self.phasor);
        rates.into_iter().find(|&rate| rate != 0.0).is_some_and(|rate| rate > 0.0)
    }

    /// Records the order of the root if the force of a pushing wall is 0 at the start of a flight.
    pub(super) fn start_from_force(&mut self, side: Side) {
        let linear = self.flow.domain(self.mode.domain());
        let [force, rate, _] = self.wall_force(side, linear, &self.q, &self.phasor);
        self.from_force = match (force == 0.0, rate == 0.0) {
            (false, _) => 0,
            (true, false) => 1,
            (true, true) => 2,
        };
    }

    /// Checks whether the force of a pushing wall changes its sign.
    #[cold]
    #[inline(never)]
    pub(super) fn force_ahead(
        &self,
        force: &PushingForce,
        linear: &LinearFlow,
        step: &Step,
        side: Side,
    ) -> StepVerdict {
        let (force, remainder) = force.ahead(!self.is_open(), linear, step, &self.q, &self.phasor);
        let sign = if self.is_open() { -1.0 } else { 1.0 };
        match judge(&force, 0.0, sign, self.from_force, remainder) {
            Verdict::Clear { roomy } => StepVerdict::Clear { roomy },
            Verdict::Crossing(bracket) => StepVerdict::Crossing(Crossing::ForceChanges(side), bracket),
            Verdict::Unclear => StepVerdict::Unclear,
        }
    }

    /// Whether contact is open.
    pub(super) fn is_open(&self) -> bool {
        matches!(self.mode, Mode::Open(_))
    }

    /// Ends or begins contact behind a wall that only pushes.
    #[inline(never)]
    pub(super) fn change_force(&mut self, side: Side, observer: &mut impl Observer) {
        let (kind, mode) = if self.is_open() {
            (EventKind::MeshStart, Mode::Sustained(side))
        } else {
            (EventKind::MeshEnd, Mode::Open(side))
        };
        self.record(kind, side, self.q, observer);
        self.mode = mode;
        let linear = self.flow.domain(mode.domain());
        let levels = linear.levels;
        let rate = self.wall_force(side, linear, &self.q, &self.phasor)[1];
        let slot = usize::from(!self.is_open());
        self.level[slot] = self.level[slot].min(levels - 1);
        self.from_force = if rate == 0.0 { 2 } else { 1 };
    }
}
