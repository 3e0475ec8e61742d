//! The motion of an oscillator by matrix exponentials, written from the description of the oscillator alone.
//!
//! The state is extended by a constant 1 and by cosine and sine of each harmonic, so that every domain is `y' = A y`. A step is a
//! product with a stored exponential. Near a wall, Taylor series of the step are searched for roots between the extrema.

use crate::common::pairs::{Friction, Rubbing};
use nalgebra::{Matrix2, Matrix4, RowSVector, RowVector4, SMatrix, SVector, Vector2, Vector4};
use rattlemap_dynamics::model::{Contact, Domain, Law, Side, Stage, State, state};

/// Largest number of harmonics, the first one included.
pub(crate) const HARMONICS: usize = 5;

/// Entries of a state: displacements and velocities, 1, and a pair for each harmonic.
const SIZE: usize = 5 + 2 * HARMONICS;

/// A step, in radians of the fastest rate.
pub(crate) const ANGLE: f64 = 0.2;

/// Terms of Taylor series: `0.2^15 / 15!` is far below rounding.
const TERMS: usize = 15;

/// Relative errors of velocities that stand for those of rounding, which are smaller.
const SHAKEN: f64 = 1e-12;

/// Relative size of numbers that are zero but for rounding.
const ROUNDING: f64 = 1e-12;

/// Largest number of events in a part of a period.
const MOST_EVENTS: u32 = 20_000;

type Vector = SVector<f64, SIZE>;
type Row = RowSVector<f64, SIZE>;
type Generator = SMatrix<f64, SIZE, SIZE>;

/// Returns the largest difference of two states relative to the larger state, with velocities divided by a rate.
pub(crate) fn distance(a: State, b: State, rate: f64) -> f64 {
    let scaled = |y: State| [y[0], y[1] / rate, y[2], y[3] / rate];
    let (a, b) = (Vector4::from(scaled(a)), Vector4::from(scaled(b)));
    let apart = (a - b).amax();
    if apart == 0.0 { 0.0 } else { apart / a.amax().max(b.amax()) }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Free,
    /// Contact has begun with a leaving speed, and the gap is in front of the wall.
    Onset(Side),
    /// The gap is behind the wall.
    Sustained(Side),
    /// The gap is behind a wall that only pushes, and no force acts.
    Open(Side),
    /// The gap is at rest on a rigid wall.
    Stuck(Side),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    Impact,
    Begins,
    Ends,
}

/// What an element with dry friction does: it sticks, or slides with a positive or a negative rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Grip {
    Stick,
    Plus,
    Minus,
}

impl Grip {
    const ALL: [Grip; 3] = [Grip::Stick, Grip::Plus, Grip::Minus];

    fn sign(self) -> f64 {
        [0.0, 1.0, -1.0][self as usize]
    }
}

/// What ends a flight.
#[derive(Clone, Copy, Debug)]
enum End {
    /// Sliding of an element.
    Rests(usize),
    /// Sticking of an element.
    Slips(usize, Grip),
    Reaches(Side),
    OnsetEnds(Side),
    FallsBack(Side),
    PressingEnds(Side),
    PulledOff(Side),
    Opens(Side),
    Closes(Side),
    Returns(Side),
}

/// Returns the exponential of a matrix by scaling and squaring of its series.
fn exponential<const N: usize>(a: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let size = a.row_iter().map(|row| row.abs().sum()).fold(0.0, f64::max);
    let doublings = (2.0 * size).log2().ceil().max(0.0) as i32;
    let small = a * 2f64.powi(-doublings);
    let one = SMatrix::<f64, N, N>::identity();
    let mut sum = (1..=18).rev().fold(one, |sum, k| one + small * sum / f64::from(k));
    for _ in 0..doublings {
        sum *= sum;
    }
    sum
}

/// One linear domain.
struct Linear {
    a: Generator,
    /// Length of a step and its exponential.
    step: (f64, Generator),
    /// Row of the gap's acceleration. On a rigid wall it is that without the wall.
    pressing: Row,
    /// Rows of the forces that make elements stick while all else holds.
    hold: [Row; 2],
}

impl Linear {
    fn new((a, pressing, hold): (Generator, Row, [Row; 2]), fastest: f64, angle: f64) -> Linear {
        // With few digits, sums of steps have hardly any rounding error.
        let h = f64::from((angle / fastest) as f32);
        Linear { a, step: (h, exponential(a * h)), pressing, hold }
    }

    /// Returns the coefficients of the state as a polynomial of the share of a step.
    fn series(&self, y: &Vector, h: f64) -> [Vector; TERMS + 1] {
        let mut terms = [*y; TERMS + 1];
        for k in 1..=TERMS {
            terms[k] = self.a * terms[k - 1] * (h / k as f64);
        }
        terms
    }
}

/// The domains of a stage: free, and in contact with the right and the left wall, for each combination of grips.
struct Stages {
    domains: Vec<Linear>,
    /// Rows of the forces of spring, damper and preload behind the right and the left wall, if these only push.
    pushing: [Option<Row>; 2],
}

/// An oscillator with its exponentials.
pub(crate) struct System {
    stages: Vec<Stages>,
    schedule: Vec<(f64, usize)>,
    walls: [f64; 2],
    contacts: [Contact; 2],
    pub(crate) period: f64,
    pub(crate) degrees: usize,
    orders: Vec<u32>,
    per_mass: Matrix2<f64>,
    gap: Vector2<f64>,
    /// Change of both velocities by an impulse that changes the gap's rate by 1.
    kick: Vector2<f64>,
    /// Rows of the gap and of its rate.
    z: Row,
    w: Row,
    /// Elements with a force, their rows, and rows of their sliding rates.
    friction: Vec<Friction>,
    along: Vec<Vector2<f64>>,
    slides: Vec<Row>,
    /// Systems between further walls on the right and on the left, from the inside to the outside.
    behind: [Vec<System>; 2],
}

