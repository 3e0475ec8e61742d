//! Flights and contacts for an integrator with time steps: finds where a step meets a wall and applies the contact law.
//! The equations of motion are in gap coordinates `(z, w, x, v)`, in which a gap can be set exactly to a wall.

use std::cmp::Ordering;
use std::sync::Arc;

use super::field::{Coordinates, Equations};
use rattlemap_dynamics::model::{Contact, Law, Pair, Side, State};
use rattlemap_dynamics::motion::EventKind;
use rattlemap_dynamics::pair::{Gap, Phasor};

/// Largest number of iterations of a root search.
const ROOT_CAP: u32 = 100;
/// Largest number of Newton steps, which precede bisection.
const NEWTON_CAP: u32 = 20;

/// Number of bisections for the minimum of an acceleration.
const TURN_CAP: u32 = 30;

/// An infinite series of impacts ends when its remaining duration is below this, in radians of free motion. The error is
/// of second order in this value.
const SERIES_ENDS: f64 = 1e-6;

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
    /// The load pulls the gap off the rigid wall on which it rests.
    PulledOff(Side),
    /// Behind a wall that only pushes, the force falls to 0.
    Opens(Side),
    /// Behind a wall that only pushes, the force rises from 0.
    Closes(Side),
    /// A gap behind a wall that does not push now returns to the wall. This is not an event.
    Returns(Side),
}

impl Ending {
    /// Whether the gap meets a wall; otherwise an acceleration changes sign.
    fn is_of_gap(self) -> bool {
        !matches!(self, Ending::PressingEnds(_) | Ending::PulledOff(_) | Ending::Opens(_) | Ending::Closes(_))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Free,
    Onset(Side),
    Sustained(Side),
    /// Behind a wall that only pushes, without a force.
    Open(Side),
    /// At rest on a rigid wall.
    Stuck(Side),
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

/// An event that ended a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ended {
    /// Time since phase 0.
    pub t: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// The wall.
    pub side: Side,
    /// Side of the contact that lasts after the event.
    pub meshing: Option<Side>,
    /// Whether the event ends an infinite series of impacts, of which not all are listed.
    pub after_series: bool,
}

/// A motion between walls.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Intervals between neighbouring walls, from left to right, and the present one.
    intervals: Arc<[Interval]>,
    interval: usize,
    /// The interval between the first walls.
    centre: usize,
    omega: f64,
    law: Law,
    coordinates: Coordinates,
    /// The present stage.
    stage: usize,
    /// Changes of the stage: phase in turns, and the stage that begins there.
    schedule: Arc<[(f64, usize)]>,
    period: f64,
    /// Largest of the angular frequencies of the force.
    fastest: f64,
    mode: Mode,
    /// The ending at which the present motion starts, and the order of that root.
    from: Option<(Ending, u32)>,
    /// Gap coordinates.
    pub q: Gap,
    /// Events since the caller last took them.
    pub events: Vec<Ended>,
}

/// The walls of an interval and the motion between them.
#[derive(Debug)]
struct Interval {
    walls: [f64; 2],
    contacts: [Contact; 2],
    /// For each stage, the equations of free motion, and of lasting contact with the right and the left wall.
    fields: Vec<[Equations; 3]>,
    /// For each stage, stiffness, damping and preload of the right and of the left wall, if these only push.
    pushing: Vec<[Option<[f64; 3]>; 2]>,
}

impl Interval {
    /// `nth` is the number of walls in front of the interval, none between the first walls.
    fn new(oscillator: &Pair, coordinates: &Coordinates, side: Side, nth: usize) -> Interval {
        let of_stage = |stage: usize| {
            let alone = oscillator.in_stage(stage);
            if nth == 0 { alone } else { alone.behind(side, nth) }
        };
        let fields = |stage: usize| {
            let oscillator = of_stage(stage);
            let free = Equations::new(&oscillator, &oscillator.free);
            let behind = |side: Side| match oscillator.contacts[side.index()] {
                _ if oscillator.walls[side.index()].is_infinite() => free.clone(),
                Contact::Rigid => free.held(coordinates),
                _ => Equations::new(&oscillator, &oscillator.meshing[side.index()]),
            };
            let [right, left] = Side::BOTH.map(behind);
            [free, right, left]
        };
        let pushing = |stage: usize| {
            let oscillator = of_stage(stage);
            Side::BOTH.map(|side| {
                let [stiffness, damping] = oscillator.wall_stiffness_and_damping(side);
                let force = [stiffness, damping, oscillator.preload(side)];
                // Without damper and preload it never pulls.
                let is_pushing =
                    oscillator.contacts[side.index()] == Contact::Pushing && force[1..] != [0.0; 2];
                is_pushing.then_some(force)
            })
        };
        let Pair { walls, contacts, .. } = of_stage(0);
        let stages = 0..oscillator.stage_count();
        Interval {
            walls,
            contacts,
            fields: stages.clone().map(fields).collect(),
            pushing: stages.map(pushing).collect(),
        }
    }
}

