//! Integrates a motion by short steps of matrix exponentials and finds events by bisection: slow, simple, and
//! independent of lanes.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use rattlemap_dynamics::model::{Contact, Domain, Law, Pair, State, state};

/// Steps per period. A crossing of a wall and back within one step is missed.
const STEPS: u32 = 1000;

/// Distance beyond a wall that counts as rounding.
const ROUNDING: f64 = 1e-14;

/// Displacements, velocities, cos, sin and 1.
type Vector = SVector<f64, 7>;
type Matrix = SMatrix<f64, 7, 7>;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Free,
    /// Behind an elastic wall, or behind a wall after the contact onset.
    Behind(usize),
    Onset(usize),
    Stuck(usize),
}

pub(super) struct March {
    oscillator: Pair,
    law: Law,
    inverse_mass: Matrix2<f64>,
    gap: Vector2<f64>,
    y: Vector,
    mode: Mode,
    pub(super) impacts: u32,
    /// Time spent in contact.
    pub(super) contact: f64,
    steps: Vec<(Mode, Matrix)>,
    free: Matrix,
}

const SIGN: [f64; 2] = [1.0, -1.0];

impl March {
    pub(super) fn new(oscillator: &Pair, law: Law, start: State) -> March {
        let [[a, b], [c, d]] = oscillator.mass;
        let [x1, v1, x2, v2, ..] = start;
        let mut march = March {
            oscillator: oscillator.clone(),
            law,
            inverse_mass: Matrix2::new(a, b, c, d).try_inverse().unwrap(),
            gap: Vector2::from(oscillator.gap),
            y: Vector::from([x1, x2, v1, v2, 1.0, 0.0, 1.0]),
            mode: Mode::Free,
            impacts: 0,
            contact: 0.0,
            steps: Vec::new(),
            free: Matrix::zeros(),
        };
        march.free = march.generator(Mode::Free);
        for side in [0, 1] {
            if march.beyond(&march.y.clone(), side) > 0.0 {
                if oscillator.contacts[side] == Contact::Rigid {
                    march.put_on_wall(side);
                    if SIGN[side] * march.rate(&march.y) > 0.0 {
                        march.contact(side);
                    }
                } else {
                    march.mode = Mode::Behind(side);
                }
            }
        }
        march
    }