/// Returns the oscillator between the `nth` wall on a side, from 1, and the next one.
fn between_walls(o: &Rubbing, side: Side, nth: usize) -> Rubbing {
    let (i, mut found) = (side.index(), o.clone());
    found.outer_walls = Default::default();
    let mut walls = vec![(o.walls[i], o.contacts[i])];
    walls.extend(o.outer_walls[i].iter().map(|wall| (wall.at, wall.contact)));
    let stages = o.stages.len() + 1;
    let of = |stage: usize| {
        let first = if stage == 0 { Stage { free: o.free, meshing: o.meshing } } else { o.stages[stage - 1] };
        let mut domains = vec![first.free, first.meshing[i]];
        domains.extend(o.outer_walls[i].iter().map(|wall| wall.meshing[stage]));
        let mut meshing = [domains[nth]; 2];
        meshing[i] = domains[nth + 1];
        meshing[1 - i] = domains[nth - 1];
        Stage { free: domains[nth], meshing }
    };
    (found.walls[i], found.contacts[i]) = walls[nth];
    (found.walls[1 - i], found.contacts[1 - i]) = (walls[nth - 1].0, Contact::Elastic);
    let first = of(0);
    (found.free, found.meshing) = (first.free, first.meshing);
    found.stages = (1..stages).map(of).collect();
    found
}

fn matrix(m: [[f64; 2]; 2]) -> Matrix2<f64> {
    Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1])
}

/// Returns the row of a combination of displacements (`at` 0) or velocities (1).
fn row_of(along: Vector2<f64>, at: usize) -> Row {
    let mut row = Row::zeros();
    (row[at], row[at + 2]) = (along[0], along[1]);
    row
}

/// Returns for each of the combinations of velocities the change of velocities by an impulse that changes it by 1 while those before it
/// are held, and that impulse. Both are 0 for a combination that those before it hold.
fn bonds(per_mass: Matrix2<f64>, rows: &[Vector2<f64>]) -> Vec<(Vector2<f64>, f64)> {
    let mut mobility = per_mass;
    let bond = |row: &Vector2<f64>| {
        let change = mobility * row;
        let along = row.dot(&change);
        if along <= ROUNDING * row.dot(&(per_mass * row)) {
            return (Vector2::zeros(), 0.0);
        }
        mobility -= change * change.transpose() / along;
        (change / along, 1.0 / along)
    };
    rows.iter().map(bond).collect()
}

/// Returns the generator of motion in which combinations of velocities are constant.
fn bound(mut a: Generator, per_mass: Matrix2<f64>, rows: &[Vector2<f64>]) -> Generator {
    for (row, (change, _)) in rows.iter().zip(bonds(per_mass, rows)) {
        let rate = row_of(*row, 1) * a;
        a.set_row(1, &(a.row(1) - rate * change[0]));
        a.set_row(3, &(a.row(3) - rate * change[1]));
    }
    a
}

impl System {
    /// Builds the system with steps of `angle` radians of the fastest rate.
    pub(crate) fn new(o: &Rubbing, angle: f64) -> System {
        let mut harmonics = vec![(1, o.force, o.force_sin)];
        harmonics.extend(o.harmonics.iter().map(|h| (h.order, h.cos, h.sin)));
        let per_mass = matrix(o.mass).try_inverse().expect("a mass matrix");
        let gap = Vector2::from(o.gap);
        let kick = bonds(per_mass, &[gap])[0].0;
        let (z, w) = (row_of(gap, 0), row_of(gap, 1));
        let friction: Vec<_> = o.friction.iter().copied().filter(|friction| friction.force > 0.0).collect();
        let along: Vec<_> = friction.iter().map(|friction| Vector2::from(friction.row)).collect();
        let generator = |domain: &Domain| {
            let mut a = Generator::zeros();
            (a[(0, 1)], a[(2, 3)]) = (1.0, 1.0);
            let put = |a: &mut Generator, column: usize, force: Vector2<f64>| {
                let acceleration = per_mass * force;
                (a[(1, column)], a[(3, column)]) = (acceleration[0], acceleration[1]);
            };
            for i in 0..2 {
                put(&mut a, 2 * i, -matrix(domain.stiffness).column(i));
                put(&mut a, 2 * i + 1, -matrix(domain.damping).column(i));
            }
            put(&mut a, 4, domain.load.into());
            for (i, (order, cos, sin)) in harmonics.iter().enumerate() {
                let (c, s) = (5 + 2 * i, 6 + 2 * i);
                put(&mut a, c, (*cos).into());
                put(&mut a, s, (*sin).into());
                let rate = f64::from(*order) * o.omega;
                (a[(c, s)], a[(s, c)]) = (-rate, rate);
            }
            a
        };
        let highest = harmonics.iter().map(|harmonic| f64::from(harmonic.0)).fold(1.0, f64::max);
        let rate = |domain: &Domain| {
            let norm = |m| {
                let m: Matrix2<f64> = per_mass * matrix(m);
                m.row_iter().map(|row| row.abs().sum()).fold(0.0, f64::max)
            };
            (norm(domain.stiffness).sqrt() + norm(domain.damping)).max(highest * o.omega)
        };
        let stage = |Stage { free, meshing }: Stage| {
            let freely = generator(&free);
            let behind = |side: Side| match o.contacts[side.index()] {
                _ if o.walls[side.index()].is_infinite() => (freely, &free, false),
                Contact::Rigid => (freely, &free, true),
                _ => (generator(&meshing[side.index()]), &meshing[side.index()], false),
            };
            let [right, left] = Side::BOTH.map(behind);
            // A rigid wall cancels the acceleration of the gap by an impulse per time.
            let linear = |slot: usize, (mut a, domain, is_held): (Generator, &Domain, bool)| {
                let grips: Vec<_> =
                    (0..along.len()).map(|i| Grip::ALL[slot / 3usize.pow(i as u32) % 3]).collect();
                for ((row, friction), grip) in along.iter().zip(&friction).zip(&grips) {
                    let change = per_mass * row * (friction.force * grip.sign());
                    a[(1, 4)] -= change[0];
                    a[(3, 4)] -= change[1];
                }
                let stick: Vec<usize> = (0..along.len()).filter(|&i| grips[i] == Grip::Stick).collect();
                let with = |of: &[usize]| -> Vec<Vector2<f64>> {
                    is_held.then_some(gap).into_iter().chain(of.iter().map(|&i| along[i])).collect()
                };
                let all = with(&stick);
                let moves = bound(a, per_mass, &all);
                let mut pressing = w * moves;
                if is_held {
                    // Elements that the wall holds are idle.
                    let held = bonds(per_mass, &all);
                    let busy: Vec<_> = (1..all.len()).filter(|&i| held[i].1 > 0.0).map(|i| all[i]).collect();
                    pressing = w * bound(a, per_mass, &busy);
                }
                let mut hold = [Row::zeros(); 2];
                for &i in &stick {
                    let others: Vec<usize> = stick.iter().copied().filter(|&other| other != i).collect();
                    let (others, last) = (with(&others), with(&[&others[..], &[i]].concat()));
                    let impulse = bonds(per_mass, &last)[others.len()].1;
                    hold[i] = row_of(along[i], 1) * bound(a, per_mass, &others) * impulse;
                }
                Linear::new((moves, pressing, hold), rate(domain), angle)
            };
            let slots = 0..3usize.pow(along.len() as u32);
            let domains = slots
                .flat_map(|slot| [(freely, &free, false), right, left].map(|base| linear(slot, base)))
                .collect();
            let pushing = Side::BOTH.map(|side| {
                let (i, g) = (side.index(), Vector2::from(o.gap));
                let along = |m: Matrix2<f64>| g.dot(&(m * g)) / g.norm_squared().powi(2);
                let behind = &meshing[i];
                let k = along(matrix(behind.stiffness) - matrix(free.stiffness));
                let c = along(matrix(behind.damping) - matrix(free.damping));
                // Without a damper, the difference of the matrices is rounding.
                let c = if behind.damping == free.damping { 0.0 } else { c };
                let mut row = (z * k + w * c) * sign(side);
                row[4] = behind.preload - sign(side) * k * o.walls[i];
                let may_pull = c == 0.0 && behind.preload == 0.0;
                (o.contacts[i] == Contact::Pushing && row[4].is_finite() && !may_pull).then_some(row)
            });
            Stages { domains, pushing }
        };
        let first = Stage { free: o.free, meshing: o.meshing };
        System {
            stages: std::iter::once(first).chain(o.stages.iter().copied()).map(stage).collect(),
            schedule: o.schedule.clone(),
            walls: o.walls,
            contacts: o.contacts,
            period: std::f64::consts::TAU / o.omega,
            degrees: o.degrees,
            orders: harmonics.iter().map(|harmonic| harmonic.0).collect(),
            per_mass,
            gap,
            kick,
            z,
            w,
            slides: (friction.iter().zip(&along))
                .map(|(friction, along)| {
                    let mut row = row_of(*along, 1);
                    row[4] = -friction.speed;
                    row
                })
                .collect(),
            friction,
            along,
            behind: Side::BOTH.map(|side| {
                let count = o.outer_walls[side.index()].len();
                (1..=count).map(|nth| System::new(&between_walls(o, side, nth), angle)).collect()
            }),
        }
    }

