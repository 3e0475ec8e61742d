//! Flights and contacts of a gear pair for an integrator with time steps: finds where a step meets a wall and applies the contact law.

use super::field::{Equations, to_gap, to_state};
use rattlemap_dynamics::model::{GearPair, Side, State};
use rattlemap_dynamics::pair::Gap;

/// Largest number of iterations of a root search.
const ROOT_CAP: u32 = 100;
/// Largest number of Newton steps, which precede bisection.
const NEWTON_CAP: u32 = 20;

/// Relative penetration of a wall that counts as rounding if the gap is opening.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// A possible end of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Free motion reaches a wall.
    Contact(Side),
    /// The contact onset ends. This is not an event.
    OnsetEnds(Side),
    /// The gap falls back through the wall.
    MeshEnds(Side),
    /// The load stops pressing the gap to the wall during the contact onset.
    PressingEnds(Side),
    /// A gap that opens during the contact onset reaches the other wall.
    Through(Side),
}

impl Ending {
    /// Whether the gap meets a wall; otherwise its acceleration changes sign.
    fn is_of_gap(self) -> bool {
        !matches!(self, Ending::PressingEnds(_))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Free,
    Onset(Side),
    Sustained(Side),
}

/// An ending found in a step: its distance is negative at the time `within` after the start of the step.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// The ending.
    pub ending: Ending,
    /// Zero if the start itself lies beyond the ending, by rounding.
    pub within: f64,
    /// First guess of the root.
    pub guess: f64,
}

/// A motion between walls.
#[derive(Clone, Debug)]
pub struct Flight {
    pair: GearPair,
    /// Equations of free motion, and of meshing with the right and the left wall.
    fields: [Equations; 3],
    mode: Mode,
    /// The ending at which the present motion starts, and the order of that root.
    from: Option<(Ending, u32)>,
    /// Gap coordinates.
    pub q: Gap,
    /// Times of events since phase 0.
    pub events: Vec<f64>,
}

impl Flight {
    /// Builds a motion from `start` at phase 0. A start beyond a wall is meshing.
    pub fn new(pair: &GearPair, start: &State) -> Flight {
        let domains = [None, Some(Side::Right), Some(Side::Left)];
        let mut flight = Flight {
            pair: *pair,
            fields: domains.map(|meshing| Equations::new(pair, meshing)),
            mode: Mode::Free,
            from: None,
            q: to_gap(start),
            events: Vec::new(),
        };
        if let Some(side) = Side::BOTH.into_iter().find(|side| flight.beyond(*side, &flight.q) > 0.0) {
            flight.mode = Mode::Sustained(side);
        }
        flight
    }

    /// Returns the state `(x1, v1, x2, v2)`.
    pub fn state(&self) -> State {
        to_state(&self.q)
    }

    /// Returns the present equations of motion.
    #[inline]
    pub fn field(&self) -> &Equations {
        match self.mode {
            Mode::Free => self.free_field(),
            Mode::Onset(side) | Mode::Sustained(side) => self.meshing_field(side),
        }
    }

    /// Returns the longest step in which no ending can be missed: a radian of free motion, or of meshing during contact
    /// onset.
    pub fn longest_step(&self) -> f64 {
        let field = match self.mode {
            Mode::Onset(side) => self.meshing_field(side),
            _ => self.free_field(),
        };
        field.rate().max(self.pair.omega).recip()
    }

    /// Records that the next step does not start on a wall.
    #[inline]
    pub fn leave_wall(&mut self) {
        self.from = None;
    }

    fn free_field(&self) -> &Equations {
        &self.fields[0]
    }

    fn meshing_field(&self, side: Side) -> &Equations {
        &self.fields[if side == Side::Right { 1 } else { 2 }]
    }

    fn wall(&self, side: Side) -> f64 {
        side.sign() * self.pair.b
    }

    /// Returns the penetration of a wall.
    #[inline]
    fn beyond(&self, side: Side, q: &Gap) -> f64 {
        side.sign() * (q[0] - self.wall(side))
    }

    /// Returns the acceleration of the gap into a wall by the equations of a domain.
    #[inline]
    fn pressing(&self, field: &Equations, side: Side, q: &Gap, t: f64) -> f64 {
        side.sign() * field.accelerations(q, self.cos(t))[0]
    }

    /// Whether the equations of free motion and of meshing press a gap into a wall.
    fn presses(&self, side: Side, q: &Gap, t: f64) -> bool {
        [self.free_field(), self.meshing_field(side)]
            .into_iter()
            .all(|field| self.pressing(field, side, q, t) > 0.0)
    }

    /// Lists the endings that are possible now. The list may repeat one.
    fn endings(&self) -> [Ending; 3] {
        match self.mode {
            Mode::Free => [Side::Right, Side::Left, Side::Left].map(Ending::Contact),
            Mode::Sustained(side) => [Ending::MeshEnds(side); 3],
            Mode::Onset(side) => {
                [Ending::OnsetEnds(side), Ending::PressingEnds(side), Ending::Through(side.mirrored())]
            }
        }
    }

