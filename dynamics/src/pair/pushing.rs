//! Walls that only push: contact behind the wall is open while spring and damper would pull.
//!
//! The state alone determines whether contact is open. The force is continuous where contact opens and closes, so tangents do not jump
//! there.

use super::step_verdict::{Crossing, StepVerdict, first_of};
use super::{Mode, PairMotion};
use crate::model::Side;
use crate::motion::{EventKind, Observer};
use crate::pair::certificate::{Verdict, judge};
use crate::pair::flow::{DomainKind, Gap, LinearFlow, Phasor, Step};

impl<const N: usize> PairMotion<'_, N> {
    /// Returns the force of a pushing wall and its first two derivatives in a domain.
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

    /// Compares the crossing of a wall with the next change of sign of the wall's force.
    #[inline(never)]
    pub(super) fn earlier_of_force(
        &self,
        at_wall: StepVerdict,
        is_closed: bool,
        side: Side,
        linear: &LinearFlow,
        step: &Step,
    ) -> StepVerdict {
        let Some(force) = &self.flow.pushing[side.index()] else { return at_wall };
        let (sign, crossing) =
            if is_closed { (1.0, Crossing::ForceEnds(side)) } else { (-1.0, Crossing::ForceBegins(side)) };
        let (force, remainder) = force.ahead(is_closed, linear, step, &self.q, &self.phasor);
        let of_force = match judge(&force, 0.0, sign, self.from_force, remainder) {
            Verdict::Clear { roomy } => StepVerdict::Clear { roomy },
            Verdict::Crossing(bracket) => StepVerdict::Crossing(crossing, bracket),
            Verdict::Unclear => StepVerdict::Unclear,
        };
        first_of(at_wall, of_force)
    }

    /// Ends contact behind a wall that only pushes.
    #[inline(never)]
    pub(super) fn open(&mut self, side: Side, observer: &mut impl Observer) {
        self.record(EventKind::MeshEnd, side, self.q, observer);
        self.mode = Mode::Open(side);
        self.change_force(side, 0);
    }

    /// Begins contact behind a wall that only pushes.
    #[inline(never)]
    pub(super) fn close(&mut self, side: Side, observer: &mut impl Observer) {
        self.record(EventKind::MeshStart, side, self.q, observer);
        self.mode = Mode::Sustained(side);
        self.change_force(side, 1);
    }

    /// Prepares a flight that begins where the force of a wall has just changed its sign.
    fn change_force(&mut self, side: Side, slot: usize) {
        let linear = self.flow.domain(self.mode.domain());
        let levels = linear.levels;
        let rate = self.wall_force(side, linear, &self.q, &self.phasor)[1];
        self.level[slot] = self.level[slot].min(levels - 1);
        self.from_force = if rate == 0.0 { 2 } else { 1 };
    }

    /// Returns from open contact to the wall, and to free motion if the gap leaves the wall.
    #[inline(never)]
    pub(super) fn come_back(&mut self, side: Side, observer: &mut impl Observer) {
        self.q[0] = self.flow.wall(side);
        if side.sign() * self.q[1] < 0.0 {
            self.leave(side);
        } else {
            self.go_behind(side, observer);
        }
    }
}