    fn between(&self, interval: i32) -> Option<&System> {
        match interval {
            0 => Some(self),
            1.. => self.behind[0].get(interval as usize - 1),
            _ => self.behind[1].get(interval.unsigned_abs() as usize - 1),
        }
    }
}

/// A motion, with the derivative of its state by that at the start.
#[derive(Clone)]
pub(crate) struct Motion<'a> {
    /// The system between the present walls, and between the first ones.
    pub(crate) system: &'a System,
    whole: &'a System,
    /// 0 between the first walls, n behind the nth right wall, -n behind the nth left wall.
    interval: i32,
    law: Law,
    stage: usize,
    pub(crate) mode: Mode,
    /// Of a missing element: [`Grip::Stick`].
    pub(crate) grips: [Grip; 2],
    y: Vector,
    pub(crate) t: f64,
    /// The wall that the gap is just leaving, and the order of that root. Friction may hold the gap there.
    leaves: Option<(Side, usize)>,
    /// Whether the force of a wall that only pushes is zero now.
    is_unloaded: bool,
    /// Whether a contact onset has no acceleration now.
    is_unpressed: bool,
    /// Orders of roots of the sliding rates now.
    orders: [usize; 2],
    /// Distances that the elements have slid, which the caller may clear.
    pub(crate) slid: [f64; 2],
    /// Elements that never slide, so that their place does not matter.
    pub(crate) for_good: [bool; 2],
    /// The wall of the last event.
    origin: Option<Side>,
    pub(crate) tangents: Option<Matrix4<f64>>,
    /// Events and symbols of flights, which the caller may clear.
    pub(crate) events: Vec<(What, Side)>,
    pub(crate) symbols: Vec<u8>,
    pub(crate) meshing_time: f64,
    /// Relative errors of the velocities that are added in turn at events.
    shaken: [f64; 4],
    /// Rests on rigid walls and contact onsets that a change of the stage has ended.
    pub(crate) by_stage: [usize; 2],
}

fn index(side: Side) -> usize {
    if side == Side::Right { 1 } else { 2 }
}

fn sign(side: Side) -> f64 {
    if side == Side::Right { 1.0 } else { -1.0 }
}

