//! Flights and contacts for integrators that step through time: where a step meets a wall, and
//! what happens there. Written from the equations of motion, in time and in gap coordinates
//! `(z, w, x2, v2)`: a gap that is put on a wall is exactly there.

use rattlemap_dynamics::flow::Gap;
use rattlemap_dynamics::model::{Domain, Law, Oscillator, Side, State};
use rattlemap_dynamics::reference::EventKind;

/// Trials of a root search; Newton's method gets the first of them.
const ROOT_CAP: u32 = 100;
const NEWTON_CAP: u32 = 20;

/// The equations of motion of one domain in gap coordinates, solved for the accelerations.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Accelerations of gap and second displacement per `(z, w, x2, v2)`.
    rows: [[f64; 4]; 2],
    force: [f64; 2],
    load: [f64; 2],
}

impl Field {
    fn new(oscillator: &Oscillator, domain: &Domain) -> Field {
        let ([g0, g1], m) = (oscillator.gap, oscillator.masses());
        // On (x1, v1, x2, v2); then x1 = (z - g1 x2) / g0, and z'' = g . x''.
        let row = |i: usize| {
            let (k, c) = (domain.stiffness[i], domain.damping[i]);
            let [x1, v1, x2, v2] = [k[0], c[0], k[1], c[1]].map(|a| -a / m[i]);
            [x1 / g0, v1 / g0, x2 - x1 * g1 / g0, v2 - v1 * g1 / g0]
        };
        let (first, second) = (row(0), row(1));
        let gap_row = std::array::from_fn(|j| g0 * first[j] + g1 * second[j]);
        let per_mass = |f: [f64; 2]| [g0 * f[0] / m[0] + g1 * f[1] / m[1], f[1] / m[1]];
        Field { rows: [gap_row, second], force: per_mass(oscillator.force), load: per_mass(domain.load) }
    }

    /// Accelerations of gap and second displacement where the forcing stands at `cos`.
    #[inline(always)]
    pub fn accelerations(&self, q: &Gap, cos: f64) -> [f64; 2] {
        [0, 1].map(|i| {
            let r = &self.rows[i];
            (r[0] * q[0] + r[1] * q[1]) + (r[2] * q[2] + r[3] * q[3]) + (self.force[i] * cos + self.load[i])
        })
    }
}

/// What may end a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Free motion reaches a wall.
    Contact(Side),
    /// The contact onset is over; no event.
    OnsetEnds(Side),
    /// The gap falls back through the wall.
    MeshEnds(Side),
    /// Pressing ceases inside the contact onset.
    PressingEnds(Side),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Free,
    Onset(Side),
    Sustained(Side),
}

/// A step that holds an ending: its distance is negative `within` after the start.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// What ends the flight.
    pub ending: Ending,
    /// Zero where the start itself lies beyond, by rounding.
    pub within: f64,
    /// Where the search for the root begins.
    pub guess: f64,
}

/// An event that ended a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ended {
    /// Time since phase 0.
    pub t: f64,
    /// What happened.
    pub kind: EventKind,
    /// At which wall.
    pub side: Side,
}

/// A motion between walls.
#[derive(Clone, Debug)]
pub struct Flight {
    oscillator: Oscillator,
    law: Law,
    fields: [Field; 3],
    mode: Mode,
    /// The ending that the present motion starts on, and the order of that root.
    from: Option<(Ending, u32)>,
    /// Gap coordinates.
    pub q: Gap,
    /// The events so far; whoever reads them takes them away.
    pub events: Vec<Ended>,
}

impl Flight {
    /// A motion from `start` at phase 0; beyond a wall it is meshing.
    pub fn new(oscillator: &Oscillator, law: Law, start: State) -> Flight {
        let ([right, left], [g0, g1]) = (&oscillator.meshing, oscillator.gap);
        let mut flight = Flight {
            oscillator: *oscillator,
            law,
            fields: [&oscillator.free, right, left].map(|domain| Field::new(oscillator, domain)),
            mode: Mode::Free,
            from: None,
            q: [g0 * start[0] + g1 * start[2], g0 * start[1] + g1 * start[3], start[2], start[3]],
            events: Vec::new(),
        };
        let beyond = |side: &Side| flight.beyond(*side, &flight.q) > 0.0;
        if let Some(side) = Side::BOTH.into_iter().find(beyond) {
            flight.mode = Mode::Sustained(side);
        }
        flight
    }

    /// The state `(x1, v1, x2, v2)`.
    pub fn state(&self) -> State {
        let ([g0, g1], [z, w, x, v]) = (self.oscillator.gap, self.q);
        [(z - g1 * x) / g0, (w - g1 * v) / g0, x, v]
    }

