//! The motion of an oscillator by matrix exponentials, written from the description of the oscillator alone.
//!
//! The state is extended by a constant 1 and by cosine and sine of each harmonic, so that every domain is `y' = A y`. A step is a
//! product with a stored exponential. Near a wall, Taylor series of the step are searched for roots between the extrema.

use nalgebra::{Matrix2, Matrix4, RowSVector, RowVector4, SMatrix, SVector, Vector2, Vector4};
use rattlemap_dynamics::model::{Contact, Domain, Law, Oscillator, Side, Stage, State};

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

/// What ends a flight.
#[derive(Clone, Copy, Debug)]
enum End {
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
}

impl Linear {
    fn new(a: Generator, fastest: f64, angle: f64) -> Linear {
        // With few digits, sums of steps have hardly any rounding error.
        let h = f64::from((angle / fastest) as f32);
        Linear { a, step: (h, exponential(a * h)) }
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

/// The domains of a stage: free, and in contact with the right and the left wall.
struct Stages {
    domains: [Linear; 3],
    /// Rows of the gap's acceleration in each domain. On a rigid wall it is that of free motion.
    pressing: [Row; 3],
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
    gap: [f64; 2],
    /// Change of both velocities by an impulse that changes the gap's rate by 1.
    kick: Vector2<f64>,
    /// Rows of the gap and of its rate.
    z: Row,
    w: Row,
    /// Systems between further walls on the right and on the left, from the inside to the outside.
    behind: [Vec<System>; 2],
}

/// Returns the oscillator between the `nth` wall on a side, from 1, and the next one.
fn between_walls(o: &Oscillator, side: Side, nth: usize) -> Oscillator {
    let (i, mut found) = (side.index(), Oscillator { outer_walls: Default::default(), ..o.clone() });
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

impl System {
    /// Builds the system with steps of `angle` radians of the fastest rate.
    pub(crate) fn new(o: &Oscillator, angle: f64) -> System {
        let mut harmonics = vec![(1, o.force, o.force_sin)];
        harmonics.extend(o.harmonics.iter().map(|h| (h.order, h.cos, h.sin)));
        let per_mass = matrix(o.mass).try_inverse().expect("a mass matrix");
        let along = per_mass * Vector2::from(o.gap);
        let kick = along / Vector2::from(o.gap).dot(&along);
        let rows = |at: usize| {
            let mut row = Row::zeros();
            (row[at], row[at + 2]) = (o.gap[0], o.gap[1]);
            row
        };
        let (z, w) = (rows(0), rows(1));
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
                _ if o.walls[side.index()].is_infinite() => (freely, &free),
                Contact::Rigid => {
                    // The wall cancels the acceleration of the gap by an impulse per time.
                    let (mut held, force) = (freely, w * freely);
                    held.set_row(1, &(freely.row(1) - force * kick[0]));
                    held.set_row(3, &(freely.row(3) - force * kick[1]));
                    (held, &free)
                }
                _ => (generator(&meshing[side.index()]), &meshing[side.index()]),
            };
            let [right, left] = Side::BOTH.map(behind);
            let pressing = [(freely, Contact::Elastic), (right.0, o.contacts[0]), (left.0, o.contacts[1])]
                .map(|(a, contact)| w * if contact == Contact::Rigid { freely } else { a });
            let domains =
                [(freely, &free), right, left].map(|(a, domain)| Linear::new(a, rate(domain), angle));
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
            Stages { domains, pressing, pushing }
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
            gap: o.gap,
            kick,
            z,
            w,
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
    y: Vector,
    t: f64,
    /// The wall that the gap is just leaving, and the order of that root.
    leaves: Option<(Side, usize)>,
    /// Whether the force of a wall that only pushes is zero now.
    is_unloaded: bool,
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
        y.fixed_rows_mut::<4>(0).copy_from(&Vector4::from(start));
        let holds_at_0 =
            system.schedule.first().filter(|(phase, _)| *phase == 0.0).or(system.schedule.last());
        let mut motion = Motion {
            system,
            whole: system,
            interval: 0,
            law,
            stage: holds_at_0.map_or(0, |&(_, stage)| stage),
            mode,
            y,
            t: 0.0,
            leaves: None,
            is_unloaded: false,
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
        motion
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
        [self.y[0], self.y[1], self.y[2], self.y[3]]
    }

    pub(crate) fn set_state(&mut self, state: State) {
        self.y.fixed_rows_mut::<4>(0).copy_from(&Vector4::from(state));
    }

    /// Begins to carry tangents. A gap at rest on a wall has no neighbours off the wall.
    pub(crate) fn carry_tangents(&mut self) {
        let is_stuck = matches!(self.mode, Mode::Stuck(_));
        self.tangents = Some(if is_stuck { self.at_rest(true) } else { Matrix4::identity() });
    }

    /// Clears what the caller reads about a cycle.
    pub(crate) fn clear(&mut self) {
        self.events.clear();
        self.symbols.clear();
        self.meshing_time = 0.0;
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
        match self.mode {
            Mode::Stuck(side) if !self.presses(0, side, &self.y) => {
                self.ends(side);
                self.leave(side, true);
                self.by_stage[0] += 1;
            }
            Mode::Onset(side) if self.pressing(index(side), side, &self.y) <= 0.0 => {
                self.ends(side);
                self.by_stage[1] += 1;
            }
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
    }

    fn domain_index(&self) -> usize {
        match self.mode {
            Mode::Free | Mode::Open(_) => 0,
            Mode::Onset(side) | Mode::Sustained(side) | Mode::Stuck(side) => index(side),
        }
    }

    fn linear(&self, domain: usize) -> &'a Linear {
        &self.system.stages[self.stage].domains[domain]
    }

    fn contact(&self, side: Side) -> Contact {
        self.system.contacts[side.index()]
    }

    fn pushing(&self, side: Side) -> Option<Row> {
        self.system.stages[self.stage].pushing[side.index()]
    }

    /// Whether a gap behind a wall is in contact.
    fn closes(&self, side: Side) -> bool {
        let Some(row) = self.pushing(side) else { return true };
        let mut y = self.y;
        for _ in 0..4 {
            let force = (row * y)[0];
            if force != 0.0 {
                return force > 0.0;
            }
            y = self.linear(0).a * y;
        }
        false
    }

    /// Returns the acceleration of the gap into a wall.
    fn pressing(&self, domain: usize, side: Side, y: &Vector) -> f64 {
        sign(side) * (self.system.stages[self.stage].pressing[domain] * y)[0]
    }

    /// Whether a gap at rest is pressed into a wall: the first derivative of the acceleration that is not zero decides.
    fn presses(&self, domain: usize, side: Side, y: &Vector) -> bool {
        let a = &self.linear(domain).a;
        let mut rates = *y;
        for _ in 0..4 {
            let pressing = self.pressing(domain, side, &rates);
            if pressing != 0.0 {
                return pressing > 0.0;
            }
            rates = a * rates;
        }
        false
    }

    /// Returns the projection of states, or of their changes, to rest on a wall or to a rate of 0.
    fn at_rest(&self, with_gap: bool) -> Matrix4<f64> {
        let (mut m, System { gap, kick, .. }) = (Matrix4::identity(), self.system);
        for i in 0..2 {
            for j in 0..2 {
                let share = kick[i] * gap[j];
                m[(2 * i + 1, 2 * j + 1)] -= share;
                m[(2 * i, 2 * j)] -= if with_gap { share } else { 0.0 };
            }
        }
        m
    }

    /// Integrates to a time within the present stage.
    fn run(&mut self, until: f64) -> Option<()> {
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
            match found {
                None => {
                    (self.y, self.leaves, self.is_unloaded) = (next, None, false);
                    self.t = if is_whole { self.t + h } else { until };
                }
                Some((_, end, at)) => {
                    (self.y, self.t, self.is_unloaded) = (at, self.t + share * h, false);
                    self.act(end, share == 0.0);
                    let error = self.shaken[events as usize % 4];
                    self.y[1] *= 1.0 + error;
                    self.y[3] *= 1.0 + error;
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
        let (mode, walls) = (self.mode, self.system.walls);
        [Side::Right, Side::Left].into_iter().filter(move |&side| match mode {
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
        if self.leaves.is_some() || matches!(self.mode, Mode::Onset(_) | Mode::Stuck(_) | Mode::Open(_)) {
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
        if let Mode::Onset(side) | Mode::Stuck(side) = self.mode {
            let c: Vec<f64> = series.iter().map(|term| self.pressing(index(side), side, term)).collect();
            let is_onset = matches!(self.mode, Mode::Onset(_));
            let end = if is_onset { End::PressingEnds(side) } else { End::PulledOff(side) };
            // Pressing may begin at zero.
            let order = c.iter().take_while(|c| **c == 0.0).count();
            ends.extend(first_fall(&c[order..], order > 0).map(|share| (share, end)));
        }
        if let Mode::Sustained(side) | Mode::Open(side) = self.mode
            && let Some(row) = self.pushing(side)
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
        match end {
            End::Reaches(side) => {
                if let Mode::Onset(own) = self.mode {
                    self.jump(&Matrix4::identity(), &self.system.z, &self.field(index(own)), 0);
                    self.ends(own);
                }
                self.reach(side, at_start);
            }
            End::OnsetEnds(side) => (self.mode, self.leaves) = (Mode::Sustained(side), Some((side, 1))),
            End::FallsBack(side) => {
                if at_start && sign(side) * (self.system.w * self.y)[0] > 0.0 {
                    self.leaves = Some((side, 1));
                    return;
                }
                let before = self.field(index(side));
                self.jump(&Matrix4::identity(), &self.system.z, &before, 0);
                self.ends(side);
                self.leave(side, false);
            }
            End::PressingEnds(side) => {
                let row = self.system.stages[self.stage].pressing[index(side)];
                let before = self.field(index(side));
                self.jump(&Matrix4::identity(), &row, &before, 0);
                self.ends(side);
            }
            End::Opens(side) => {
                let row = self.pushing(side).expect("the wall only pushes");
                self.jump(&Matrix4::identity(), &row, &self.field(index(side)), 0);
                self.ends(side);
                (self.mode, self.is_unloaded) = (Mode::Open(side), true);
            }
            End::Closes(side) => {
                let row = self.pushing(side).expect("the wall only pushes");
                self.jump(&Matrix4::identity(), &row, &self.field(0), index(side));
                self.record(What::Begins, side);
                (self.mode, self.leaves, self.is_unloaded) = (Mode::Sustained(side), None, true);
            }
            End::Returns(side) if sign(side) * (self.system.w * self.y)[0] < 0.0 => self.leave(side, false),
            End::Returns(side) => self.reach(side, false),
            End::PulledOff(side) => {
                // The acceleration is continuous, so tangents do not jump.
                self.ends(side);
                self.leaves = Some((side, 3));
            }
        }
    }

    /// Free motion reaches a wall.
    fn reach(&mut self, side: Side, at_start: bool) {
        let closing = sign(side) * (self.system.w * self.y)[0];
        if closing <= 0.0 && (at_start || closing < 0.0) {
            self.leave(side, false);
            return;
        }
        let before = self.field(0);
        let i = side.index();
        let (mut e, limit) = (self.law.restitution[i], self.law.mesh_speed[i]);
        let after = |e: f64| {
            let mut y = self.y;
            let change = self.system.kick * (-(1.0 + e) * sign(side) * closing);
            y[1] += change[0];
            y[3] += change[1];
            y
        };
        let step = if side == Side::Right { 1 } else { -1 };
        if let (Contact::Elastic, Some(next)) = (self.contact(side), self.whole.between(self.interval + step))
        {
            let outwards = self.interval * step >= 0;
            let of = if outwards == (side == Side::Right) { Side::Right } else { Side::Left };
            self.record(if outwards { What::Begins } else { What::Ends }, of);
            (self.system, self.interval) = (next, self.interval + step);
            self.jump(&Matrix4::identity(), &self.system.z, &before, 0);
            let back = if side == Side::Right { Side::Left } else { Side::Right };
            self.leave(back, closing == 0.0);
            return;
        }
        if self.contact(side) == Contact::Pushing && !self.closes(side) {
            (self.mode, self.leaves) = (Mode::Open(side), Some((side, 1)));
            return;
        }
        let is_slow = e * closing <= limit;
        let (lasts, next) = match self.contact(side) {
            Contact::Elastic | Contact::Pushing => (true, Mode::Sustained(side)),
            Contact::Rigid => (is_slow && self.presses(0, side, &after(0.0)), Mode::Stuck(side)),
            Contact::Impact => {
                let y = after(e);
                let lasts = is_slow && self.presses(0, side, &y) && self.presses(index(side), side, &y);
                (lasts, if e > 0.0 { Mode::Onset(side) } else { Mode::Sustained(side) })
            }
        };
        let is_elastic = self.contact(side).is_elastic();
        if lasts && matches!(next, Mode::Stuck(_)) {
            e = 0.0;
        }
        let mut reset = Matrix4::identity();
        if !is_elastic {
            reset += (self.at_rest(false) - reset) * (1.0 + e);
            self.y = after(e);
        }
        self.jump(&reset, &self.system.z, &before, if lasts { index(side) } else { 0 });
        self.record(if lasts { What::Begins } else { What::Impact }, side);
        if !lasts {
            self.leave(side, e == 0.0);
            return;
        }
        self.mode = next;
        self.leaves = match next {
            Mode::Stuck(_) | Mode::Free => None,
            Mode::Sustained(_) if !is_elastic => Some((side, 2)),
            _ => Some((side, 1)),
        };
    }

    fn field(&self, domain: usize) -> Vector {
        self.linear(domain).a * self.y
    }

    /// Applies the derivative of an event to the tangents. The event lies where `row y` is constant; `before` is the field before it,
    /// and the state is the one after it.
    fn jump(&mut self, reset: &Matrix4<f64>, row: &Row, before: &Vector, next: usize) {
        let Some(tangents) = self.tangents else { return };
        let of = |y: &Vector| y.fixed_rows::<4>(0).into_owned();
        let normal: RowVector4<f64> = row.fixed_columns::<4>(0).into_owned();
        let change = of(&self.field(next)) - reset * of(before);
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
            true if self.pressing(0, side, &self.y) != 0.0 => 2,
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
fn first_fall(c: &[f64], is_divided: bool) -> Option<f64> {
    let starts_below = c[0] < 0.0 || c[0] == 0.0 && !is_divided;
    if starts_below { Some(0.0) } else { roots(c).first().copied() }
}