impl<'a> Motion<'a> {
    /// Starts at phase 0 in a mode.
    pub(crate) fn new(system: &'a System, law: Law, start: State, mode: Mode) -> Motion<'a> {
        let mut y = Vector::zeros();
        y.fixed_rows_mut::<4>(0).copy_from_slice(&start[..4]);
        let holds_at_0 =
            system.schedule.first().filter(|(phase, _)| *phase == 0.0).or(system.schedule.last());
        let mut motion = Motion {
            system,
            whole: system,
            interval: 0,
            law,
            stage: holds_at_0.map_or(0, |&(_, stage)| stage),
            mode,
            grips: [Grip::Stick; 2],
            y,
            t: 0.0,
            leaves: None,
            is_unloaded: false,
            is_unpressed: false,
            orders: [0; 2],
            slid: [0.0; 2],
            for_good: [false; 2],
            origin: None,
            tangents: None,
            events: Vec::new(),
            symbols: Vec::new(),
            meshing_time: 0.0,
            shaken: [0.0; 4],
            by_stage: [0; 2],
        };
        motion.begin_period();
        motion.find_interval();
        if let Mode::Sustained(side) = motion.mode
            && !motion.closes(side)
        {
            motion.mode = Mode::Open(side);
        }
        motion.begin_grips();
        motion
    }

    /// Elements without a sliding rate are at rest.
    fn begin_grips(&mut self) {
        let [x, v] = [0, 1].map(|at| Vector2::new(self.y[at], self.y[at + 2]));
        for (i, friction) in self.system.friction.iter().enumerate() {
            let along = self.system.along[i].abs();
            let size = along.sum() * self.rate() * x.amax() + along.dot(&v.abs()) + friction.speed.abs();
            self.grips[i] = self.grip(i, ROUNDING * size);
        }
        self.decide();
        self.project();
        let z = (self.system.z * self.y)[0];
        let is_on = |side: &Side| (z - self.system.walls[side.index()]).abs() < ROUNDING;
        if self.is_gap_held() {
            self.leaves = Side::BOTH.into_iter().find(is_on).map(|side| (side, 3));
        }
    }

    /// Returns the direction of an element's sliding rate.
    fn grip(&self, i: usize, zero: f64) -> Grip {
        match (self.system.slides[i] * self.y)[0] {
            rate if rate.abs() <= zero => Grip::Stick,
            rate if rate > 0.0 => Grip::Plus,
            _ => Grip::Minus,
        }
    }

    /// Enters the interval of the gap.
    fn find_interval(&mut self) {
        let z = (self.system.z * self.y)[0];
        for side in Side::BOTH {
            let step = if side == Side::Right { 1 } else { -1 };
            while sign(side) * (z - self.system.walls[side.index()]) > 0.0
                && let Some(next) = self.whole.between(self.interval + step)
            {
                (self.system, self.interval) = (next, self.interval + step);
                let (wall, contact) = (next.walls[side.index()], next.contacts[side.index()]);
                self.mode = match contact {
                    Contact::Rigid if (z - wall).abs() < 1e-12 => Mode::Stuck(side),
                    _ if sign(side) * (z - wall) > 0.0 => Mode::Sustained(side),
                    _ => Mode::Free,
                };
            }
        }
    }

    /// Returns the rate that velocities are compared in.
    pub(crate) fn rate(&self) -> f64 {
        std::f64::consts::TAU / self.system.period
    }

    /// Returns the same motion with errors of velocities at each event that are larger than those of rounding: once of one sign, and
    /// once of two signs, since errors can cancel.
    pub(crate) fn shaken(&self) -> Vec<Motion<'a>> {
        let with = |signs: [f64; 4]| Motion { shaken: signs.map(|sign| SHAKEN * sign), ..self.clone() };
        vec![with([1.0; 4]), with([1.0, 1.0, -1.0, -1.0])]
    }