    /// The wall the teeth mesh on, if they do.
    pub fn meshing(&self) -> Option<Side> {
        match self.mode {
            Mode::Free => None,
            Mode::Onset(side) | Mode::Sustained(side) => Some(side),
        }
    }

    /// The equations that govern the motion now.
    #[inline]
    pub fn field(&self) -> &Field {
        match self.mode {
            Mode::Free => &self.fields[0],
            Mode::Onset(side) | Mode::Sustained(side) => self.meshing_field(side),
        }
    }

    /// The longest step that leaves nothing unseen: a radian of the supports; of the mesh
    /// during contact onset, since that and the meshing after it may be over sooner.
    pub fn longest_step(&self) -> f64 {
        let field =
            if let Mode::Onset(side) = self.mode { self.meshing_field(side) } else { &self.fields[0] };
        (-field.rows[0][0]).max(-field.rows[1][2]).max(self.oscillator.omega.powi(2)).sqrt().recip()
    }

    /// The next step does not start on a wall any more.
    #[inline]
    pub fn leave_wall(&mut self) {
        self.from = None;
    }

    fn meshing_field(&self, side: Side) -> &Field {
        &self.fields[if side == Side::Right { 1 } else { 2 }]
    }

    fn wall(&self, side: Side) -> f64 {
        self.oscillator.walls[if side == Side::Right { 0 } else { 1 }]
    }

    /// How far the gap lies beyond a wall.
    #[inline]
    fn beyond(&self, side: Side, q: &Gap) -> f64 {
        side.sign() * (q[0] - self.wall(side))
    }

    /// Acceleration of the gap into a wall.
    #[inline]
    fn pressing(&self, field: &Field, side: Side, q: &Gap, cos: f64) -> f64 {
        side.sign() * field.accelerations(q, cos)[0]
    }

    fn endings(&self) -> ([Ending; 2], usize) {
        match self.mode {
            Mode::Free => ([Ending::Contact(Side::Right), Ending::Contact(Side::Left)], 2),
            Mode::Sustained(side) => ([Ending::MeshEnds(side); 2], 1),
            Mode::Onset(side) => ([Ending::OnsetEnds(side), Ending::PressingEnds(side)], 2),
        }
    }

    /// What is left until an ending, positive before it, and its rate; no rate for the end of
    /// pressing.
    #[inline]
    fn distance(&self, ending: Ending, q: &Gap, t: f64) -> (f64, f64) {
        let rate = |side: Side| side.sign() * q[1];
        match ending {
            Ending::Contact(side) | Ending::OnsetEnds(side) => (-self.beyond(side, q), -rate(side)),
            Ending::MeshEnds(side) => (self.beyond(side, q), rate(side)),
            Ending::PressingEnds(side) => (self.pressing(self.field(), side, q, self.cos(t)), 0.0),
        }
    }

    #[inline]
    fn cos(&self, t: f64) -> f64 {
        (self.oscillator.omega * t).cos()
    }