impl Flight {
    /// Builds a motion from `start` at phase 0. A start beyond a wall is meshing; beyond a rigid wall it is moved to the
    /// wall.
    pub fn new(oscillator: &Pair, law: Law, start: State) -> Flight {
        let coordinates = Coordinates::new(oscillator);
        let [right, left] = oscillator.outer_walls.each_ref().map(Vec::len);
        let interval = |side| move |nth| Interval::new(oscillator, &coordinates, side, nth);
        let intervals =
            (1..=left).rev().map(interval(Side::Left)).chain((0..=right).map(interval(Side::Right)));
        let mut flight = Flight {
            intervals: intervals.collect(),
            interval: left,
            centre: left,
            omega: oscillator.omega,
            law,
            coordinates,
            stage: oscillator.first_stage(),
            schedule: oscillator.schedule.as_slice().into(),
            period: oscillator.period(),
            fastest: f64::from(oscillator.highest_order()) * oscillator.omega,
            mode: Mode::Free,
            from: None,
            q: coordinates.gap(&start),
            events: Vec::new(),
        };
        for side in Side::BOTH {
            while let Some(next) = flight.next_interval(side)
                && flight.beyond(side, &flight.q) > 0.0
            {
                flight.interval = next;
            }
        }
        let beyond = |side: &Side| flight.beyond(*side, &flight.q) > 0.0;
        if let Some(side) = Side::BOTH.into_iter().find(beyond) {
            match flight.is_rigid(side) {
                true => flight.put_on_wall(side),
                false if flight.closes(side, 0.0) => flight.mode = Mode::Sustained(side),
                false => flight.mode = Mode::Open(side),
            }
        }
        flight
    }

    /// Returns the state `(x1, v1, x2, v2)`.
    pub fn state(&self) -> State {
        self.coordinates.state(&self.q)
    }

    /// Returns the wall of a lasting contact, if there is one.
    pub fn meshing(&self) -> Option<Side> {
        match self.mode {
            Mode::Free | Mode::Open(_) => self.side_of_interval(),
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => Some(side),
        }
    }

    /// Returns the side of the present interval; none between the first walls.
    fn side_of_interval(&self) -> Option<Side> {
        match self.interval.cmp(&self.centre) {
            Ordering::Less => Some(Side::Left),
            Ordering::Equal => None,
            Ordering::Greater => Some(Side::Right),
        }
    }

    /// Returns the interval behind a wall of the present one.
    fn next_interval(&self, side: Side) -> Option<usize> {
        match side {
            Side::Right => Some(self.interval + 1).filter(|next| *next < self.intervals.len()),
            Side::Left => self.interval.checked_sub(1),
        }
    }

    /// Whether the gap is at rest on a rigid wall.
    pub fn is_stuck(&self) -> bool {
        matches!(self.mode, Mode::Stuck(_))
    }

    /// Returns a motion displaced by `by` in gap coordinates. A gap at rest on a wall is not displaced.
    pub fn displaced(&self, by: &Gap) -> Flight {
        let mut other = self.clone();
        let held = if self.is_stuck() { 2 } else { 0 };
        (held..4).for_each(|i| other.q[i] += by[i]);
        other
    }

    /// Returns the present equations of motion.
    #[inline]
    pub fn field(&self) -> &Equations {
        match self.mode {
            Mode::Free | Mode::Open(_) => self.free_field(),
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => self.meshing_field(side),
        }
    }

    /// Returns the longest step in which no ending can be missed: a radian of free motion, or of meshing during contact
    /// onset.
    pub fn longest_step(&self) -> f64 {
        let field = match self.mode {
            Mode::Onset(side) => self.meshing_field(side),
            Mode::Sustained(side) if self.pushing(side).is_some() => self.meshing_field(side),
            _ => self.free_field(),
        };
        field.rate().max(self.fastest).recip()
    }