    /// Advances the shaken motions. Returns their largest distance from this one.
    pub(crate) fn noise(&self, shaken: &mut [Motion<'a>]) -> Option<f64> {
        shaken.iter_mut().try_for_each(Motion::advance_period)?;
        let off = |other: &Motion| distance(self.state(), other.state(), self.rate());
        Some(shaken.iter().map(off).fold(0.0, f64::max))
    }

    pub(crate) fn state(&self) -> State {
        state(self.vector().as_slice())
    }

    /// Returns both displacements and their velocities, `(x1, v1, x2, v2)`.
    pub(crate) fn vector(&self) -> Vector4<f64> {
        self.y.fixed_rows::<4>(0).into()
    }

    pub(crate) fn set_state(&mut self, state: State) {
        self.y.fixed_rows_mut::<4>(0).copy_from_slice(&state[..4]);
        self.project();
    }

    /// Begins to carry tangents. A gap at rest on a wall has no neighbours off the wall, and elements that stick have none with a rate.
    pub(crate) fn carry_tangents(&mut self) {
        let projection = |(i, change, _): &(Option<usize>, Vector2<f64>, Row)| {
            let (along, with_place) =
                i.map_or((self.system.gap, true), |i| (self.system.along[i], self.for_good[i]));
            at_rest(*change, along, with_place)
        };
        self.tangents = Some(self.held().iter().fold(Matrix4::identity(), |all, one| projection(one) * all));
    }

    /// Returns what is at rest: none for the gap or the number of an element, the change of velocities that stops it while those before
    /// it hold, and the row of its rate.
    fn held(&self) -> Vec<(Option<usize>, Vector2<f64>, Row)> {
        let System { per_mass, gap, along, slides, w, .. } = self.system;
        let on_wall = matches!(self.mode, Mode::Stuck(_)).then_some((None, *gap, *w));
        let sticking = (0..along.len()).filter(|&i| self.grips[i] == Grip::Stick);
        let all: Vec<_> =
            on_wall.into_iter().chain(sticking.map(|i| (Some(i), along[i], slides[i]))).collect();
        let rows: Vec<_> = all.iter().map(|one| one.1).collect();
        all.into_iter().zip(bonds(*per_mass, &rows)).map(|((i, _, row), bond)| (i, bond.0, row)).collect()
    }

    /// Removes rates of what is at rest.
    fn project(&mut self) {
        if self.system.friction.is_empty() {
            return;
        }
        for (_, change, row) in self.held() {
            let rate = (row * self.y)[0];
            self.y[1] -= change[0] * rate;
            self.y[3] -= change[1] * rate;
        }
    }

    /// Clears what the caller reads about a cycle.
    pub(crate) fn clear(&mut self) {
        self.events.clear();
        self.symbols.clear();
        self.meshing_time = 0.0;
        self.slid = [0.0; 2];
    }

    fn begin_period(&mut self) {
        self.t = 0.0;
        self.y[4] = 1.0;
        for i in 0..HARMONICS {
            (self.y[5 + 2 * i], self.y[6 + 2 * i]) =
                if i < self.system.orders.len() { (1.0, 0.0) } else { (0.0, 0.0) };
        }
    }

    /// Advances to the next phase 0. Returns none after too many events.
    pub(crate) fn advance_period(&mut self) -> Option<()> {
        let system = self.system;
        let mut at_end = None;
        for &(phase, stage) in &system.schedule {
            if phase == 0.0 {
                at_end = Some(stage);
            } else {
                self.run(phase * system.period)?;
                self.change(stage);
            }
        }
        self.run(system.period)?;
        self.begin_period();
        if let Some(stage) = at_end {
            self.change(stage);
        }
        self.y.iter().all(|x| x.abs() < 1e9).then_some(())
    }

    /// The state and the tangents are continuous at a change of the stage.
    fn change(&mut self, stage: usize) {
        self.stage = stage;
        let (grips, mode) = (self.grips, self.mode);
        match mode {
            Mode::Sustained(side) if !self.closes(side) => {
                self.ends(side);
                self.mode = Mode::Open(side);
            }
            Mode::Open(side) if self.closes(side) => {
                self.record(What::Begins, side);
                self.mode = Mode::Sustained(side);
            }
            _ => {}
        }
        self.settle(grips, None);
        self.by_stage[0] += usize::from(matches!(mode, Mode::Stuck(_)) && mode != self.mode);
        self.by_stage[1] += usize::from(matches!(mode, Mode::Onset(_)) && mode != self.mode);
    }

    /// Decides about all that is at rest, ends contacts that are not pressed, and records what the elements do then. They did `before`,
    /// and the sliding rate of `stops` has become 0.
    fn settle(&mut self, mut before: [Grip; 2], stops: Option<usize>) {
        let (mode, undecided) = (self.mode, self.grips);
        self.decide();
        let ended = match mode {
            Mode::Stuck(side) if !self.presses(side) => Some(side),
            Mode::Onset(side) if !self.is_unpressed && !self.is_gap_held() && !self.presses(side) => {
                Some(side)
            }
            _ => None,
        };
        if let Some(side) = ended {
            (self.mode, self.grips) = (Mode::Free, undecided);
            self.decide();
            // The cause comes first.
            if let Some(i) = stops {
                let mut first = self.grips;
                first[i] = before[i];
                self.mark(first, stops);
                before[i] = self.grips[i];
            }
            self.mode = mode;
            self.ends(side);
            if let Mode::Stuck(_) = mode {
                self.leave(side, true);
            }
        }
        self.let_go(before);
        self.mark(before, stops);
        self.project();
    }

    /// Friction that did `before` may let a gap go on a wall because forces have jumped. If they press the gap to the wall, contact begins.
    fn let_go(&mut self, before: [Grip; 2]) {
        let grips = std::mem::replace(&mut self.grips, before);
        let was_held = self.is_gap_held();
        self.grips = grips;
        let Some((side, _)) = self.leaves.filter(|leaves| was_held && leaves.1 > 1) else { return };
        if self.mode != Mode::Free || self.is_gap_held() {
            return;
        }
        self.leaves = Some((side, 2));
        if !self.presses(side) || self.contact(side).is_elastic() {
            return;
        }
        self.record(What::Begins, side);
        if self.contact(side) == Contact::Rigid {
            (self.mode, self.leaves) = (Mode::Stuck(side), None);
            for (grip, before) in
                self.grips.iter_mut().zip(before).filter(|(_, before)| *before == Grip::Stick)
            {
                *grip = before;
            }
        } else {
            self.mode = Mode::Sustained(side);
        }
    }

    /// Chooses the first consistent grips of elements at rest, in the order of sticking, positive and negative rate.
    fn decide(&mut self) {
        let before = self.grips;
        let rests = |i: usize| i < self.system.friction.len() && before[i] == Grip::Stick;
        let [first, second] = [0, 1].map(|i| if rests(i) { Grip::ALL.to_vec() } else { vec![before[i]] });
        let mut grips = first.iter().flat_map(|&a| second.iter().map(move |&b| [a, b]));
        let is_consistent = |&grips: &[Grip; 2]| {
            self.grips = grips;
            (0..2).filter(|&i| rests(i)).all(|i| self.is_consistent(i))
        };
        self.grips = grips.find(is_consistent).unwrap_or(before);
        for i in (0..2).filter(|&i| self.grips[i] != before[i]) {
            self.orders[i] = 1;
        }
    }

    /// Whether an element at rest keeps its grip.
    fn is_consistent(&self, i: usize) -> bool {
        let linear = self.linear(self.domain_index());
        let tends = |row: Row| first_not_zero(&row, &linear.a, &self.y);
        match self.grips[i] {
            Grip::Stick => self.limits(i).into_iter().all(|(room, _)| tends(room) >= 0.0),
            grip => grip.sign() * tends(self.system.slides[i] * linear.a) > 0.0,
        }
    }

    /// Returns rows of the rooms that the force which makes an element stick has, and what follows without room.
    fn limits(&self, i: usize) -> [(Row, Grip); 2] {
        [Grip::Plus, Grip::Minus].map(|grip| {
            let mut room = self.linear(self.domain_index()).hold[i] * -grip.sign();
            room[4] += self.system.friction[i].force;
            (room, grip)
        })
    }

    /// Whether friction holds the gap.
    fn is_gap_held(&self) -> bool {
        let System { friction, along, gap, .. } = self.system;
        let still = |i: &usize| self.grips[*i] == Grip::Stick && friction[*i].speed == 0.0;
        let still: Vec<_> = (0..friction.len()).filter(still).collect();
        let is_parallel = |&i: &usize| along[i].perp(gap).abs() <= ROUNDING * along[i].norm() * gap.norm();
        !matches!(self.mode, Mode::Stuck(_)) && (still.len() == 2 || still.iter().any(is_parallel))
    }

    /// Records the ends of sticking, and the reversal of one element.
    fn mark(&mut self, before: [Grip; 2], stops: Option<usize>) {
        for (i, (before, after)) in before.into_iter().zip(self.grips).enumerate() {
            if after == Grip::Stick || after == before {
                continue;
            }
            if before == Grip::Stick {
                self.symbols.push(b'7');
            } else if stops == Some(i) {
                self.symbols.push(b'0');
            }
        }
    }

    fn domain_index(&self) -> usize {
        match self.mode {
            Mode::Free | Mode::Open(_) => 0,
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => index(side),
        }
    }

    fn linear(&self, domain: usize) -> &'a Linear {
        let slot = self.grips[0] as usize + 3 * self.grips[1] as usize;
        &self.system.stages[self.stage].domains[domain + 3 * slot]
    }

    fn contact(&self, side: Side) -> Contact {
        self.system.contacts[side.index()]
    }

    fn pushing(&self, side: Side) -> Option<Row> {
        self.system.stages[self.stage].pushing[side.index()]
    }

    /// Whether a gap behind a wall is in contact.
    fn closes(&self, side: Side) -> bool {
        self.pushing(side).is_none_or(|row| first_not_zero(&row, &self.linear(0).a, &self.y) > 0.0)
    }

    /// Whether a gap at rest is pressed into a wall.
    fn presses(&self, side: Side) -> bool {
        let linear = self.linear(self.domain_index());
        !self.is_gap_held() && sign(side) * first_not_zero(&linear.pressing, &linear.a, &self.y) > 0.0
    }

