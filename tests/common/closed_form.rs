//! One coordinate between walls in closed form: `m x'' + c x' + k x = F cos(omega t) + load` from event to event.
//! Only the times of events are searched for, by bisection. Written from the equations of motion, for tests alone.

use super::linear::unforced;
use rattlemap_dynamics::model::{Contact, Domain, Law, Pair};
use rattlemap_dynamics::motion::EventKind;

/// A linear oscillator under `force cos(omega t) + load`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    pub(crate) m: f64,
    pub(crate) c: f64,
    pub(crate) k: f64,
    pub(crate) force: f64,
    pub(crate) omega: f64,
    pub(crate) load: f64,
}

impl Linear {
    pub(crate) fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// Returns the steady state at a time; without spring and damping, its bounded part.
    pub(crate) fn steady(&self, t: f64) -> [f64; 2] {
        let (re, im) = (self.k - self.m * self.omega * self.omega, self.c * self.omega);
        let (sin, cos) = (self.omega * t).sin_cos();
        let gain = self.force / (re * re + im * im);
        let middle = if self.k == 0.0 { 0.0 } else { self.load / self.k };
        [gain * (re * cos + im * sin) + middle, gain * self.omega * (im * cos - re * sin)]
    }

    /// Returns the propagator of the unforced oscillator.
    pub(crate) fn propagator(&self, tau: f64) -> [[f64; 2]; 2] {
        let (decay, square) = (self.c / (2.0 * self.m), self.k / self.m);
        let discriminant = square - decay * decay;
        let rate = discriminant.abs().sqrt();
        let (cos, sin) = match discriminant {
            d if d > 0.0 => ((rate * tau).cos(), (rate * tau).sin() / rate),
            d if d < 0.0 => ((rate * tau).cosh(), (rate * tau).sinh() / rate),
            _ => (1.0, tau),
        };
        let e = (-decay * tau).exp();
        [[e * (cos + decay * sin), e * sin], [-e * square * sin, e * (cos - decay * sin)]]
    }

    /// Returns the state a time `tau` after the state `y` at time `t`.
    pub(crate) fn after(&self, t: f64, y: [f64; 2], tau: f64) -> [f64; 2] {
        let (from, to) = (self.steady(t), self.steady(t + tau));
        let [[a, b], [c, d]] = self.propagator(tau);
        let q = [y[0] - from[0], y[1] - from[1]];
        let [fallen, speed] = self.fall(tau);
        [a * q[0] + b * q[1] + to[0] + fallen, c * q[0] + d * q[1] + to[1] + speed]
    }

    /// Returns the effect of a load, from rest and without a spring: a parabola, or a fall with a damper.
    fn fall(&self, tau: f64) -> [f64; 2] {
        match (self.k == 0.0, self.c == 0.0) {
            (false, _) => [0.0; 2],
            (true, true) => {
                let fall = self.load / self.m;
                [0.5 * fall * tau * tau, fall * tau]
            }
            (true, false) => {
                let (last, lag) = (self.load / self.c, self.m / self.c);
                let gained = -(-tau / lag).exp_m1();
                [last * (tau - lag * gained), last * gained]
            }
        }
    }

    pub(crate) fn acceleration(&self, t: f64, [x, v]: [f64; 2]) -> f64 {
        (self.force * (self.omega * t).cos() + self.load - self.c * v - self.k * x) / self.m
    }

    /// Returns the equation as the first displacement of a domain.
    pub(crate) fn domain(&self) -> Domain {
        let first = |value: f64| [[value, 0.0], [0.0, 0.0]];
        Domain { damping: first(self.c), stiffness: first(self.k), load: [self.load, 0.0] }
    }
}

/// A wall.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wall {
    /// A wall with this restitution. A gap that is at rest on it and pressed sticks.
    Rigid { at: f64, e: f64 },
    /// A wall of a spring and a damper.
    Elastic { at: f64, k: f64, c: f64 },
}

/// An oscillator with walls on the right and on the left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Walled {
    pub(crate) free: Linear,
    pub(crate) walls: [Option<Wall>; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Free,
    Behind(usize),
    Stuck(usize),
}

const SIGNS: [f64; 2] = [1.0, -1.0];
/// Points per period at which signs are compared.
const PLACES: usize = 4000;

/// Returns the first time up to `rest` at which a condition holds, by steps of `h` and bisection.
pub(crate) fn first_time(h: f64, rest: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut steps = (1..).map(|j| h * f64::from(j)).take_while(|&tau| tau < rest).chain([rest]);
    let mut hi = steps.find(|&tau| holds(tau))?;
    let mut lo = (hi - h).max(0.0);
    for _ in 0..60 {
        let middle = 0.5 * (lo + hi);
        if holds(middle) { hi = middle } else { lo = middle }
    }
    Some(hi)
}