    /// Returns the phases in turns at which the stage changes.
    pub fn change_phases(&self) -> impl Iterator<Item = f64> + '_ {
        self.schedule.iter().map(|&(phase, _)| phase)
    }

    /// Returns the time of the first change of the stage after `t`, a time since phase 0 of some period, and the stage that
    /// begins there.
    pub fn next_change(&self, t: f64) -> Option<(f64, usize)> {
        let periods = (t / self.period).floor().max(0.0);
        let of_period =
            |n: f64| self.schedule.iter().map(move |&(phase, stage)| ((n + phase) * self.period, stage));
        // Rounding may put `t` at a whole period into the period before.
        [0.0, 1.0, 2.0].into_iter().flat_map(|n| of_period(periods + n)).find(|(at, _)| *at > t)
    }

    /// Changes the stage at the present state. What depends on the forces is decided again: whether a gap stays at rest on a
    /// rigid wall, and whether a contact onset goes on.
    pub fn change_stage(&mut self, stage: usize, t: f64) {
        self.stage = stage;
        // The phase of a whole period is 0 without rounding.
        let exact = t % self.period;
        match self.mode {
            Mode::Stuck(side) if !self.presses(self.free_field(), side, &self.q, exact) => {
                self.leave(side, exact);
                self.record(t, EventKind::MeshEnd, side);
            }
            Mode::Onset(side) if self.pressing(self.meshing_field(side), side, &self.q, exact) <= 0.0 => {
                self.act(Ending::PressingEnds(side), t, false);
            }
            Mode::Sustained(side) if !self.closes(side, exact) => {
                self.act(Ending::Opens(side), t, false);
                self.from = None;
            }
            Mode::Open(side) if self.closes(side, exact) => {
                self.act(Ending::Closes(side), t, false);
                self.from = None;
            }
            _ => {}
        }
    }

    /// Records that the next step does not start on a wall.
    #[inline]
    pub fn leave_wall(&mut self) {
        self.from = None;
    }

    fn free_field(&self) -> &Equations {
        &self.intervals[self.interval].fields[self.stage][0]
    }

    fn meshing_field(&self, side: Side) -> &Equations {
        &self.intervals[self.interval].fields[self.stage][if side == Side::Right { 1 } else { 2 }]
    }

    fn wall(&self, side: Side) -> f64 {
        self.intervals[self.interval].walls[side.index()]
    }

    fn contact_type(&self, side: Side) -> Contact {
        self.intervals[self.interval].contacts[side.index()]
    }

    fn is_rigid(&self, side: Side) -> bool {
        self.contact_type(side) == Contact::Rigid
    }

    fn pushing(&self, side: Side) -> Option<[f64; 3]> {
        self.intervals[self.interval].pushing[self.stage][side.index()]
    }

    /// Returns the force of a wall that only pushes, if it could also pull, and its rate by the equations of a domain.
    fn force(&self, field: &Equations, side: Side, q: &Gap, t: f64) -> (f64, f64) {
        let Some([k, c, preload]) = self.pushing(side) else { return (f64::INFINITY, 0.0) };
        let [acceleration, _] = field.accelerations(q, self.phasor(t));
        let s = side.sign();
        (k * self.beyond(side, q) + s * c * q[1] + preload, s * (k * q[1] + c * acceleration))
    }

    /// Whether a wall pushes a gap that is on it or behind it. At a force of 0 its rate decides, and then the penetration's.
    fn closes(&self, side: Side, t: f64) -> bool {
        let (force, rate) = self.force(self.free_field(), side, &self.q, t);
        force > 0.0 || force == 0.0 && (rate > 0.0 || rate == 0.0 && side.sign() * self.q[1] > 0.0)
    }

    /// Returns the penetration of a wall.
    #[inline]
    fn beyond(&self, side: Side, q: &Gap) -> f64 {
        side.sign() * (q[0] - self.wall(side))
    }

    /// Returns the acceleration of the gap into a wall by the equations of a domain.
    #[inline]
    fn pressing(&self, field: &Equations, side: Side, q: &Gap, t: f64) -> f64 {
        side.sign() * field.accelerations(q, self.phasor(t))[0]
    }

    /// Whether the equations of a domain press a gap at rest into a wall. The first derivative that is not zero decides.
    fn presses(&self, field: &Equations, side: Side, q: &Gap, t: f64) -> bool {
        let pressing = self.pressing(field, side, q, t);
        let rates = || field.gap_rates(field, q, self.phasor(t), self.omega).map(|rate| side.sign() * rate);
        pressing > 0.0
            || pressing == 0.0 && rates().into_iter().find(|rate| *rate != 0.0).is_some_and(|rate| rate > 0.0)
    }

    /// Returns the rate of the acceleration into a wall by the equations `of`, along the motion by the equations `along`.
    fn pressing_rate(&self, of: &Equations, along: &Equations, side: Side, q: &Gap, t: f64) -> f64 {
        side.sign() * of.gap_rates(along, q, self.phasor(t), self.omega)[0]
    }

    /// Lists the endings that are possible now. The list may repeat one.
    fn endings(&self) -> [Ending; 3] {
        match self.mode {
            Mode::Free => [Side::Right, Side::Left, Side::Left].map(Ending::Contact),
            Mode::Sustained(side) if self.pushing(side).is_some() => {
                [Ending::MeshEnds(side), Ending::Opens(side), Ending::Opens(side)]
            }
            Mode::Sustained(side) => [Ending::MeshEnds(side); 3],
            Mode::Open(side) => [Ending::Returns(side), Ending::Closes(side), Ending::Closes(side)],
            Mode::Onset(side) => {
                [Ending::OnsetEnds(side), Ending::PressingEnds(side), Ending::Through(side.mirrored())]
            }
            Mode::Stuck(side) => [Ending::PulledOff(side); 3],
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
            Ending::MeshEnds(side) | Ending::Returns(side) => (self.beyond(side, q), rate(side)),
            Ending::Opens(side) => self.force(self.field(), side, q, t),
            Ending::Closes(side) => {
                let (force, rate) = self.force(self.field(), side, q, t);
                (-force, -rate)
            }
            Ending::PressingEnds(side) => (self.pressing(self.field(), side, q, t), 0.0),
            Ending::PulledOff(side) => {
                let free = self.free_field();
                (self.pressing(free, side, q, t), self.pressing_rate(free, self.field(), side, q, t))
            }
        }
    }

    #[inline]
    fn phasor(&self, t: f64) -> Phasor {
        let (sin, cos) = (self.omega * t).sin_cos();
        [cos, sin]
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
        let find = |ending| self.find(ending, first, q0, t, h, q1, &after);
        let sightings = self.endings().into_iter().filter_map(find);
        sightings.min_by(|a, b| a.guess.total_cmp(&b.guess))
    }

    #[expect(clippy::too_many_arguments, reason = "a step")]
    fn find(
        &self,
        ending: Ending,
        first: bool,
        q0: &Gap,
        t: f64,
        h: f64,
        q1: &Gap,
        after: impl Fn(f64) -> Gap,
    ) -> Option<Sighting> {
        let starts_there = first && self.from.is_some_and(|(from, _)| from == ending);
        let left = self.distance(ending, q0, t);
        if !starts_there && left.0 <= 0.0 {
            return Some(Sighting { ending, within: 0.0, guess: 0.0 });
        }
        let right = self.distance(ending, q1, t + h);
        // The gap leaves its wall slowly.
        let is_rounding = ending.is_of_gap() && right.1 > 0.0 && right.0 >= -ROUNDING * q1[0].abs();
        if right.0 < 0.0 && !(starts_there && is_rounding) {
            let share = if starts_there { second_root(left, right, h) } else { left.0 / (left.0 - right.0) };
            return Some(Sighting { ending, within: h, guess: h * share.clamp(0.01, 0.99) });
        }
        if right.1 <= 0.0 {
            return None;
        }
        let left = if starts_there { (0.0, left.1) } else { left };
        let mut turn = h * turning_point(left, right, h)?;
        // The polynomial only predicts the minimum; the equations decide.
        if ending.is_of_gap() {
            let q = after(turn);
            let [acceleration, _] = self.field().accelerations(&q, self.phasor(t + turn));
            turn = (turn - q[1] / acceleration).clamp(0.0, h);
        } else {
            let (mut lo, mut hi) = (0.0, h);
            for _ in 0..TURN_CAP {
                if self.distance(ending, &after(turn), t + turn).1 < 0.0 {
                    lo = turn
                } else {
                    hi = turn
                }
                turn = 0.5 * (lo + hi);
            }
        }
        let is_beyond = self.distance(ending, &after(turn), t + turn).0 < 0.0;
        is_beyond.then_some(Sighting { ending, within: turn, guess: 0.5 * turn })
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
                let [acceleration, _] = self.field().accelerations(&q, self.phasor(t + tau));
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
                let stays =
                    rate > 0.0 || rate == 0.0 && self.presses(self.meshing_field(side), side, &self.q, t);
                if settling && stays {
                    self.from = Some((ending, if rate > 0.0 { 1 } else { 2 }));
                    return;
                }
                self.put_on_wall(side);
                self.leave(side, t);
                self.record(t, EventKind::MeshEnd, side);
            }
            Ending::PressingEnds(side) => {
                self.mode = Mode::Free;
                self.from = None;
                self.record(t, EventKind::MeshEnd, side);
            }
            Ending::Through(side) => {
                self.mode = Mode::Free;
                self.record(t, EventKind::MeshEnd, side.mirrored());
                self.contact(side, t, false);
            }
            Ending::Opens(side) => {
                self.mode = Mode::Open(side);
                self.from = Some((Ending::Closes(side), 1));
                self.record(t, EventKind::MeshEnd, side);
            }
            Ending::Closes(side) => {
                self.mode = Mode::Sustained(side);
                self.from = Some((Ending::Opens(side), 1));
                self.record(t, EventKind::MeshStart, side);
            }
            Ending::Returns(side) if side.sign() * self.q[1] < 0.0 => {
                self.put_on_wall(side);
                self.leave(side, t);
            }
            Ending::Returns(side) => self.contact(side, t, false),
            Ending::PulledOff(side) if settling && self.presses(self.free_field(), side, &self.q, t) => {
                self.from = Some((ending, 1));
            }
            Ending::PulledOff(side) => {
                self.mode = Mode::Free;
                self.from = Some((Ending::Contact(side), 3));
                self.record(t, EventKind::MeshEnd, side);
            }
        }
    }

    /// Applies the contact law when free motion reaches a wall.
    fn contact(&mut self, side: Side, t: f64, settling: bool) {
        self.put_on_wall(side);
        let closing = side.sign() * self.q[1];
        if settling && (closing < 0.0 || closing == 0.0 && !self.presses(self.free_field(), side, &self.q, t))
        {
            self.leave(side, t);
        } else if let (Contact::Elastic, Some(next)) = (self.contact_type(side), self.next_interval(side)) {
            let before = self.side_of_interval();
            self.interval = next;
            let kind =
                if before == Some(side.mirrored()) { EventKind::MeshEnd } else { EventKind::MeshStart };
            self.leave(side.mirrored(), t);
            self.record(t, kind, before.or(self.side_of_interval()).unwrap_or(side));
        } else if self.contact_type(side).is_elastic() && !self.closes(side, t) {
            self.mode = Mode::Open(side);
            self.from = Some((Ending::Returns(side), if closing > 0.0 { 1 } else { 2 }));
        } else if self.contact_type(side).is_elastic() {
            // The motion continues without a jump.
            self.mode = Mode::Sustained(side);
            self.from = Some((Ending::MeshEnds(side), if closing > 0.0 { 1 } else { 2 }));
            self.record(t, EventKind::MeshStart, side);
        } else {
            self.impact(side, t, closing.max(0.0));
        }
    }

    /// Applies the impact law and decides whether contact lasts: equations (5), (6), (22), (37) of the paper.
    fn impact(&mut self, side: Side, t: f64, closing: f64) {
        let (s, e) = (side.sign(), self.law.restitution[side.index()]);
        let leaving = e * closing;
        // The impulse acts in the direction of the gap.
        let kicked = |e: f64| {
            let [z, _, x, v] = self.q;
            [z, -s * e * closing, x, v - s * (1.0 + e) * closing * self.coordinates.kick()]
        };
        let (after, at_rest) = (kicked(e), kicked(0.0));
        let presses = |q: &Gap| {
            self.presses(self.free_field(), side, q, t)
                && (self.is_rigid(side) || self.presses(self.meshing_field(side), side, q, t))
        };
        let is_slow = leaving <= self.law.mesh_speed[side.index()];
        let is_series_over = !is_slow && e < 1.0 && self.law.mesh_speed[side.index()] == 0.0 && {
            let pressing = self.pressing(self.free_field(), side, &at_rest, t);
            let is_pressed = pressing > 0.0 && presses(&at_rest);
            is_pressed && 2.0 * leaving < SERIES_ENDS * (1.0 - e) * pressing * self.longest_step()
        };
        let rests = is_series_over || is_slow && self.is_rigid(side);
        let lasts = (is_slow || is_series_over) && presses(if rests { &at_rest } else { &after });
        self.q = if lasts && rests { at_rest } else { after };
        if !lasts {
            self.leave(side, t);
            self.record(t, EventKind::Impact, side);
            return;
        }
        (self.mode, self.from) = match (self.is_rigid(side), leaving > 0.0 && !rests) {
            (true, _) => (Mode::Stuck(side), None),
            (false, true) => (Mode::Onset(side), Some((Ending::OnsetEnds(side), 1))),
            (false, false) => (Mode::Sustained(side), Some((Ending::MeshEnds(side), 2))),
        };
        self.record(t, EventKind::MeshStart, side);
        if let Some(ended) = self.events.last_mut() {
            ended.after_series = is_series_over;
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

    fn record(&mut self, t: f64, kind: EventKind, side: Side) {
        let meshing = self.meshing();
        self.events.push(Ended { t, kind, side, meshing, after_series: false });
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