    /// Integrates to a time within the present stage.
    pub(crate) fn run(&mut self, until: f64) -> Option<()> {
        let mut events = 0u32;
        while self.t < until {
            let linear = self.linear(self.domain_index());
            let (h, is_whole) = match until - self.t {
                rest if rest <= linear.step.0 => (rest, false),
                _ => (linear.step.0, true),
            };
            let mut series = None;
            let next = if is_whole {
                linear.step.1 * self.y
            } else {
                series.insert(linear.series(&self.y, h)).iter().sum()
            };
            let mut found = None;
            if !self.is_clear(&next, h) {
                let series = series.unwrap_or_else(|| linear.series(&self.y, h));
                found = self.first_end(&series).map(|(share, end)| {
                    let at = series.iter().rev().fold(Vector::zeros(), |sum, term| sum * share + term);
                    (share, end, if share == 0.0 { self.y } else { at })
                });
            }
            let share = found.map_or(1.0, |(share, ..)| share);
            if let Some(tangents) = &mut self.tangents {
                let a = |m: &Generator| m.fixed_view::<4, 4>(0, 0).into_owned();
                let moved = if is_whole && found.is_none() {
                    a(&linear.step.1)
                } else {
                    exponential(a(&linear.a) * (share * h))
                };
                *tangents = moved * *tangents;
            }
            if !matches!(self.mode, Mode::Free | Mode::Open(_)) || self.interval != 0 {
                self.meshing_time += share * h;
            }
            let to = found.map_or(next, |(_, _, at)| at);
            for (i, friction) in self.system.friction.iter().enumerate() {
                let moved = (row_of(self.system.along[i], 0) * (to - self.y))[0];
                self.slid[i] += self.grips[i].sign() * (moved - friction.speed * share * h);
            }
            if share > 0.0 {
                (self.is_unloaded, self.orders) = (false, [0; 2]);
                if !self.is_gap_held() {
                    (self.leaves, self.is_unpressed) = (None, false);
                }
            }
            self.y = to;
            match found {
                None => self.t = if is_whole { self.t + h } else { until },
                Some((_, end, _)) => {
                    self.t += share * h;
                    self.act(end, share == 0.0);
                    let error = self.shaken[events as usize % 4];
                    self.y[1] *= 1.0 + error;
                    self.y[3] *= 1.0 + error;
                    self.project();
                    events += 1;
                    if events > MOST_EVENTS {
                        return None;
                    }
                }
            }
        }
        Some(())
    }