impl Walled {
    /// Returns the oscillator and its law for the library.
    pub(crate) fn oscillator(&self) -> (Pair, Law) {
        let at = |i: usize| self.walls[i].map_or(SIGNS[i] * f64::INFINITY, |wall| wall.at());
        let contact = |i: usize| match self.walls[i] {
            Some(Wall::Elastic { .. }) => Contact::Elastic,
            _ => Contact::Rigid,
        };
        let restitution = |i: usize| match self.walls[i] {
            Some(Wall::Rigid { e, .. }) => e,
            _ => 0.0,
        };
        let oscillator = Pair {
            mass: [[self.free.m, 0.0], [0.0, 1.0]],
            walls: [at(0), at(1)],
            contacts: [contact(0), contact(1)],
            omega: self.free.omega,
            force: [self.free.force, 0.0],
            meshing: [self.behind(0).domain(), self.behind(1).domain()],
            ..unforced(1, self.free.domain())
        };
        (oscillator, Law { restitution: [restitution(0), restitution(1)], mesh_speed: [0.0; 2] })
    }

    /// Returns the motion behind an elastic wall; free motion if there is no wall.
    fn behind(&self, i: usize) -> Linear {
        match self.walls[i] {
            Some(Wall::Elastic { at, k, c }) => {
                Linear { k: self.free.k + k, c: self.free.c + c, load: self.free.load + k * at, ..self.free }
            }
            _ => self.free,
        }
    }

    /// Returns the state after so many periods, and the events with wall and time since phase 0 of the first period.
    /// The start lies between the walls, behind an elastic one, or at rest on a rigid one.
    pub(crate) fn run(&self, start: [f64; 2], periods: u32) -> ([f64; 2], Vec<(f64, EventKind, usize)>) {
        let period = std::f64::consts::TAU / self.free.omega;
        let beyond = |i: usize, x: f64| self.walls[i].map_or(-1.0, |wall| SIGNS[i] * (x - wall.at()));
        let (mut y, mut events) = (start, Vec::new());
        let mut mode = [0, 1].into_iter().find(|&i| beyond(i, y[0]) > 0.0).map_or(Mode::Free, Mode::Behind);
        let pressed = |i: usize| SIGNS[i] * self.free.acceleration(0.0, start) > 0.0;
        if let Some(i) = (0..2).find(|&i| beyond(i, y[0]) == 0.0 && y[1] == 0.0 && pressed(i)) {
            mode = Mode::Stuck(i);
        }
        for n in 0..periods {
            let (mut t, h) = (0.0, period / PLACES as f64);
            loop {
                let (field, rest) =
                    (if let Mode::Behind(i) = mode { self.behind(i) } else { self.free }, period - t);
                let is_stuck = matches!(mode, Mode::Stuck(_));
                let state = |tau: f64| if is_stuck { y } else { field.after(t, y, tau) };
                // Positive until the motion in this mode ends.
                let left = |i: usize, tau: f64| match mode {
                    Mode::Free => -beyond(i, state(tau)[0]),
                    Mode::Behind(_) => beyond(i, state(tau)[0]),
                    Mode::Stuck(_) => SIGNS[i] * self.free.acceleration(t + tau, y),
                };
                let watched: &[usize] = match mode {
                    Mode::Free => &[0, 1],
                    Mode::Behind(0) | Mode::Stuck(0) => &[0],
                    _ => &[1],
                };
                let ended = |tau: f64| watched.iter().copied().find(|&i| left(i, tau) < 0.0);
                let Some(flown) = first_time(h, rest, |tau| ended(tau).is_some()) else {
                    y = state(rest);
                    break;
                };
                let i = ended(flown).expect("a wall");
                y = state(flown);
                t += flown;
                let s = SIGNS[i];
                assert!(events.len() < 1000, "infinitely many impacts");
                let wall = self.walls[i].expect("reached");
                let mut record = |kind| events.push((f64::from(n) * period + t, kind, i));
                mode = match (mode, wall) {
                    (Mode::Free, Wall::Elastic { .. }) => {
                        record(EventKind::MeshStart);
                        Mode::Behind(i)
                    }
                    (Mode::Free, Wall::Rigid { at, e }) => {
                        y = [at, -e * y[1]];
                        let sticks = y[1] == 0.0 && s * self.free.acceleration(t, y) > 0.0;
                        record(if sticks { EventKind::MeshStart } else { EventKind::Impact });
                        if sticks { Mode::Stuck(i) } else { Mode::Free }
                    }
                    _ => {
                        record(EventKind::MeshEnd);
                        Mode::Free
                    }
                };
            }
        }
        (y, events)
    }
}

impl Wall {
    fn at(&self) -> f64 {
        match *self {
            Wall::Rigid { at, .. } | Wall::Elastic { at, .. } => at,
        }
    }
}
