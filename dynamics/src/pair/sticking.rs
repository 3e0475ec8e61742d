//! Rigid walls: a pressed contact that has come to rest sticks until the load pulls it off.
//!
//! While it sticks, `z = wall` and `w = 0` exactly, and the other displacement follows the constrained motion
//! (`flow/constrained.rs`). The wall cancels the acceleration `p` of the gap. When `p` no longer points into the
//! wall, the gap leaves it, from rest and with zero acceleration. State and vector field are continuous there, so
//! tangents do not jump.

use super::{Mode, PairMotion, StepVerdict};
use crate::model::Side;
use crate::motion::{EventKind, Observer, Stop};
use crate::pair::flow::{DomainKind, Gap};

/// Order of the root of the distance when the gap leaves the wall: its acceleration is zero, the derivative of the
/// acceleration is not.
pub(super) const RELEASE_ORDER: usize = 3;

impl<const N: usize> PairMotion<'_, N> {
    /// Whether a contact with a rigid wall lasts: its leaving speed is low enough, and at rest it is pressed.
    pub(super) fn sticks(&self, side: Side) -> bool {
        let leaving = self.law.restitution[side.index()] * self.q[1].abs();
        let at_rest = self.at_rest_on(side);
        let kind = DomainKind::Meshing(side);
        leaving <= self.law.mesh_speed[side.index()] && self.presses(kind, side, &at_rest)
    }

    /// Returns the state after an impact that stops the gap.
    fn at_rest_on(&self, side: Side) -> Gap {
        let [_, w, x, v] = self.q;
        [self.flow.wall(side), 0.0, x, v + self.flow.kick * w]
    }

    /// Comes to rest on a rigid wall.
    ///
    /// Neighbouring motions reach the wall earlier or later and come to rest, too. The approach speed cancels in
    /// `S = R + (f+ - R f-) n^T / (n f-)`, where `R` is the impact that stops the gap. What remains is the
    /// displacement of the other coordinate, and its damping by the gap's velocity.
    #[inline(never)]
    pub(super) fn stick(&mut self, side: Side, observer: &mut impl Observer) {
        self.q[0] = self.flow.wall(side);
        let before = self.q;
        self.q = self.at_rest_on(side);
        if N > 0 {
            let kick = self.flow.kick;
            let meshing = self.flow.domain(DomainKind::Meshing(side));
            let row = meshing.second_acceleration_row().base;
            let drag = row[1] - kick * row[3];
            self.tangents =
                self.tangents.map(|[z, w, x, v]| [0.0, 0.0, x + kick * z, v + kick * w - drag * z]);
        }
        self.record(EventKind::MeshStart, side, before, observer);
        self.rest_on(side);
    }

    /// Sets the mode of rest on a rigid wall.
    pub(super) fn rest_on(&mut self, side: Side) {
        self.mode = Mode::Stuck(side);
        self.from_wall = None;
        self.short_flight = false;
        self.level[1] = self.flow.domain(DomainKind::Meshing(side)).taylor_level;
    }

    /// Takes one step at rest on a rigid wall, which ends if the pressing acceleration vanishes. The caller has
    /// counted the first trial.
    #[cold]
    #[inline(never)]
    pub(super) fn step_at_rest(&mut self, until: f64, observer: &mut impl Observer) -> Result<(), Stop> {
        let Mode::Stuck(side) = self.mode else { return Ok(()) };
        let linear = self.flow.domain(DomainKind::Meshing(side));
        let mut level = self.level[1];
        loop {
            let computed;
            let step = match linear.step(level) {
                Some(step) => step,
                None => {
                    computed = linear.new_step(level);
                    &computed
                }
            };
            match self.pressing_ahead(linear, step, side) {
                StepVerdict::Clear { roomy } => {
                    self.level[1] = level.saturating_sub(usize::from(roomy));
                    self.clear_step(linear, step, until);
                    return Ok(());
                }
                StepVerdict::Crossing(crossing, bracket) => {
                    self.level[1] = level;
                    return self.cross(linear, step.u, crossing, bracket, until, observer);
                }
                _ if self.settle_start(observer) => return self.check_events(),
                _ if level + 1 == linear.levels => {
                    self.check_finite()?;
                    self.check_bounds(linear)?;
                    self.settle_graze(linear, step.h, until, observer);
                    return self.check_events();
                }
                _ => {
                    self.work.halvings += 1;
                    self.work.steps += 1;
                    self.steps_in_period += 1;
                    level += 1;
                }
            }
        }
    }

    /// Starts at rest on a rigid wall.
    pub(super) fn stand_on(&mut self, side: Side) {
        self.rest_on(side);
        self.origin = Some(side);
        self.pending = None;
        [self.q[0], self.q[1]] = [self.flow.wall(side), 0.0];
        self.tangents = self.tangents.map(|[_, _, x, v]| [0.0, 0.0, x, v]);
    }

    /// Processes the release: the load pulls the gap off a rigid wall.
    #[inline(never)]
    pub(super) fn release(&mut self, side: Side, observer: &mut impl Observer) {
        self.record(EventKind::MeshEnd, side, self.q, observer);
        self.mode = Mode::Free;
        self.from_wall = Some((side, RELEASE_ORDER));
        // On a short step the gap would not move beyond rounding.
        self.level[0] = self.level[0].min(self.flow.domain(DomainKind::Free).taylor_level);
    }
}
