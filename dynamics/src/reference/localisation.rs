//! Event localisation: the root of the event function on the exact flow.

use super::{Crossing, Observer, Stop, Trajectory};
use crate::certificate::Bracket;
use crate::flow::{EXPANSION_REACH, Expansion, Gap, LinearFlow, Phasor, TERMS};
use crate::fused::fma;

/// Evaluations of the exact flow allowed for one root; one or two are needed, and bisection ends
/// after 110.
const ROOT_CAP: u32 = 120;

/// Newton's method may choose the next point so many times; then bisection does.
const NEWTON_CAP: u32 = 8;

/// A root this close to an end of its bracket, relatively, is there.
const ENDS: f64 = 4.0 * f64::EPSILON;

/// Newton steps allowed on one expansion.
const POLISH_CAP: u32 = 8;

/// The last correction may leave this much of the flight behind.
const LEFT: f64 = 1e-17;

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
        let remaining = self.clock.remaining(until);
        if bracket.guess * h * linear.unit > remaining {
            // Probably after `until`. It is if what lies there is still before the one root.
            let u = remaining * linear.per_unit;
            let expansion = linear.grid.expansion(&self.q, &self.phasor, u);
            let v = u - expansion.start;
            if self.before(crossing, linear, &expansion.state(v), &expansion.phasor(linear.turn * v)) {
                self.arrive(linear, &expansion, u);
                self.count_meshing(remaining);
                self.from_wall = None;
                self.clock.set(until);
                return Ok(());
            }
        }
        let (expansion, u) = self.locate(linear, h, crossing, bracket).ok_or(Stop::CapRoot)?;
        let s = u * linear.unit;
        if s > remaining {
            self.move_to(linear, remaining, until);
            return Ok(());
        }
        self.arrive(linear, &expansion, u);
        self.clock.advance(s);
        self.count_meshing(s);
        self.from_wall = None;
        self.act(crossing, observer);
        self.check_events()
    }

    /// Whether a point lies clearly before a crossing, given that there is only one.
    #[inline(always)]
    fn before(&self, crossing: Crossing, linear: &LinearFlow, q: &Gap, phasor: &Phasor) -> bool {
        match crossing {
            Crossing::Contact(side) | Crossing::OnsetEnds(side) => {
                side.sign() * (q[0] - self.flow.wall(side)) < 0.0
            }
            Crossing::MeshEnds(side) => side.sign() * (q[0] - self.flow.wall(side)) > 0.0,
            Crossing::Through(side) => side.sign() * (q[0] - self.flow.wall(side.mirrored())) > 0.0,
            Crossing::PressingEnds(side) => side.sign() * linear.acceleration(q, phasor) > 0.0,
        }
    }

    /// The one root in a bracket, converged to rounding: an expansion near it, and its instant in
    /// Taylor steps from here.
    ///
    /// What is added to the gap is summed by itself, so that a flight from the wall keeps its
    /// relative accuracy however short it is.
    #[inline(always)]
    fn locate(
        &mut self,
        linear: &LinearFlow,
        h: f64,
        crossing: Crossing,
        bracket: Bracket,
    ) -> Option<(Expansion, f64)> {
        let (mut lo, mut hi) = (h * bracket.lo, h * bracket.hi);
        let mut u = h * bracket.guess;
        for n in 0..ROOT_CAP {
            self.work.root_iterations += 1;
            let expansion = linear.grid.expansion(&self.q, &self.phasor, u);
            let root = match crossing {
                Crossing::Contact(side) | Crossing::OnsetEnds(side) | Crossing::MeshEnds(side) => {
                    let mut series = expansion.gap();
                    series[0] += self.q[0] - self.flow.wall(side);
                    root_near(&series, u - expansion.start, u)
                }
                Crossing::Through(side) => {
                    let mut series = expansion.gap();
                    series[0] += self.q[0] - self.flow.wall(side.mirrored());
                    root_near(&series, u - expansion.start, u)
                }
                Crossing::PressingEnds(_) => self.pressing_root(linear, &expansion, u),
            };
            let next = expansion.start + root.unwrap_or(f64::NAN);
            // Rounding may put a root at the step's end beyond it.
            let is_within = next >= lo * (1.0 - ENDS) && next <= hi * (1.0 + ENDS);
            if root.is_some_and(|v| v.abs() <= EXPANSION_REACH) && is_within {
                return Some((expansion, next.clamp(lo, hi)));
            }
            let v = u - expansion.start;
            if self.before(crossing, linear, &expansion.state(v), &expansion.phasor(linear.turn * v)) {
                lo = u;
            } else {
                hi = u;
            }
            // Where the slope is so small that the root hangs on rounding, Newton's steps go on
            // for ever; bisection ends.
            if hi - lo <= ENDS * hi.max(ENDS * h) {
                return Some((expansion, u));
            }
            u = if n < NEWTON_CAP && next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        }
        None
    }

    /// Where on an expansion pressing ceases, by Newton's method on the exact flow from `u`.
    #[inline(never)]
    fn pressing_root(&self, linear: &LinearFlow, expansion: &Expansion, u: f64) -> Option<f64> {
        let mut v = u - expansion.start;
        for _ in 0..POLISH_CAP {
            let [pressing, rate, bend] =
                linear.acceleration_rates(&expansion.state(v), &expansion.phasor(linear.turn * v));
            let delta = -pressing / (rate * linear.unit);
            v += delta;
            if v.is_nan() || v.abs() > EXPANSION_REACH {
                return None;
            }
            if delta * delta * (bend * linear.unit).abs() <= LEFT * rate.abs() * u {
                return Some(v);
            }
        }
        None
    }
}

