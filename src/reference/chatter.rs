//! Infinite chatter: the whole series of ever smaller impacts in one jump.

use super::{EventKind, Observer, Trajectory};
use crate::flow::{DomainKind, Gap, LinearFlow, Phasor};
use crate::model::Side;

/// A series is closed once its whole duration, in units of the fastest rate of free
/// motion, is this short: what the closed form leaves out is of third order in it.
const CLOSING_DURATION: f64 = 1e-4;

/// A threshold below this, relative to the walls' distance and the rate of free motion, is
/// none: the series is infinite for all that f64 can tell.
const NO_THRESHOLD: f64 = 1e-10;

/// Motion with the gap held closed: the wall takes up the relative acceleration.
struct Sliding {
    /// Relative acceleration that the wall takes up, and its rate of change.
    acceleration: f64,
    acceleration_rate: f64,
    /// Acceleration of the second displacement.
    v_rate: f64,
    /// Damping of the relative motion at fixed momentum.
    damping: f64,
}

impl Sliding {
    fn new(free: &LinearFlow, closed: &Gap, phasor: &Phasor, omega: f64, kick: f64) -> Sliding {
        let row = free.acceleration_row();
        let [_, acceleration, _, v_free] = free.field(closed, phasor);
        let v_rate = v_free + kick * acceleration;
        let forcing = omega * (row[5] * phasor[0] - row[4] * phasor[1]);
        Sliding {
            acceleration,
            acceleration_rate: row[2] * closed[3] + row[3] * v_rate + forcing,
            v_rate,
            damping: kick * row[3] - row[1],
        }
    }
}

impl<const N: usize> Trajectory<'_, N> {
    /// Closes an infinite series of impacts (`mesh_speed = 0`, or so small that it makes no
    /// difference; `0 < e < 1`): one jump to the moment at which the gap rests on the wall and meshing starts.
    ///
    /// With the leaving speed `u`, the pressing acceleration `G`, its rate of change `J`
    /// while the gap stays closed, and the relative damping `gamma`, the series lasts
    /// `T0 (1 - J T0 / (3 G) - gamma T0 / 6)`, `T0 = 2 u / (G (1 - e))`, up to third order.
    /// Meanwhile the centre of mass moves as it does with the gap closed.
    pub(super) fn close_chatter(&mut self, side: Side, leaving: f64, observer: &mut impl Observer) {
        let e = self.law.restitution;
        if self.law.mesh_speed > NO_THRESHOLD * self.flow.speed || leaving == 0.0 || e >= 1.0 {
            return;
        }
        let (flow, kick) = (self.flow, self.flow.kick);
        let free = flow.domain(DomainKind::Free);
        let [z, w, x, v] = self.q;
        let closed = [z, 0.0, x, v + kick * w];
        let sliding = Sliding::new(free, &closed, &self.phasor, flow.omega, kick);
        let pressing = side.sign() * sliding.acceleration;
        let whole = 2.0 * leaving / (pressing * (1.0 - e));
        if !(pressing > 0.0 && whole < CLOSING_DURATION * free.unit) {
            return;
        }
        let bend = side.sign() * sliding.acceleration_rate / (3.0 * pressing) + sliding.damping / 6.0;
        let duration = whole * (1.0 - bend * whole);
        // A series cut by the strobe goes on bouncing until it lies within one stretch.
        if duration <= 0.0 || duration >= self.clock.remaining(self.goal) {
            return;
        }
        let v = closed[3];
        self.q =
            [z, 0.0, x + duration * (v + 0.5 * duration * sliding.v_rate), v + duration * sliding.v_rate];
        let s = side.sign();
        self.tangents = self.tangents.map(|u| {
            // A neighbour leaves at another time and speed, so its series ends `late`; until
            // then it misses the pressing acceleration. Momentum is the same either way.
            let late = -s * (2.0 * u[1] / pressing + (1.0 + e) * u[0] / leaving) / (1.0 - e);
            let behind = -s * pressing * late;
            [0.0, behind, u[2] + kick * u[0], u[3] + kick * (u[1] - behind)]
        });
        self.clock.advance(duration);
        let (sin, cos) = (flow.omega * self.clock.time()).sin_cos();
        self.phasor = [cos, sin];
        let before = self.q;
        self.brief = false;
        self.record(EventKind::MeshStart, side, before, observer);
        self.start_meshing(side, 0.0);
    }
}
