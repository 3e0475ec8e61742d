//! Event localisation: the root of the event function on the exact flow.

use super::{Crossing, PairMotion};
use crate::fused::fma;
use crate::motion::{Observer, Stop};
use crate::pair::certificate::Bracket;
use crate::pair::flow::{EXPANSION_REACH, Expansion, Gap, LinearFlow, Phasor, TERMS};

/// Largest number of expansions for one root. Usually one or two are needed; bisection needs at most 110.
const ROOT_CAP: u32 = 120;

/// Number of expansions whose centres Newton's method chooses; further ones are chosen by bisection.
const NEWTON_CAP: u32 = 8;

/// Relative rounding error of a root at an end of its bracket.
const BRACKET_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Largest number of Newton steps on one expansion.
const POLISH_CAP: u32 = 8;

/// Largest error of a root after the last correction, relative to the time of flight.
const ROOT_TOLERANCE: f64 = 1e-17;

impl<const N: usize> PairMotion<'_, N> {
    /// Moves to the crossing of a step of `h` Taylor steps, or to `until` if that comes first.
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
            // The root is probably after `until`. This is certain if the state at `until` is before the only root.
            let u = remaining * linear.per_unit;
            let expansion = linear.grid.expansion(&self.q, &self.phasor, u);
            let v = u - expansion.start;
            if self.before(crossing, linear, &expansion.state(v), &expansion.phasor(linear.turn * v)) {
                self.move_along(linear, &expansion, u);
                self.count_meshing(remaining);
                self.depart();
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
        self.move_along(linear, &expansion, u);
        self.clock.advance(s);
        self.count_meshing(s);
        self.depart();
        self.act(crossing, observer);
        self.check_events()
    }

    /// Whether a point lies before the only crossing.
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

    /// Finds the only root in a bracket to rounding. Returns an expansion near it and its time from here in Taylor
    /// steps.
    ///
    /// The series is of the change of the gap, so that flights from a wall keep their relative accuracy at any
    /// length.
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
                Crossing::PressingEnds(_) => pressing_end(linear, &expansion, u),
            };
            let next = expansion.start + root.unwrap_or(f64::NAN);
            let is_within = next >= lo * (1.0 - BRACKET_ROUNDING) && next <= hi * (1.0 + BRACKET_ROUNDING);
            if root.is_some_and(|v| v.abs() <= EXPANSION_REACH) && is_within {
                return Some((expansion, next.clamp(lo, hi)));
            }
            let v = u - expansion.start;
            if self.before(crossing, linear, &expansion.state(v), &expansion.phasor(linear.turn * v)) {
                lo = u;
            } else {
                hi = u;
            }
            // If the slope is so small that rounding moves the root, Newton's method does not converge, but bisection
            // ends.
            if hi - lo <= BRACKET_ROUNDING * hi.max(BRACKET_ROUNDING * h) {
                return Some((expansion, u));
            }
            u = if n < NEWTON_CAP && next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        }
        None
    }
}

/// Finds the time on an expansion at which the pressing acceleration vanishes, by Newton's method from `u`.
#[inline(never)]
fn pressing_end(linear: &LinearFlow, expansion: &Expansion, u: f64) -> Option<f64> {
    let mut v = u - expansion.start;
    for _ in 0..POLISH_CAP {
        let [value, rate, bend] =
            linear.acceleration_rates(&expansion.state(v), &expansion.phasor(linear.turn * v));
        let delta = -value / (rate * linear.unit);
        v += delta;
        if v.is_nan() || v.abs() > EXPANSION_REACH {
            return None;
        }
        if delta * delta * (bend * linear.unit).abs() <= ROOT_TOLERANCE * rate.abs() * u {
            return Some(v);
        }
    }
    None
}

/// Finds the root of a series near `v`, by reversion of the series there and then Newton steps to rounding. The
/// tolerance is relative to the time of flight `u`.
///
/// The next flight waits for the result. For low latency there are few divisions, and sums are evaluated as trees.
#[inline(always)]
fn root_near(c: &[f64; TERMS + 1], v: f64, u: f64) -> Option<f64> {
    let value = sum(c, v);
    // The derivatives may be inexact: the omitted last terms are below 1e-8 of the slope.
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
    // The share of a correction that remains because of the error of the slope.
    let steepness = bend.abs() * delta.abs();
    let share = steepness * steepness * steepness + (twist * delta * delta * delta).abs() * 64.0 + 1e-6;
    let mut v = v + delta;
    for _ in 0..POLISH_CAP {
        let correction = sum(c, v) * inverse;
        v -= correction;
        if (correction * share).abs() <= ROOT_TOLERANCE * u {
            return Some(v);
        }
    }
    None
}

#[inline(always)]
fn sum(c: &[f64; TERMS + 1], v: f64) -> f64 {
    let square = v * v;
    let low = fma(square, fma(c[4], v, c[3]), fma(c[2], v, c[1]));
    let high = fma(square, fma(c[8], v, c[7]), fma(c[6], v, c[5]));
    fma(v, fma(square * square, high, low), c[0])
}