    /// The ending on a step of length `h` from `q0` at time `t` to `q1`, if one is seen: beyond
    /// at the end, or at the turning point in between, which a cubic Hermite polynomial tells. `first`:
    /// the step starts where the flight does. `after(tau)` integrates from `q0`.
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
        let (endings, count) = self.endings();
        endings[..count].iter().find_map(|&ending| {
            let starts_there = first && self.from.is_some_and(|(from, _)| from == ending);
            let left = self.distance(ending, q0, t);
            if !starts_there && left.0 <= 0.0 {
                return Some(Sighting { ending, within: 0.0, guess: 0.0 });
            }
            let right = self.distance(ending, q1, t + h);
            if right.0 < 0.0 {
                let share =
                    if starts_there { second_root(left, right, h) } else { left.0 / (left.0 - right.0) };
                return Some(Sighting { ending, within: h, guess: h * share.clamp(0.01, 0.99) });
            }
            if right.1 <= 0.0 {
                return None;
            }
            let left = if starts_there { (0.0, left.1) } else { left };
            let turn = h * turning_point(left, right, h)?;
            // The polynomial is no proof: the equations decide, at their own turning point.
            let q = after(turn);
            let [acceleration, _] = self.field().accelerations(&q, self.cos(t + turn));
            let turn = (turn - q[1] / acceleration).clamp(0.0, h);
            let is_beyond = self.distance(ending, &after(turn), t + turn).0 < 0.0;
            is_beyond.then_some(Sighting { ending, within: turn, guess: 0.5 * turn })
        })
    }

    /// The time from `q0` at `t` to an ending that was seen: Newton's method on the integrator,
    /// the root at the start divided out, bisection where that fails. None if neither ends.
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
                // What a Newton step leaves over is of second order in it.
                let [acceleration, _] = self.field().accelerations(&q, self.cos(t + tau));
                let left_over = acceleration.abs() * step * step;
                let within_rounding = left_over <= 0.5 * f64::EPSILON * tau * rate.abs()
                    || step.abs() <= 2.0 * f64::EPSILON * tau;
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

    /// Acts on an ending at the present state and time; `settling` where the flight started
    /// there and may only have been put there by rounding.
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
                if settling && rate > 0.0 {
                    self.from = Some((ending, 1));
                    return;
                }
                self.put_on_wall(side);
                self.mode = Mode::Free;
                self.from = Some((Ending::Contact(side), if rate == 0.0 { 2 } else { 1 }));
                self.events.push(Ended { t, kind: EventKind::MeshEnd, side });
            }
            Ending::PressingEnds(side) => {
                self.mode = Mode::Free;
                self.from = None;
                self.events.push(Ended { t, kind: EventKind::MeshEnd, side });
            }
        }
    }

    /// The impact law, then meshing or not: equations (5), (6), (22), (37) of the paper.
    fn contact(&mut self, side: Side, t: f64, settling: bool) {
        self.put_on_wall(side);
        let (s, e) = (side.sign(), self.law.restitution[side.index()]);
        let cos = self.cos(t);
        let closing = s * self.q[1];
        if settling
            && (closing < 0.0 || closing == 0.0 && self.pressing(&self.fields[0], side, &self.q, cos) <= 0.0)
        {
            self.from = Some((Ending::Contact(side), if closing == 0.0 { 2 } else { 1 }));
            return;
        }
        let leaving = e * closing.max(0.0);
        let ([g0, g1], [m1, m2]) = (self.oscillator.gap, self.oscillator.masses());
        let impulse = -s * (1.0 + e) * closing.max(0.0) / (g0 * g0 / m1 + g1 * g1 / m2);
        self.q[1] = -s * leaving;
        self.q[3] += impulse * g1 / m2;
        let presses = |field: &Field| self.pressing(field, side, &self.q, cos) > 0.0;
        let meshes = leaving <= self.law.mesh_speed[side.index()]
            && presses(&self.fields[0])
            && presses(self.meshing_field(side));
        let kind = if meshes { EventKind::MeshStart } else { EventKind::Impact };
        self.events.push(Ended { t, kind, side });
        (self.mode, self.from) = match (meshes, leaving > 0.0) {
            (true, true) => (Mode::Onset(side), Some((Ending::OnsetEnds(side), 1))),
            (true, false) => (Mode::Sustained(side), Some((Ending::MeshEnds(side), 2))),
            (false, moves) => (Mode::Free, Some((Ending::Contact(side), if moves { 1 } else { 2 }))),
        };
    }

    fn put_on_wall(&mut self, side: Side) {
        self.q[0] = self.wall(side);
    }
}

/// A cubic through the ends of a step of a radian is off by less than this share of its
/// slopes.
const CUBIC_ERROR: f64 = 0.01;

/// Where, as a share of the step, the cubic through values and rates at both ends turns up, if
/// the motion may be beyond there. It rises at the end.
fn turning_point(left: (f64, f64), right: (f64, f64), h: f64) -> Option<f64> {
    let (rise, s0, s1) = (right.0 - left.0, h * left.1, h * right.1);
    let room = CUBIC_ERROR * (s0.abs() + s1.abs());
    // The inner Bernstein coefficients: where both are positive, so is the cubic.
    if left.0 + s0 / 3.0 > room && right.0 - s1 / 3.0 > room {
        return None;
    }
    let (b, a) = (3.0 * rise - 2.0 * s0 - s1, s0 + s1 - 2.0 * rise);
    let root = (b * b - 3.0 * a * s0).max(0.0).sqrt();
    // The same number, written without cancellation.
    let u = if b > 0.0 { -s0 / (b + root) } else { (root - b) / (3.0 * a) };
    let least = left.0 + u * (s0 + u * (b + u * a));
    (u > 0.0 && u < 1.0 && least < room).then_some(u)
}

/// Where, as a share of the step, the cubic through a root at the start and a negative value at
/// the end comes back to zero.
fn second_root(left: (f64, f64), right: (f64, f64), h: f64) -> f64 {
    let (rise, s0, s1) = (right.0, h * left.1, h * right.1);
    let (b, a) = (3.0 * rise - 2.0 * s0 - s1, s0 + s1 - 2.0 * rise);
    if s0 > 0.0 { 2.0 * s0 / ((b * b - 4.0 * a * s0).max(0.0).sqrt() - b) } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_turn_where_they_do() {
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
