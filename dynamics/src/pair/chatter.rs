//! Infinite chatter: one jump over a convergent series of impacts.

use super::PairMotion;
use crate::model::{Contact, Side};
use crate::motion::{CLOSING_ANGLE, EventKind, NO_THRESHOLD, Observer};
use crate::pair::flow::{DomainKind, Gap, LinearFlow, PairFunctional, Phasor, RADIUS};

/// Longest duration of a series that is replaced by its closed form, in Taylor steps of free motion. The error of the
/// closed form is of third order in the duration.
const CLOSING_DURATION: f64 = 1e-4;

const _: () = assert!(CLOSING_ANGLE == CLOSING_DURATION * RADIUS);

/// Motion with the gap closed, while the wall cancels the relative acceleration.
struct ClosedGap {
    /// Relative acceleration that the wall cancels, and its time derivative.
    acceleration: f64,
    acceleration_rate: f64,
    /// Derivatives of `acceleration` with respect to the second displacement and its rate.
    gradient: [f64; 2],
    /// Acceleration of the second displacement, its time derivative, and its derivatives with respect to that
    /// displacement and its rate.
    v_rate: f64,
    v_jerk: f64,
    v_gradient: [f64; 2],
    /// Damping of the relative motion at fixed momentum, and the damping force on the momentum by the gap's rate.
    damping: f64,
    drag: f64,
}

impl ClosedGap {
    fn new(free: &LinearFlow, closed: &Gap, phasor: &Phasor, omega: f64, kick: f64) -> ClosedGap {
        let row = free.acceleration_row();
        let second = free.second_acceleration_row();
        let shared = second.plus(kick, row);
        let [_, acceleration, _, v_free] = free.field(closed, phasor);
        let v_rate = v_free + kick * acceleration;
        let change = |row: &PairFunctional| {
            row.base[2] * closed[3] + row.base[3] * v_rate + row.forcing_rate(phasor, omega)
        };
        ClosedGap {
            acceleration,
            acceleration_rate: change(row),
            gradient: [row.base[2], row.base[3]],
            v_rate,
            v_jerk: change(&shared),
            v_gradient: [shared.base[2], shared.base[3]],
            damping: kick * row.base[3] - row.base[1],
            drag: shared.base[1] - kick * shared.base[3],
        }
    }
}

impl<const N: usize> PairMotion<'_, N> {
    /// Jumps over an infinite series of impacts (`mesh_speed` of about 0, `0 < e < 1`) to the instant at which the
    /// gap rests on the wall and meshing starts.
    ///
    /// With the leaving speed `u`, the pressing acceleration `G`, its time derivative `J` with the gap closed, and
    /// the relative damping `gamma`, the series lasts `T0 (1 - J T0 / (3 G) - gamma T0 / 6)`,
    /// `T0 = 2 u / (G (1 - e))`, up to third order. Meanwhile the centre of mass moves as with the gap closed.
    /// Tangents follow from these formulas, up to second order.
    pub(super) fn close_chatter(&mut self, side: Side, leaving: f64, observer: &mut impl Observer) {
        let e = self.law.restitution[side.index()];
        if self.law.mesh_speed[side.index()] > NO_THRESHOLD * self.flow.speed || leaving == 0.0 || e >= 1.0 {
            return;
        }
        let (flow, kick) = (self.flow, self.flow.kick);
        let free = flow.domain(DomainKind::Free);
        let [z, w, x, v] = self.q;
        let closed = [z, 0.0, x, v + kick * w];
        let sliding = ClosedGap::new(free, &closed, &self.phasor, flow.omega, kick);
        let pressing = side.sign() * sliding.acceleration;
        let whole = 2.0 * leaving / (pressing * (1.0 - e));
        if !(pressing > 0.0 && whole < CLOSING_DURATION * free.unit) {
            return;
        }
        let bend = side.sign() * sliding.acceleration_rate / (3.0 * pressing) + sliding.damping / 6.0;
        let duration = whole * (1.0 - bend * whole);
        // A series that the strobe would interrupt is not replaced: its impacts are computed one by one.
        if duration <= 0.0 || duration >= self.clock.remaining(self.goal) {
            return;
        }
        let v = closed[3];
        let ClosedGap { v_rate, v_jerk, gradient, v_gradient, .. } = sliding;
        let x = x + duration * (v + duration * (v_rate / 2.0 + duration * v_jerk / 6.0));
        self.q = [z, 0.0, x, v + duration * (v_rate + duration * v_jerk / 2.0)];
        let s = side.sign();
        let pressing_rate = s * sliding.acceleration_rate;
        let per_speed = (1.0 - 2.0 * bend * whole) * whole / leaving;
        let per_pressing =
            (1.0 - (pressing_rate / pressing + sliding.damping / 3.0) * whole) * whole / pressing;
        let pressing_at_end = pressing + duration * pressing_rate;
        let is_rigid = flow.contacts[side.index()] == Contact::Rigid;
        self.tangents = self.tangents.map(|[dz, dw, dx, dv]| {
            // A neighbouring motion leaves the wall later by `later`, at another speed and under another pressing acceleration, and its
            // series ends later by `late`. `behind` is the difference of the gaps' rates at the end of this series: 0 on a rigid wall,
            // where both motions come to rest.
            let (dx, dv) = (dx + kick * dz, dv + kick * dw);
            let later = s * dz / leaving;
            let leaves = -s * dw - (pressing + sliding.damping * leaving) * later;
            let presses = s * (gradient[0] * dx + gradient[1] * dv) + pressing_rate * later;
            let late = later + per_speed * leaves - per_pressing * presses;
            let behind = if is_rigid { 0.0 } else { -s * pressing_at_end * late };
            let dv_rate = v_gradient[0] * dx + v_gradient[1] * dv;
            [0.0, behind, dx + duration * dv, dv + duration * dv_rate - sliding.drag * dz - kick * behind]
        });
        self.clock.advance(duration);
        self.count_meshing(duration);
        let (sin, cos) = (flow.omega * self.clock.time()).sin_cos();
        self.phasor = [cos, sin];
        let before = self.q;
        self.short_flight = false;
        self.record_event(EventKind::MeshStart, side, before, true, observer);
        if is_rigid {
            self.rest_on(side);
        } else {
            self.start_meshing(side, 0.0);
        }
    }
}
