//! Elastic walls: the state is continuous there.
//!
//! On the wall both vector fields differ only by the damper `c` behind it, `f+ - f- = -(c w) M^-1 g`. In the
//! saltation matrix `w` cancels: it is `S = I - c M^-1 g n^T` on the way in and `S = I + c M^-1 g n^T` on the way
//! out, exactly and at any speed. So a crossing of an elastic wall is never too near to grazing, and without a damper
//! the strobe map is continuously differentiable there.
//!
//! A preload `p` makes the force jump at the wall. In the saltation matrix `c + s p / w` then takes the place of `c`.

use super::{Mode, PairMotion, side_of};
use crate::model::Side;
use crate::motion::{EVENTS_PER_PERIOD_CAP, EventKind, GRAZING_SPEED, NO_SPEED, Observer};
use crate::pair::flow::DomainKind;

impl<const N: usize> PairMotion<'_, N> {
    /// Processes free motion that reaches an elastic wall. If the speed is zero, the gap's first nonzero derivative decides whether the
    /// motion continues behind the wall.
    #[inline(never)]
    pub(super) fn go_behind(&mut self, side: Side, observer: &mut impl Observer) {
        self.q[0] = self.flow.wall(side);
        let closing = side.sign() * self.q[1];
        let goes_on = closing > 0.0 || closing == 0.0 && self.presses(DomainKind::Free, side, &self.q);
        if !goes_on {
            self.leave(side);
            return;
        }
        if !self.closes(side) {
            self.mode = Mode::Open(side);
            self.from_wall = Some((side, if closing > 0.0 { 1 } else { self.rest_order(DomainKind::Free) }));
            self.start_from_force(side);
            return;
        }
        if closing == 0.0
            && self.flow.preloads[side.index()] != [0.0; 2]
            && !self.presses(DomainKind::Meshing(side), side, &self.q)
        {
            // Rest on the wall under a load below the preload is an infinite series of contacts.
            self.events_in_period = EVENTS_PER_PERIOD_CAP;
        }
        self.jump_at_wall(side, -1.0);
        if self.flow_continues(side) {
            self.pass(side, observer);
            return;
        }
        self.record(EventKind::MeshStart, side, self.q, observer);
        self.start_meshing(side, 0.0);
        self.start_from_force(side);
        if closing > 0.0 {
            self.from_wall = Some((side, 1));
        }
    }

    /// Processes motion that reaches an elastic wall from behind.
    #[inline(never)]
    pub(super) fn come_out(&mut self, side: Side, observer: &mut impl Observer) {
        self.q[0] = self.flow.wall(side);
        if self.is_open() {
            // Open contact exerts no force, so its end is no event.
            return if side.sign() * self.q[1] < 0.0 {
                self.leave(side)
            } else {
                self.go_behind(side, observer)
            };
        }
        if self.q[1] == 0.0 && self.presses(DomainKind::Meshing(side), side, &self.q) {
            self.from_wall = Some((side, self.rest_order(DomainKind::Meshing(side))));
            return;
        }
        self.jump_at_wall(side, 1.0);
        self.record(EventKind::MeshEnd, side, self.q, observer);
        self.leave(side);
    }

    /// Whether another interval lies behind a wall of the present one.
    fn flow_continues(&self, side: Side) -> bool {
        self.stage.has_interval(self.interval + side.sign() as i32)
    }

    /// Enters the interval behind a wall of the present one, from the inside or from the outside.
    fn pass(&mut self, side: Side, observer: &mut impl Observer) {
        let next = self.interval + side.sign() as i32;
        let outwards = next.abs() > self.interval.abs();
        let kind = if outwards { EventKind::MeshStart } else { EventKind::MeshEnd };
        let of = side_of(if outwards { next } else { self.interval });
        self.record_in(next, kind, of, self.q, false, observer);
        self.interval = next;
        self.flow = self.stage.interval(next);
        self.level[0] = self.level[0].min(self.flow.domain(DomainKind::Free).levels - 1);
        self.leave(side.mirrored());
    }

    /// Applies `S u = u + sign (c + s p / w) M^-1 g (n . u)` to every tangent vector.
    fn jump_at_wall(&mut self, side: Side, sign: f64) {
        let [mut on_gap, mut on_other] = self.flow.dampers[side.index()].map(|damper| sign * damper);
        let (preloads, rate) = (self.flow.preloads[side.index()], self.q[1]);
        if preloads != [0.0; 2] {
            self.near_grazing |= rate.abs() < GRAZING_SPEED * self.flow.speed;
            if rate.abs() >= NO_SPEED * self.flow.speed {
                on_gap += sign * preloads[0] / rate;
                on_other += sign * preloads[1] / rate;
            }
        }
        self.tangents = self.tangents.map(|[z, w, x, v]| [z, w + on_gap * z, x, v + on_other * z]);
    }
}
