//! The force of an elastic wall that only pushes.

use super::energy::EnergyBound;
use super::{Gap, LinearFlow, Phasor, Step};
use crate::model::{Contact, Domain, Pair, Side};
use crate::pair::certificate::Bernstein;

/// The signed force `N` of spring, damper and preload of a wall that only pushes, before it is limited to positive values.
///
/// ```text
/// N = stiffness s (z - wall) + damping s w + preload,   s = +1 right, -1 left
/// ```
///
/// Behind the wall, contact is closed while `N > 0`, and the force is the larger of `N` and 0. At `N = 0` the force is
/// continuous, so the vector field is continuous there, and tangents do not jump.
#[derive(Clone, Debug)]
pub(crate) struct PushingForce {
    sign: f64,
    wall: f64,
    stiffness: f64,
    damping: f64,
    preload: f64,
    /// Bounds on `z^(7)` in open and in closed contact.
    bounds: [EnergyBound; 2],
}

impl PushingForce {
    /// Builds the force of a wall, given the flows in front of it and behind it. Returns none if the wall may pull, or if it never pulls
    /// because it has neither a damper nor a preload.
    pub(super) fn new(oscillator: &Pair, side: Side, flows: [&LinearFlow; 2]) -> Option<PushingForce> {
        let [stiffness, damping] = oscillator.wall_stiffness_and_damping(side);
        let (wall, preload) = (oscillator.walls[side.index()], oscillator.preload(side));
        let is_pushing = wall.is_finite() && oscillator.contacts[side.index()] == Contact::Pushing;
        if !is_pushing || damping == 0.0 && preload == 0.0 {
            return None;
        }
        let bound =
            |flow: &LinearFlow, domain: &Domain| flow.energy_bound(oscillator, domain, oscillator.gap, 6);
        let bounds = [bound(flows[0], &oscillator.free), bound(flows[1], &oscillator.meshing[side.index()])];
        Some(PushingForce { sign: side.sign(), wall, stiffness, damping, preload, bounds })
    }

    /// Returns the force and its first two derivatives in the domain of a linear flow.
    pub(crate) fn rates(&self, linear: &LinearFlow, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        let [a, jerk, _] = linear.acceleration_rates(q, phasor);
        let of = |z: f64, w: f64| self.sign * (self.stiffness * z + self.damping * w);
        [of(q[0] - self.wall, q[1]) + self.preload, of(q[1], a), of(a, jerk)]
    }

    /// Returns the force over a step from a state, and the remainder of its quintic.
    pub(crate) fn ahead(
        &self,
        is_closed: bool,
        linear: &LinearFlow,
        step: &Step,
        q: &Gap,
        phasor: &Phasor,
    ) -> (Bernstein, f64) {
        let (end, later) = step.end(q, phasor);
        let force = Bernstein::new(self.rates(linear, q, phasor), self.rates(linear, &end, &later), step.h);
        let remainder = self.stiffness * linear.gap_bound.remainder(q, phasor, step.u)
            + self.damping * self.bounds[usize::from(is_closed)].remainder(q, phasor, step.u);
        (force, step.u6 * remainder)
    }
}