    fn generator(&self, mode: Mode) -> Matrix {
        let domain: &Domain = match mode {
            Mode::Free | Mode::Stuck(_) => &self.oscillator.free,
            Mode::Behind(side) | Mode::Onset(side) => &self.oscillator.meshing[side],
        };
        let matrix = |m: [[f64; 2]; 2]| Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]);
        let mut push = self.inverse_mass;
        if let Mode::Stuck(_) = mode {
            let along = self.inverse_mass * self.gap;
            push -= along * along.transpose() / self.gap.dot(&along);
        }
        let mut g = Matrix::zeros();
        g.fixed_view_mut::<2, 2>(0, 2).fill_with_identity();
        g.fixed_view_mut::<2, 2>(2, 0).copy_from(&(-push * matrix(domain.stiffness)));
        g.fixed_view_mut::<2, 2>(2, 2).copy_from(&(-push * matrix(domain.damping)));
        g.fixed_view_mut::<2, 1>(2, 4).copy_from(&(push * Vector2::from(self.oscillator.force)));
        g.fixed_view_mut::<2, 1>(2, 5).copy_from(&(push * Vector2::from(self.oscillator.force_sin)));
        g.fixed_view_mut::<2, 1>(2, 6).copy_from(&(push * Vector2::from(domain.load)));
        g[(4, 5)] = -self.oscillator.omega;
        g[(5, 4)] = self.oscillator.omega;
        g
    }

    fn after(&self, t: f64) -> Vector {
        (self.generator(self.mode) * t).exp() * self.y
    }

    fn step(&mut self, h: f64) -> Vector {
        let mode = self.mode;
        if let Some((_, step)) = self.steps.iter().find(|(of, _)| *of == mode) {
            return step * self.y;
        }
        let step = (self.generator(mode) * h).exp();
        self.steps.push((mode, step));
        step * self.y
    }

    fn beyond(&self, y: &Vector, side: usize) -> f64 {
        SIGN[side] * (self.gap.dot(&y.fixed_rows::<2>(0)) - self.oscillator.walls[side])
    }

    fn rate(&self, y: &Vector) -> f64 {
        self.gap.dot(&y.fixed_rows::<2>(2))
    }

    /// Returns the acceleration of the gap into a wall, in the free field or behind the wall.
    fn pressing(&self, y: &Vector, mode: Mode, side: usize) -> f64 {
        let field = if mode == Mode::Free { self.free } else { self.generator(mode) };
        SIGN[side] * self.gap.dot(&(field * y).fixed_rows::<2>(2))
    }

    /// Returns a distance that is positive until an event.
    fn distance(&self, y: &Vector, event: Event) -> f64 {
        match event {
            Event::Contact(side) | Event::OnsetEnds(side) => -self.beyond(y, side),
            Event::Return(side) => self.beyond(y, side),
            Event::Release(side) => self.pressing(y, Mode::Free, side),
            Event::PressingEnds(side) => self.pressing(y, Mode::Onset(side), side),
        }
    }

    fn events(&self) -> Vec<Event> {
        let walls = (0..2).filter(|&side| self.oscillator.walls[side].is_finite());
        match self.mode {
            Mode::Free => walls.map(Event::Contact).collect(),
            Mode::Behind(side) => vec![Event::Return(side)],
            Mode::Onset(side) => vec![Event::OnsetEnds(side), Event::PressingEnds(side)],
            Mode::Stuck(side) => vec![Event::Release(side)],
        }
    }

    pub(super) fn period(&mut self) -> State {
        let h = self.oscillator.period() / f64::from(STEPS);
        for _ in 0..STEPS {
            let mut left = h;
            for events in 0.. {
                assert!(events < 1000, "no progress: {:?}, {:?}", self.oscillator, self.law);
                let end = if left == h { self.step(h) } else { self.after(left) };
                let crossed: Vec<Event> = self
                    .events()
                    .into_iter()
                    .filter(|&event| self.distance(&end, event) < -ROUNDING)
                    .collect();
                let first = crossed.into_iter().map(|event| (self.locate(event, left), event));
                let first = first.min_by(|(a, _), (b, _)| a.total_cmp(b));
                let flown = first.map_or(left, |(t, _)| t);
                if self.mode != Mode::Free {
                    self.contact += flown;
                }
                let Some((t, event)) = first else {
                    self.y = end;
                    break;
                };
                self.y = self.after(t);
                left -= t;
                self.act(event);
            }
        }
        let mut y = self.y;
        (y[4], y[5]) = (1.0, 0.0);
        self.y = y;
        state(&[y[0], y[2], y[1], y[3]])
    }

    /// Returns the time at which the distance falls through zero. A gap that leaves a wall is off it at once.
    fn locate(&self, event: Event, span: f64) -> f64 {
        let (mut low, mut high) = (0.0, span);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.distance(&self.after(middle), event) > 0.0 { low = middle } else { high = middle }
        }
        high
    }

    /// Moves the gap onto a wall and keeps the other displacement.
    fn put_on_wall(&mut self, side: usize) {
        let i = usize::from(self.gap[0].abs() < self.gap[1].abs());
        self.y[i] -= SIGN[side] * self.beyond(&self.y.clone(), side) / self.gap[i];
    }

    fn act(&mut self, event: Event) {
        match event {
            Event::Contact(side) => {
                self.put_on_wall(side);
                if self.oscillator.contacts[side] == Contact::Elastic {
                    self.mode = Mode::Behind(side);
                } else {
                    self.contact(side);
                }
            }
            Event::OnsetEnds(side) => {
                self.put_on_wall(side);
                self.mode = Mode::Behind(side);
            }
            Event::Return(side) => {
                self.put_on_wall(side);
                self.mode = Mode::Free;
            }
            Event::Release(_) | Event::PressingEnds(_) => self.mode = Mode::Free,
        }
    }

    /// Applies an impulse along the gap that removes `share` of its rate.
    fn push(&mut self, share: f64) {
        let along = self.inverse_mass * self.gap;
        let impulse = along * (share * self.rate(&self.y) / self.gap.dot(&along));
        self.y[2] -= impulse[0];
        self.y[3] -= impulse[1];
    }

    fn contact(&mut self, side: usize) {
        let (e, threshold) = (self.law.restitution[side], self.law.mesh_speed[side]);
        let leaving = e * self.rate(&self.y).abs();
        let before = self.y;
        if self.oscillator.contacts[side] == Contact::Rigid {
            self.push(1.0);
            // Ends an infinite sequence of impacts early enough for these tests.
            if leaving <= threshold.max(1e-8) && self.pressing(&self.y, Mode::Free, side) > 0.0 {
                self.mode = Mode::Stuck(side);
                return;
            }
            self.y = before;
        }
        self.push(1.0 + e);
        let presses = |mode| self.pressing(&self.y, mode, side) > 0.0;
        let yields = self.oscillator.contacts[side] == Contact::Impact;
        if yields && leaving <= threshold && presses(Mode::Free) && presses(Mode::Behind(side)) {
            self.mode = if leaving > 0.0 { Mode::Onset(side) } else { Mode::Behind(side) };
            return;
        }
        self.impacts += 1;
    }
}

#[derive(Clone, Copy, Debug)]
enum Event {
    Contact(usize),
    OnsetEnds(usize),
    Return(usize),
    Release(usize),
    PressingEnds(usize),
}
