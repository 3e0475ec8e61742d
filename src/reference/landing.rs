//! Landing on an event: the root of the event function on the exact flow.

use super::{Crossing, Observer, Stop, Trajectory};
use crate::certificate::Bracket;
use crate::flow::{Arc, Gap, LinearFlow, Phasor, REACH, TERMS};

/// Evaluations of the exact flow allowed for one root; one or two are needed.
const ROOT_CAP: u32 = 60;

/// Newton steps allowed on one arc.
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
        let remaining = until - self.t;
        if bracket.guess * h * linear.unit > remaining {
            // Probably after `until`. It is if what lies there is still before the one root.
            let u = remaining / linear.unit;
            let arc = linear.grid.arc(&self.q, &self.phasor, u);
            let v = u - arc.start;
            if self.before(crossing, linear, &arc.state(v), &arc.phasor(linear.turn * v)) {
                self.arrive(linear, &arc, u);
                self.count_meshing(remaining);
                self.from_wall = None;
                self.t = until;
                return Ok(());
            }
        }
        let (arc, u) = self.land(linear, h, crossing, bracket).ok_or(Stop::CapRoot)?;
        let s = u * linear.unit;
        if s > remaining {
            self.move_to(linear, remaining, until);
            return Ok(());
        }
        self.arrive(linear, &arc, u);
        self.t += s;
        self.count_meshing(s);
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

    /// The one root in a bracket, converged to rounding: an arc near it, and its instant in
    /// Taylor steps from here.
    ///
    /// What is added to the gap is summed by itself, so that a flight from the wall keeps its
    /// relative accuracy however short it is.
    #[inline(always)]
    fn land(
        &mut self,
        linear: &LinearFlow,
        h: f64,
        crossing: Crossing,
        bracket: Bracket,
    ) -> Option<(Arc, f64)> {
        let (mut lo, mut hi) = (h * bracket.lo, h * bracket.hi);
        let mut u = h * bracket.guess;
        for _ in 0..ROOT_CAP {
            self.work.root_iterations += 1;
            let arc = linear.grid.arc(&self.q, &self.phasor, u);
            let root = match crossing {
                Crossing::Contact(side) | Crossing::Emerge(side) | Crossing::MeshEnds(side) => {
                    let mut series = arc.gap();
                    series[0] += self.q[0] - self.flow.wall(side);
                    root_near(&series, u - arc.start, u)
                }
                Crossing::PressingEnds(_) => self.pressing_root(linear, &arc, u),
            };
            let next = arc.start + root.unwrap_or(f64::NAN);
            if root.is_some_and(|v| v.abs() <= REACH) && next >= lo && next <= hi {
                return Some((arc, next));
            }
            let v = u - arc.start;
            if self.before(crossing, linear, &arc.state(v), &arc.phasor(linear.turn * v)) {
                lo = u;
            } else {
                hi = u;
            }
            u = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        }
        None
    }

    /// Where on an arc pressing ceases, by Newton's method on the exact flow from `u`.
    #[inline(never)]
    fn pressing_root(&self, linear: &LinearFlow, arc: &Arc, u: f64) -> Option<f64> {
        let mut v = u - arc.start;
        for _ in 0..POLISH_CAP {
            let [pressing, rate, bend] =
                linear.acceleration_rates(&arc.state(v), &arc.phasor(linear.turn * v));
            let delta = -pressing / (rate * linear.unit);
            v += delta;
            if !(v.abs() <= REACH) {
                return None;
            }
            if delta * delta * (bend * linear.unit).abs() <= LEFT * rate.abs() * u {
                return Some(v);
            }
        }
        None
    }
}

/// The root of a series near `v`: one step of Halley's method, then Newton's until what it
/// leaves is below rounding. `u` is the time of flight that the correction is measured by.
#[inline(always)]
fn root_near(c: &[f64; TERMS + 1], v: f64, u: f64) -> Option<f64> {
    let (mut value, mut slope, mut bend) = (c[TERMS], 0.0, 0.0);
    for &c in c[..TERMS].iter().rev() {
        bend = bend * v + slope;
        slope = slope * v + value;
        value = value * v + c;
    }
    let first = -value / slope;
    let bend = bend / slope;
    let mut v = v + first / (1.0 + bend * first);
    for _ in 0..POLISH_CAP {
        let (mut value, mut slope) = (c[TERMS], 0.0);
        for &c in c[..TERMS].iter().rev() {
            slope = slope * v + value;
            value = value * v + c;
        }
        let delta = -value / slope;
        v += delta;
        if delta * delta * bend.abs() <= LEFT * u {
            return Some(v);
        }
        if !(v.abs() <= 1.0) {
            return Some(v);
        }
    }
    None
}
