//! Elastic walls: the state is continuous there.
//!
//! On the wall both vector fields differ only by the damper `c` behind it, `f+ - f- = -(c w) M^-1 g`. In the
//! saltation matrix `w` cancels: it is `S = I - c M^-1 g n^T` on the way in and `S = I + c M^-1 g n^T` on the way
//! out, exactly and at any speed. So a crossing of an elastic wall is never too near to grazing, and without a damper
//! the strobe map is continuously differentiable there.

use super::PairMotion;
use crate::model::Side;
use crate::motion::{EventKind, Observer};
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
        self.jump_at_wall(side, -1.0);
        self.record(EventKind::MeshStart, side, self.q, observer);
        self.start_meshing(side, 0.0);
        if closing > 0.0 {
            self.from_wall = Some((side, 1));
        }
    }

    /// Processes motion that reaches an elastic wall from behind.
    #[inline(never)]
    pub(super) fn come_out(&mut self, side: Side, observer: &mut impl Observer) {
        self.q[0] = self.flow.wall(side);
        if self.q[1] == 0.0 && self.presses(DomainKind::Meshing(side), side, &self.q) {
            self.from_wall = Some((side, self.rest_order(DomainKind::Meshing(side))));
            return;
        }
        self.jump_at_wall(side, 1.0);
        self.record(EventKind::MeshEnd, side, self.q, observer);
        self.leave(side);
    }

    /// Applies `S u = u + sign c M^-1 g (n . u)` to every tangent vector.
    fn jump_at_wall(&mut self, side: Side, sign: f64) {
        let [on_gap, on_other] = self.flow.dampers[side.index()].map(|damper| sign * damper);
        self.tangents = self.tangents.map(|[z, w, x, v]| [z, w + on_gap * z, x, v + on_other * z]);
    }
}