/// The root of a series near `v`: reversion of the series there, then Newton's steps until what
/// they leave is below rounding. `u` is the time of flight that it is measured by.
///
/// Few divisions and trees instead of chains: the next flight waits for this number.
#[inline(always)]
fn root_near(c: &[f64; TERMS + 1], v: f64, u: f64) -> Option<f64> {
    let value = sum(c, v);
    // What follows need not be exact: the last terms of the series are below 1e-8 of the slope.
    let square = v * v;
    let tail = fma(square, fma(6.0 * c[6], v, 5.0 * c[5]), fma(4.0 * c[4], v, 3.0 * c[3]));
    let slope = fma(square, tail, fma(2.0 * c[2], v, c[1]));
    let bend = fma(square, fma(10.0 * c[5], v, 6.0 * c[4]), fma(3.0 * c[3], v, c[2]));
    let twist = fma(square, 10.0 * c[5], fma(4.0 * c[4], v, c[3]));
    let inverse = 1.0 / slope;
    let (first, bend, twist) = (-value * inverse, bend * inverse, twist * inverse);
    let curl = bend * first;
    let curve = fma(2.0 * curl, curl, -twist * first * first);
    let delta = fma(first, curve - curl, first);
    let flatter = fma(-delta, fma(delta, fma(-4.0 * bend, bend, 3.0 * twist), 2.0 * bend), 1.0);
    let inverse = inverse * flatter;
    // The share of a correction that the slope's own error leaves.
    let steepness = bend.abs() * delta.abs();
    let share = steepness * steepness * steepness + (twist * delta * delta * delta).abs() * 64.0 + 1e-6;
    let mut v = v + delta;
    for _ in 0..POLISH_CAP {
        let correction = sum(c, v) * inverse;
        v -= correction;
        if (correction * share).abs() <= LEFT * u {
            return Some(v);
        }
    }
    None
}

/// The sum of a series.
#[inline(always)]
fn sum(c: &[f64; TERMS + 1], v: f64) -> f64 {
    let square = v * v;
    let low = fma(square, fma(c[4], v, c[3]), fma(c[2], v, c[1]));
    let high = fma(square, fma(c[8], v, c[7]), fma(c[6], v, c[5]));
    fma(v, fma(square * square, high, low), c[0])
}