    /// Returns the walls that the gap may meet.
    fn watched(&self) -> impl Iterator<Item = Side> + use<'a> {
        let (mode, walls, is_held) = (self.mode, self.system.walls, self.is_gap_held());
        [Side::Right, Side::Left].into_iter().filter(move |&side| match mode {
            _ if is_held => false,
            Mode::Free | Mode::Onset(_) => walls[side.index()].is_finite(),
            Mode::Sustained(own) | Mode::Open(own) => side == own,
            Mode::Stuck(_) => false,
        })
    }

    /// Returns the distance to a wall: from inside, or from behind in sustained contact.
    fn distance(&self, side: Side, y: &Vector) -> f64 {
        let inside = sign(side) * (self.system.walls[side.index()] - (self.system.z * y)[0]);
        if matches!(self.mode, Mode::Sustained(_) | Mode::Open(_)) { -inside } else { inside }
    }

    fn distance_rate(&self, side: Side, y: &Vector) -> f64 {
        let inside = -sign(side) * (self.system.w * y)[0];
        if matches!(self.mode, Mode::Sustained(_) | Mode::Open(_)) { -inside } else { inside }
    }

    /// Whether a step is certainly too far from every wall: the cubic through its ends stays away, with room for its error.
    fn is_clear(&self, next: &Vector, h: f64) -> bool {
        if !self.system.friction.is_empty()
            || self.leaves.is_some()
            || matches!(self.mode, Mode::Onset(_) | Mode::Stuck(_) | Mode::Open(_))
        {
            return false;
        }
        if matches!(self.mode, Mode::Sustained(side) if self.pushing(side).is_some()) {
            return false;
        }
        let row = self.system.w * self.linear(self.domain_index()).a;
        let room = 0.01 * h * h * row.iter().zip(self.y.iter()).map(|(a, y)| (a * y).abs()).sum::<f64>();
        self.watched().all(|side| {
            let (d0, d1) = (self.distance(side, &self.y), self.distance(side, next));
            let (r0, r1) = (self.distance_rate(side, &self.y), self.distance_rate(side, next));
            [d0, d0 + h * r0 / 3.0, d1 - h * r1 / 3.0, d1].iter().all(|d| *d > room)
        })
    }

    /// Returns the share of a step after which a flight ends, and what ends it.
    fn first_end(&self, series: &[Vector; TERMS + 1]) -> Option<(f64, End)> {
        let mut ends = Vec::new();
        for side in self.watched() {
            let mut c: Vec<f64> = series.iter().map(|term| self.distance(side, term)).collect();
            // The position of the wall belongs to the constant alone.
            let zero = self.distance(side, &Vector::zeros());
            c[1..].iter_mut().for_each(|c| *c -= zero);
            let order = self.leaves.filter(|leaves| leaves.0 == side).map_or(0, |leaves| leaves.1);
            let end = match self.mode {
                Mode::Sustained(_) => End::FallsBack(side),
                Mode::Open(_) => End::Returns(side),
                Mode::Onset(own) if side == own => End::OnsetEnds(side),
                _ => End::Reaches(side),
            };
            ends.extend(first_fall(&c[order..], order > 0).map(|share| (share, end)));
        }
        let is_held = self.is_gap_held();
        if let Mode::Onset(side) | Mode::Stuck(side) = self.mode
            && !is_held
        {
            let row = self.linear(index(side)).pressing;
            let c: Vec<f64> = series.iter().map(|term| sign(side) * (row * term)[0]).collect();
            let is_onset = matches!(self.mode, Mode::Onset(_));
            let end = if is_onset { End::PressingEnds(side) } else { End::PulledOff(side) };
            // Pressing may begin at zero.
            let zeros = c.iter().take_while(|c| **c == 0.0).count();
            let order = zeros.max(usize::from(self.is_unpressed));
            ends.extend(first_fall(&c[order..], order > 0).map(|share| (share, end)));
        }
        for i in 0..self.system.friction.len() {
            let watched = match self.grips[i] {
                Grip::Stick => self.limits(i).map(|(room, grip)| (room, 0, End::Slips(i, grip))).to_vec(),
                grip => vec![(self.system.slides[i] * grip.sign(), self.orders[i], End::Rests(i))],
            };
            for (row, order, end) in watched {
                let c: Vec<f64> = series[order..].iter().map(|term| (row * term)[0]).collect();
                ends.extend(first_fall(&c, order > 0).map(|share| (share, end)));
            }
        }
        if let Mode::Sustained(side) | Mode::Open(side) = self.mode
            && let Some(row) = self.pushing(side).filter(|_| !is_held)
        {
            let is_open = matches!(self.mode, Mode::Open(_));
            let (sign, end) = if is_open { (-1.0, End::Closes(side)) } else { (1.0, End::Opens(side)) };
            let c: Vec<f64> = series.iter().map(|term| sign * (row * term)[0]).collect();
            let order = usize::from(self.is_unloaded);
            ends.extend(first_fall(&c[order..], order > 0).map(|share| (share, end)));
        }
        ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn act(&mut self, end: End, at_start: bool) {
        let (mut grips, mut before) = (self.grips, self.field(self.domain_index()));
        let (z, one) = (self.system.z, Matrix4::identity());
        let of_pushing = |side| self.pushing(side).expect("the wall only pushes");
        let mut stops = None;
        let saltation = match end {
            End::Rests(i) => {
                (self.grips[i], stops) = (Grip::Stick, Some(i));
                Some((one, self.system.slides[i]))
            }
            End::Slips(i, grip) => {
                let (row, is_held) = (self.linear(self.domain_index()).hold[i], self.is_gap_held());
                (self.grips[i], self.orders[i]) = (grip, 2);
                if is_held && !self.is_gap_held() && !self.is_caught(i) {
                    self.mark(std::mem::replace(&mut grips, self.grips), None);
                    self.loosen();
                }
                Some((one, row))
            }
            End::Reaches(side) => {
                if let Mode::Onset(own) = self.mode {
                    self.ends(own);
                    self.jump(&one, &z, &before);
                    before = self.field(0);
                }
                self.reach(side, at_start).map(|reset| (reset, z))
            }
            End::OnsetEnds(side) => {
                (self.mode, self.leaves) = (Mode::Sustained(side), Some((side, 1)));
                None
            }
            End::FallsBack(side) => {
                if at_start && sign(side) * (self.system.w * self.y)[0] > 0.0 {
                    self.leaves = Some((side, 1));
                    return;
                }
                self.ends(side);
                self.leave(side, false);
                Some((one, z))
            }
            End::PressingEnds(side) => {
                let row = self.linear(index(side)).pressing;
                self.ends(side);
                Some((one, row))
            }
            End::Opens(side) => {
                let row = of_pushing(side);
                self.ends(side);
                (self.mode, self.is_unloaded) = (Mode::Open(side), true);
                Some((one, row))
            }
            End::Closes(side) => {
                let row = of_pushing(side);
                self.record(What::Begins, side);
                (self.mode, self.leaves, self.is_unloaded) = (Mode::Sustained(side), None, true);
                Some((one, row))
            }
            End::Returns(side) if sign(side) * (self.system.w * self.y)[0] < 0.0 => {
                self.leave(side, false);
                None
            }
            End::Returns(side) => self.reach(side, false).map(|reset| (reset, z)),
            End::PulledOff(side) => {
                // The acceleration is continuous, so tangents do not jump.
                self.ends(side);
                self.leaves = Some((side, 3));
                None
            }
        };
        self.settle(grips, stops);
        if let Some((reset, row)) = saltation {
            self.jump(&reset, &row, &before);
        }
    }

    /// Returns the sign of the acceleration that a gap begins to have when friction lets it go.
    fn growth(&self) -> f64 {
        let a = &self.linear(self.domain_index()).a;
        (self.system.w * (a * (a * self.y)))[0].signum()
    }

    /// An element slips that has held the gap. On a rigid wall it may be pressed into the wall, and rests on.
    fn is_caught(&mut self, i: usize) -> bool {
        let pressed = |&(side, _): &(Side, usize)| {
            self.mode == Mode::Free && self.contact(side) == Contact::Rigid && sign(side) == self.growth()
        };
        let Some((side, _)) = self.leaves.filter(pressed) else { return false };
        self.record(What::Begins, side);
        (self.mode, self.grips[i], self.leaves) = (Mode::Stuck(side), Grip::Stick, None);
        true
    }

    /// A gap moves that friction has held, without an acceleration at first.
    fn loosen(&mut self) {
        let growth = self.growth();
        match (self.mode, self.leaves) {
            (Mode::Onset(side), _) if sign(side) == growth => self.is_unpressed = true,
            (Mode::Onset(side), _) => self.ends(side),
            (Mode::Free, Some((side, _))) if sign(side) == growth => {
                self.record(What::Begins, side);
                (self.mode, self.leaves) = (Mode::Sustained(side), Some((side, 3)));
            }
            (_, leaves) => self.leaves = leaves.map(|(side, _)| (side, 3)),
        }
    }

    /// Free motion reaches a wall. Returns the change of tangents at a fixed time, if the field jumps.
    fn reach(&mut self, side: Side, at_start: bool) -> Option<Matrix4<f64>> {
        let closing = sign(side) * (self.system.w * self.y)[0];
        if closing <= 0.0 && (at_start || closing < 0.0) {
            self.leave(side, false);
            return None;
        }
        let i = side.index();
        let (mut e, limit) = (self.law.restitution[i], self.law.mesh_speed[i]);
        let step = if side == Side::Right { 1 } else { -1 };
        if let (Contact::Elastic, Some(next)) = (self.contact(side), self.whole.between(self.interval + step))
        {
            let outwards = self.interval * step >= 0;
            let of = if outwards == (side == Side::Right) { Side::Right } else { Side::Left };
            self.record(if outwards { What::Begins } else { What::Ends }, of);
            (self.system, self.interval) = (next, self.interval + step);
            let back = if side == Side::Right { Side::Left } else { Side::Right };
            self.leave(back, closing == 0.0);
            return Some(Matrix4::identity());
        }
        if self.contact(side).is_elastic() {
            if !self.closes(side) {
                (self.mode, self.leaves) = (Mode::Open(side), Some((side, 1)));
                return None;
            }
            self.record(What::Begins, side);
            (self.mode, self.leaves) = (Mode::Sustained(side), Some((side, 1)));
            return Some(Matrix4::identity());
        }
        let (y, grips, mode) = (self.y, self.grips, self.mode);
        let after = |motion: &mut Self, e: f64, mode: Mode| {
            let change = (1.0 + e) * closing;
            (motion.y, motion.grips, motion.mode) = (y, grips, mode);
            let kick = motion.system.kick * (-sign(side) * change);
            motion.y[1] += kick[0];
            motion.y[3] += kick[1];
            motion.begin_slides(change);
        };
        after(self, e, Mode::Free);
        let mut lasts = false;
        if e * closing <= limit {
            let is_rigid = self.contact(side) == Contact::Rigid;
            if is_rigid || self.presses(side) {
                let (e, next) = match (is_rigid, e > 0.0) {
                    (true, _) => (0.0, Mode::Stuck(side)),
                    (false, true) => (e, Mode::Onset(side)),
                    (false, false) => (e, Mode::Sustained(side)),
                };
                after(self, e, next);
                lasts = self.presses(side);
            }
            if !lasts {
                after(self, e, Mode::Free);
            } else if is_rigid {
                e = 0.0;
            }
        }
        let next = std::mem::replace(&mut self.mode, mode);
        self.record(if lasts { What::Begins } else { What::Impact }, side);
        if lasts {
            self.mode = next;
            self.leaves = match next {
                Mode::Stuck(_) => None,
                Mode::Sustained(_) => Some((side, 2)),
                _ => Some((side, 1)),
            };
        } else {
            self.leave(side, e == 0.0);
        }
        let one = Matrix4::identity();
        Some(one + (at_rest(self.system.kick, self.system.gap, false) - one) * (1.0 + e))
    }

    /// Begins to slide after an impact, which has changed the rate of the gap.
    fn begin_slides(&mut self, change: f64) {
        for i in 0..self.system.friction.len() {
            let (along, kick) = (self.system.along[i], self.system.kick);
            if along.dot(&kick).abs() > ROUNDING * along.norm() * kick.norm() {
                self.grips[i] = self.grip(i, ROUNDING * (along.dot(&kick) * change).abs());
                self.orders[i] = 0;
            }
        }
        self.decide();
    }

    fn field(&self, domain: usize) -> Vector {
        self.linear(domain).a * self.y
    }

    /// Applies the derivative of an event to the tangents. The event lies where `row y` is constant; `before` is the field before it,
    /// and state and mode are those after it.
    fn jump(&mut self, reset: &Matrix4<f64>, row: &Row, before: &Vector) {
        let Some(tangents) = self.tangents else { return };
        let of = |y: &Vector| y.fixed_rows::<4>(0).into_owned();
        let normal: RowVector4<f64> = row.fixed_columns::<4>(0).into_owned();
        let change = of(&self.field(self.domain_index())) - reset * of(before);
        let rate = (row * before)[0];
        self.tangents = Some((reset + change * normal / rate) * tangents);
    }

    /// Contact ends, and free motion follows.
    fn ends(&mut self, side: Side) {
        self.record(What::Ends, side);
        (self.mode, self.leaves) = (Mode::Free, None);
    }

    fn leave(&mut self, side: Side, is_at_rest: bool) {
        let order = match is_at_rest {
            false => 1,
            true if (self.linear(0).pressing * self.y)[0] != 0.0 => 2,
            true => 3,
        };
        (self.mode, self.leaves) = (Mode::Free, Some((side, order)));
    }

    fn record(&mut self, what: What, side: Side) {
        let symbol = match (self.mode, self.origin) {
            (Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side), _) => {
                Some(if side == Side::Right { b'1' } else { b'4' })
            }
            (Mode::Free | Mode::Open(_), _) if self.interval != 0 => {
                Some(if self.interval > 0 { b'1' } else { b'4' })
            }
            (Mode::Free | Mode::Open(_), None) => None,
            (Mode::Free | Mode::Open(_), Some(from)) => Some(match (from, from == side) {
                (Side::Right, true) => b'2',
                (Side::Right, false) => b'3',
                (Side::Left, true) => b'5',
                (Side::Left, false) => b'6',
            }),
        };
        self.symbols.extend(symbol);
        self.origin = Some(side);
        self.events.push((what, side));
    }
}