    /// Returns the distance to an ending, positive before it, and its rate. The rate of `PressingEnds` is not computed.
    #[inline]
    fn distance(&self, ending: Ending, q: &Gap, t: f64) -> (f64, f64) {
        let rate = |side: Side| side.sign() * q[1];
        match ending {
            Ending::Contact(side) | Ending::OnsetEnds(side) | Ending::Through(side) => {
                (-self.beyond(side, q), -rate(side))
            }
            Ending::MeshEnds(side) => (self.beyond(side, q), rate(side)),
            Ending::PressingEnds(side) => (self.pressing(self.field(), side, q, t), 0.0),
        }
    }

    /// Returns the cosine of the forcing's phase.
    #[inline]
    pub fn cos(&self, t: f64) -> f64 {
        (self.pair.omega * t).cos()
    }

    /// Finds the earliest ending in a step of length `h` from `q0` at time `t` to `q1`. The distance is tested at the end
    /// of the step and at its minimum, which a cubic Hermite polynomial predicts. `first` says that the step starts with
    /// the flight. `after(tau)` integrates from `q0`.
    #[inline]
    pub fn find_ending(
        &self,
        first: bool,
        q0: &Gap,
        t: f64,
        h: f64,
        q1: &Gap,
        after: impl Fn(f64) -> Gap,
    ) -> Option<Sighting> {
        let find = |ending: Ending| {
            let starts_there = first && self.from.is_some_and(|(from, _)| from == ending);
            let left = self.distance(ending, q0, t);
            if !starts_there && left.0 <= 0.0 {
                return Some(Sighting { ending, within: 0.0, guess: 0.0 });
            }
            let right = self.distance(ending, q1, t + h);
            // The gap leaves its wall slowly.
            let is_rounding = ending.is_of_gap() && right.1 > 0.0 && right.0 >= -ROUNDING * q1[0].abs();
            if right.0 < 0.0 && !(starts_there && is_rounding) {
                let share =
                    if starts_there { second_root(left, right, h) } else { left.0 / (left.0 - right.0) };
                return Some(Sighting { ending, within: h, guess: h * share.clamp(0.01, 0.99) });
            }
            if right.1 <= 0.0 {
                return None;
            }
            let left = if starts_there { (0.0, left.1) } else { left };
            let mut turn = h * turning_point(left, right, h)?;
            // The polynomial only predicts the minimum; the equations decide.
            let q = after(turn);
            let [acceleration, _] = self.field().accelerations(&q, self.cos(t + turn));
            turn = (turn - q[1] / acceleration).clamp(0.0, h);
            let is_beyond = self.distance(ending, &after(turn), t + turn).0 < 0.0;
            is_beyond.then_some(Sighting { ending, within: turn, guess: 0.5 * turn })
        };
        let sightings = self.endings().into_iter().filter_map(find);
        sightings.min_by(|a, b| a.guess.total_cmp(&b.guess))
    }

    /// Locates an ending: Newton's method on the integrator with the root at the start divided out, and bisection if it
    /// fails. Returns the time since `t`; none if neither converges.
    pub fn locate(&self, first: bool, t: f64, sighting: Sighting, after: impl Fn(f64) -> Gap) -> Option<f64> {
        let Sighting { ending, within, guess } = sighting;
        if within == 0.0 {
            return Some(0.0);
        }
        let order = match self.from {
            Some((from, order)) if first && from == ending => f64::from(order),
            _ => 0.0,
        };
        let (mut lo, mut hi, mut tau) = (0.0, within, guess);
        for trial in 0..ROOT_CAP {
            let q = after(tau);
            let (f, rate) = self.distance(ending, &q, t + tau);
            if f > 0.0 {
                lo = tau;
            } else {
                hi = tau;
            }
            let slope = rate - order * f / tau;
            if slope < 0.0 && trial < NEWTON_CAP {
                let step = -f / slope;
                let next = tau + step;
                // The error of a Newton step is of second order in the step.
                let [acceleration, _] = self.field().accelerations(&q, self.cos(t + tau));
                let remainder = acceleration.abs() * step * step;
                let is_remainder = ending.is_of_gap() && remainder <= 0.5 * f64::EPSILON * tau * rate.abs();
                let within_rounding = is_remainder || step.abs() <= 2.0 * f64::EPSILON * tau;
                if (0.0..=within).contains(&next) && within_rounding {
                    return Some(next);
                }
                if next > lo && next < hi {
                    tau = next;
                    continue;
                }
            }
            tau = 0.5 * (lo + hi);
            if hi - lo <= 2.0 * f64::EPSILON * hi {
                return Some(tau);
            }
        }
        None
    }

