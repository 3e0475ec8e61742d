//! Landing on an event: the root of the event function on the exact flow.

use super::{Crossing, Observer, Stop, Trajectory};
use crate::certificate::Bracket;
use crate::flow::{Gap, LinearFlow, Phasor, add};

/// Evaluations of the exact flow allowed for one root; one or two are needed.
const ROOT_CAP: u32 = 60;

/// The last correction, in Taylor units, below which four terms of the local Taylor series
/// reach rounding: `(1.6 * 5e-4)^5 / 5! < 3e-18`.
const LAST_CORRECTION: f64 = 5e-4;

/// Largest share of the last correction that curvature may account for: reversion of the
/// series then leaves `14e-8`, and one Newton step squares that.
const LAST_CURL: f64 = 1e-2;

/// Where a root search ended.
struct Landing {
    /// Time of flight.
    s: f64,
    /// Part of it covered by the propagator, in Taylor units, and the rest, in time.
    u: f64,
    delta: f64,
    q: Gap,
    phasor: Phasor,
}

impl<const N: usize> Trajectory<'_, N> {
    /// Goes to the crossing of a step of `h` Taylor units, or to `until` if that comes first.
    #[inline(always)]
    pub(super) fn cross(
        &mut self,
        linear: &LinearFlow,
        h: f64,
        crossing: Crossing,
        bracket: Bracket,
        until: f64,
        observer: &mut impl Observer,
    ) -> Result<(), Stop> {
        let remaining = until - self.t;
        if bracket.guess * h * linear.unit > remaining {
            // Probably after `until`. It is if what lies there is still before the one root.
            let partial = linear.partial(remaining / linear.unit);
            let q = add(&self.q, &partial.increment(&self.q, &self.phasor));
            let phasor = partial.rotate(&self.phasor);
            if self.before(crossing, linear, &q, &phasor) {
                self.q = q;
                self.phasor = phasor;
                if N > 0 {
                    self.tangents = self.tangents.map(|u| partial.apply_tangent(&u));
                }
                self.count_meshing(remaining);
                self.from_wall = None;
                self.t = until;
                return Ok(());
            }
        }
        let landing = self.land(linear, h, crossing, bracket).ok_or(Stop::CapRoot)?;
        if landing.s > remaining {
            self.move_to(linear, remaining, until);
            return Ok(());
        }
        if N > 0 {
            let partial = linear.partial(landing.u);
            self.tangents =
                self.tangents.map(|u| linear.nudge_tangent(&partial.apply_tangent(&u), landing.delta));
        }
        self.q = landing.q;
        self.phasor = landing.phasor;
        self.t += landing.s;
        self.count_meshing(landing.s);
        self.from_wall = None;
        self.act(crossing, observer);
        self.check_events()
    }

    /// Whether a point lies clearly before a crossing, given that there is only one.
    #[inline(always)]
    fn before(&self, crossing: Crossing, linear: &LinearFlow, q: &Gap, phasor: &Phasor) -> bool {
        match crossing {
            Crossing::Contact(side) | Crossing::Emerge(side) => {
                side.sign() * (q[0] - self.flow.wall(side)) < 0.0
            }
            Crossing::MeshEnds(side) => side.sign() * (q[0] - self.flow.wall(side)) > 0.0,
            Crossing::PressingEnds(side) => side.sign() * linear.acceleration(q, phasor) > 0.0,
        }
    }

    /// The one root in a bracket, converged to rounding.
    ///
    /// The exact flow at the guess, with its first four derivatives, leaves a quartic in
    /// the correction; once that is below [`LAST_CORRECTION`] its own truncation is below
    /// rounding. The displacement from the start is summed by itself, so that a flight from
    /// the wall keeps its relative accuracy however short it is.
    #[inline(always)]
    fn land(&mut self, linear: &LinearFlow, h: f64, crossing: Crossing, bracket: Bracket) -> Option<Landing> {
        let (mut lo, mut hi) = (h * bracket.lo, h * bracket.hi);
        let mut u = h * bracket.guess;
        let offset = match crossing {
            Crossing::PressingEnds(_) => 0.0,
            Crossing::Contact(side) | Crossing::Emerge(side) | Crossing::MeshEnds(side) => {
                self.q[0] - self.flow.wall(side)
            }
        };
        for _ in 0..ROOT_CAP {
            self.work.root_iterations += 1;
            let partial = linear.partial(u);
            let moved = partial.increment(&self.q, &self.phasor);
            let q = add(&self.q, &moved);
            let phasor = partial.rotate(&self.phasor);
            let d = linear.derivatives(&q, &phasor);
            let series = match crossing {
                Crossing::PressingEnds(_) => [d[0][1], d[1][1], d[2][1] / 2.0, d[3][1] / 6.0, 0.0],
                _ => [offset + moved[0], q[1], d[0][1] / 2.0, d[1][1] / 6.0, d[2][1] / 24.0],
            };
            let (delta, curl) = nearby_root(&series);
            if delta.abs() <= LAST_CORRECTION * linear.unit && curl.abs() <= LAST_CURL {
                return Some(Landing {
                    s: u * linear.unit + delta,
                    u,
                    delta,
                    q: std::array::from_fn(|i| {
                        let tail = d[1][i] + delta / 3.0 * (d[2][i] + delta / 4.0 * d[3][i]);
                        q[i] + delta * (d[0][i] + delta / 2.0 * tail)
                    }),
                    phasor: turn(&phasor, self.flow.omega * delta),
                });
            }
            // The start's side of the root has the sign opposite to the slope's.
            if series[0] * series[1] < 0.0 {
                lo = u;
            } else {
                hi = u;
            }
            let next = u + delta / linear.unit;
            u = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        }
        None
    }
}

/// The root near 0 of `c0 + c1 x + ... + c4 x^4`, by reversion of the series and one Newton
/// step, with the share of it that is due to curvature.
#[inline(always)]
fn nearby_root(c: &[f64; 5]) -> (f64, f64) {
    let inverse = 1.0 / c[1];
    let first = -c[0] * inverse;
    let curl = c[2] * inverse * first;
    let twist = c[3] * inverse * first * first;
    let x = first * (1.0 - curl + (2.0 * curl * curl - twist) + 5.0 * curl * (twist - curl * curl));
    let value = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * c[4])));
    let slope = c[1] + x * (2.0 * c[2] + 3.0 * x * c[3]);
    (x - value / slope, curl)
}

/// Rotates a phasor by a small angle.
#[inline(always)]
fn turn(p: &Phasor, angle: f64) -> Phasor {
    let square = angle * angle;
    let less = square * (square / 24.0 - 0.5);
    let sin = angle * (1.0 - square / 6.0);
    [p[0] + (less * p[0] - sin * p[1]), p[1] + (sin * p[0] + less * p[1])]
}