/// Returns the first derivative of `row y` that is not zero, the value itself included.
fn first_not_zero(row: &Row, a: &Generator, y: &Vector) -> f64 {
    let rates = std::iter::successors(Some(*y), |y| Some(a * y));
    rates.take(4).map(|y| (row * y)[0]).find(|value| *value != 0.0).unwrap_or(0.0)
}

/// Returns the projection of changes of states to a combination of velocities of 0, and of displacements.
fn at_rest(change: Vector2<f64>, along: Vector2<f64>, with_place: bool) -> Matrix4<f64> {
    let mut m = Matrix4::identity();
    for i in 0..2 {
        for j in 0..2 {
            let share = change[i] * along[j];
            m[(2 * i + 1, 2 * j + 1)] -= share;
            m[(2 * i, 2 * j)] -= if with_place { share } else { 0.0 };
        }
    }
    m
}

fn value(c: &[f64], u: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * u + c)
}

/// Returns the points in (0, 1) at which a polynomial changes its sign. They lie between the extrema, one at most in each interval.
fn roots(c: &[f64]) -> Vec<f64> {
    if c.len() < 2 || c[0].abs() > c[1..].iter().map(|c| c.abs()).sum() {
        return Vec::new();
    }
    let slope: Vec<f64> = (1..c.len()).map(|k| k as f64 * c[k]).collect();
    let mut found = Vec::new();
    let mut from = 0.0;
    for to in roots(&slope).into_iter().chain([1.0]) {
        let (mut lo, mut hi) = (from, to);
        let sign = value(c, lo);
        if sign * value(c, hi) < 0.0 {
            while hi - lo > f64::EPSILON * hi {
                let middle = 0.5 * (lo + hi);
                if middle <= lo || middle >= hi {
                    break;
                }
                if sign * value(c, middle) > 0.0 { lo = middle } else { hi = middle }
            }
            found.push(hi);
        }
        from = to;
    }
    found
}

/// Returns where a polynomial falls below zero in [0, 1]: at 0 if it starts there. `is_divided` says that roots at 0 were divided out.
pub(crate) fn first_fall(c: &[f64], is_divided: bool) -> Option<f64> {
    let starts_below = c[0] < 0.0 || c[0] == 0.0 && !is_divided;
    if starts_below { Some(0.0) } else { roots(c).first().copied() }
}