    /// Applies an ending at the present state and time. `settling` says that the flight started there, so that rounding
    /// alone may have caused the ending.
    pub fn act(&mut self, ending: Ending, t: f64, settling: bool) {
        match ending {
            Ending::Contact(side) => self.contact(side, t, settling),
            Ending::OnsetEnds(side) => {
                self.put_on_wall(side);
                self.mode = Mode::Sustained(side);
                self.from = Some((Ending::MeshEnds(side), 1));
            }
            Ending::MeshEnds(side) => {
                let rate = side.sign() * self.q[1];
                let pressing = self.pressing(self.meshing_field(side), side, &self.q, t);
                if settling && (rate > 0.0 || rate == 0.0 && pressing > 0.0) {
                    self.from = Some((ending, if rate > 0.0 { 1 } else { 2 }));
                    return;
                }
                self.put_on_wall(side);
                self.leave(side, t);
                self.events.push(t);
            }
            Ending::PressingEnds(_) => {
                self.mode = Mode::Free;
                self.from = None;
                self.events.push(t);
            }
            Ending::Through(side) => {
                self.mode = Mode::Free;
                self.events.push(t);
                self.contact(side, t, false);
            }
        }
    }

    /// Applies the impact law when free motion reaches a wall, and decides whether contact lasts: equations (5), (6), (22), (37) of the
    /// paper.
    fn contact(&mut self, side: Side, t: f64, settling: bool) {
        self.put_on_wall(side);
        let closing = side.sign() * self.q[1];
        let presses_freely = || self.pressing(self.free_field(), side, &self.q, t) > 0.0;
        if settling && (closing < 0.0 || closing == 0.0 && !presses_freely()) {
            self.leave(side, t);
            return;
        }
        let GearPair { m1, m2, e, mesh_speed, .. } = self.pair;
        let (s, closing) = (side.sign(), closing.max(0.0));
        self.q[1] = -s * e * closing;
        self.q[3] += s * (1.0 + e) * closing * m1 / (m1 + m2);
        self.events.push(t);
        let leaving = e * closing;
        if leaving > mesh_speed || !self.presses(side, &self.q, t) {
            self.leave(side, t);
        } else if leaving > 0.0 {
            (self.mode, self.from) = (Mode::Onset(side), Some((Ending::OnsetEnds(side), 1)));
        } else {
            (self.mode, self.from) = (Mode::Sustained(side), Some((Ending::MeshEnds(side), 2)));
        }
    }

    /// Begins free motion from a wall.
    fn leave(&mut self, side: Side, t: f64) {
        self.mode = Mode::Free;
        let order = match self.q[1] == 0.0 {
            false => 1,
            true if self.pressing(self.free_field(), side, &self.q, t) != 0.0 => 2,
            true => 3,
        };
        self.from = Some((Ending::Contact(side), order));
    }

    fn put_on_wall(&mut self, side: Side) {
        self.q[0] = self.wall(side);
    }
}

/// Error bound of the cubic through the ends of a step of one radian, relative to its slopes.
const CUBIC_ERROR: f64 = 0.01;

/// Returns the minimum, as a share of the step, of the cubic through values and rates at both ends, if the motion may be
/// beyond the ending there. The cubic must rise at the end.
fn turning_point(left: (f64, f64), right: (f64, f64), h: f64) -> Option<f64> {
    let (rise, s0, s1) = (right.0 - left.0, h * left.1, h * right.1);
    let room = CUBIC_ERROR * (s0.abs() + s1.abs());
    // If both inner Bernstein coefficients are positive, so is the cubic.
    if left.0 + s0 / 3.0 > room && right.0 - s1 / 3.0 > room {
        return None;
    }
    let (b, a) = (3.0 * rise - 2.0 * s0 - s1, s0 + s1 - 2.0 * rise);
    let root = (b * b - 3.0 * a * s0).max(0.0).sqrt();
    // This form avoids cancellation.
    let u = if b > 0.0 { -s0 / (b + root) } else { (root - b) / (3.0 * a) };
    let least = left.0 + u * (s0 + u * (b + u * a));
    (u > 0.0 && u < 1.0 && least < room).then_some(u)
}

/// Returns the second root, as a share of the step, of a cubic with a root at the start and a negative value at the end.
fn second_root(left: (f64, f64), right: (f64, f64), h: f64) -> f64 {
    let (rise, s0, s1) = (right.0, h * left.1, h * right.1);
    let (b, a) = (3.0 * rise - 2.0 * s0 - s1, s0 + s1 - 2.0 * rise);
    if s0 > 0.0 { 2.0 * s0 / ((b * b - 4.0 * a * s0).max(0.0).sqrt() - b) } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minima_and_roots_of_cubics_are_found() {
        // (u - 0.25)^2 - 0.01: down at 0.25, negative there.
        let left = (0.0525, -0.5);
        let right = (0.5525, 1.5);
        assert!((turning_point(left, right, 1.0).unwrap() - 0.25).abs() < 1e-14);
        let higher = |(f, s): (f64, f64)| (f + 0.04, s);
        assert_eq!(turning_point(higher(left), higher(right), 1.0), None, "it stays well above");
        // u (u - 0.25) (u - 0.5): off the wall, beyond and back, within one step.
        let turn = turning_point((0.0, 0.125), (0.375, 1.625), 1.0).unwrap();
        assert!((turn - (0.75 + 0.1875f64.sqrt()) / 3.0).abs() < 1e-14, "{turn}");
        // u (0.25 - u) (1 + u)
        let share = second_root((0.0, 0.25), (-1.5, -4.25), 1.0);
        assert!((share - 0.25).abs() < 1e-14, "{share}");
    }
}
