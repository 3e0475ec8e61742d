//! A machine in dimensionless coordinates, of which the first are its gaps, and its linear domains.
//!
//! Lengths are in scales of length and times in radians of the forcing. The coordinates `d` are the gaps and some of the displacements,
//! so that a gap can be set exactly to a wall; `w` are their rates. Functionals of the motion are rows of the point
//! `(d, w, cos and sin of each harmonic, 1)`.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::{Complex, DMatrix, DVector};

use rattlemap_dynamics::model::{
    Contact, Curve, Drive, DryFriction, Forces, GapRow, MOST_COORDINATES, MOST_COORDINATES_AND_HARMONICS,
    MOST_FRICTION, MOST_GAPS, MOST_SPRINGS, NonlinearSpring, Oscillator, REST, Restitution, Side, Spring,
    State, Timing, Wall,
};

/// Largest number of entries of a point.
pub(super) const WIDTH: usize = 2 * MOST_COORDINATES_AND_HARMONICS + 1;

/// Coordinates and rates, of which the first `2 n` are in use.
pub(super) type Numbers = [f64; 2 * MOST_COORDINATES];

/// A point `(d, w, cos and sin of each harmonic, 1)`, to which rows are applied.
pub(super) type PhasePoint = [f64; WIDTH];

/// A functional of the motion.
pub(super) type Functional = [f64; WIDTH];

/// Relative rounding error of sums. Mobilities of this relative size count as zero.
pub(super) const ROUNDING: f64 = 1e-12;

/// If all lengths of a machine are below this, it has no scale of length.
const NO_LENGTH: f64 = 1e-100;

/// Mode of an element with dry friction: how its surfaces move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum Slide {
    /// The sliding rate stays 0.
    #[default]
    Sticks,
    /// The sliding rate is positive.
    Forwards,
    /// The sliding rate is negative.
    Backwards,
}

impl Slide {
    /// All modes, in the order in which they are tried.
    pub(super) const ALL: [Slide; 3] = [Slide::Sticks, Slide::Forwards, Slide::Backwards];

    pub(super) fn sign(self) -> f64 {
        [0.0, 1.0, -1.0][self as usize]
    }
}

/// The modes that determine the equations of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key {
    pub(super) stage: usize,
    /// Number of walls of each gap whose springs act, negative on the left.
    pub(super) acting: [i8; MOST_GAPS],
    /// Sides of the rigid walls on which gaps rest.
    pub(super) held: [Option<Side>; MOST_GAPS],
    pub(super) slides: [Slide; MOST_FRICTION],
    pub(super) pieces: Pieces,
}

/// Pieces of the friction forces, then of the nonlinear springs.
pub(super) type Pieces = [u8; CURVES];
pub(super) const CURVES: usize = MOST_FRICTION + MOST_SPRINGS;

/// An element with dry friction: factors of `w` in the sliding rate.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) row: DVector<f64>,
    pub(super) force: Curve,
    pub(super) static_force: f64,
    pub(super) speed: f64,
}

/// A nonlinear spring: factors of `d` in the elongation, and the wall with which it acts.
#[derive(Debug)]
pub(super) struct BentSpring {
    pub(super) row: DVector<f64>,
    pub(super) force: Curve,
    pub(super) wall: Option<(usize, Side)>,
}

impl BentSpring {
    /// Whether the force is negative beyond a border of its pieces, or far beyond the last one.
    fn may_pull(&self) -> bool {
        self.force.borders.iter().any(|at| self.force.at(*at) < 0.0)
            || self.force.pieces.last().is_some_and(|piece| piece[0] < 0.0)
    }
}

/// The equations of motion of one combination of modes.
#[derive(Debug)]
pub(super) struct Domain {
    n: usize,
    pub(super) width: usize,
    /// Orders of the harmonics.
    orders: Vec<u32>,
    pub(super) accelerations: Vec<Functional>,
    /// Coordinates whose rate cannot change.
    pub(super) is_still: [bool; MOST_COORDINATES],
    /// Forces by which rigid walls push the gaps that rest on them.
    pub(super) pushes: [Option<Functional>; MOST_GAPS],
    /// Forces that hold elements. None for an element whose row is already held by others.
    pub(super) holds: [Option<Functional>; MOST_FRICTION],
    /// Time in which the fastest rate turns by one radian.
    pub(super) radian: f64,
}

pub(super) fn dot(row: &[f64], point: &[f64]) -> f64 {
    row.iter().zip(point).map(|(a, b)| a * b).sum()
}

/// Returns the sum of the absolute values of the terms of [`dot`].
pub(super) fn size(row: &Functional, point: &PhasePoint) -> f64 {
    row.iter().zip(point).map(|(a, b)| (a * b).abs()).sum()
}

/// Returns `factor row + constant`.
pub(super) fn affine(row: &Functional, factor: f64, constant: f64, width: usize) -> Functional {
    let mut row = row.map(|x| factor * x);
    row[width - 1] += constant;
    row
}

impl Domain {
    /// Returns the row of a coordinate, or of its rate.
    pub(super) fn unit(&self, entry: usize) -> Functional {
        let mut row = [0.0; WIDTH];
        row[entry] = 1.0;
        row
    }

    /// Returns a point.
    pub(super) fn point(&self, y: &[f64], t: f64) -> PhasePoint {
        let n = self.n;
        let mut point = [0.0; WIDTH];
        point[..2 * n].copy_from_slice(&y[..2 * n]);
        let (sin, cos) = t.sin_cos();
        for (k, &order) in self.orders.iter().enumerate() {
            let phasor = Complex::new(cos, sin).powu(order);
            (point[2 * (n + k)], point[2 * (n + k) + 1]) = (phasor.re, phasor.im);
        }
        point[self.width - 1] = 1.0;
        point
    }

    /// Returns the time derivative of a point.
    pub(super) fn derivative(&self, point: &PhasePoint) -> PhasePoint {
        let n = self.n;
        let mut rate = [0.0; WIDTH];
        rate[..n].copy_from_slice(&point[n..2 * n]);
        for (rate, row) in rate[n..2 * n].iter_mut().zip(&self.accelerations) {
            *rate = dot(&row[..self.width], &point[..self.width]);
        }
        for (k, &order) in self.orders.iter().enumerate() {
            let (at, order) = (2 * (n + k), f64::from(order));
            (rate[at], rate[at + 1]) = (-order * point[at + 1], order * point[at]);
        }
        rate
    }

    /// Returns a point and its derivatives.
    pub(super) fn jet<const N: usize>(&self, point: &PhasePoint) -> [PhasePoint; N] {
        let mut jet = [*point; N];
        (1..N).for_each(|k| jet[k] = self.derivative(&jet[k - 1]));
        jet
    }

    /// Returns the row of a functional's time derivative.
    fn rate_of(&self, row: &Functional) -> Functional {
        let n = self.n;
        let mut rate = [0.0; WIDTH];
        rate[n..2 * n].copy_from_slice(&row[..n]);
        for (acceleration, factor) in self.accelerations.iter().zip(&row[n..2 * n]) {
            rate.iter_mut().zip(acceleration).for_each(|(rate, x)| *rate += factor * x);
        }
        for (k, &order) in self.orders.iter().enumerate() {
            let (at, order) = (2 * (n + k), f64::from(order));
            rate[at] += order * row[at + 1];
            rate[at + 1] -= order * row[at];
        }
        rate
    }

    /// Returns order and value of the first derivative, from `first` on, that is not 0 within rounding. If four derivatives are 0, the
    /// value is 0.
    pub(super) fn tendency(&self, row: &Functional, point: &PhasePoint, first: usize) -> (usize, f64) {
        let mut row = *row;
        for order in 0..first + 4 {
            let value = dot(&row, point);
            if order >= first && value.abs() > ROUNDING * size(&row, point) {
                return (order, value);
            }
            row = self.rate_of(&row);
        }
        (first + 4, 0.0)
    }
}

/// Constraints on rates.
pub(super) struct Constraints {
    /// Rows of `w` that are held, without rows that are combinations of others.
    pub(super) rows: DMatrix<f64>,
    /// Indices of these rows among the given rows.
    pub(super) kept: Vec<usize>,
    /// Inverse of `rows mobility rows^T`.
    pub(super) inverse: DMatrix<f64>,
    /// Changes of `w` by unit impulses that the constraints allow.
    pub(super) mobility: DMatrix<f64>,
}

impl Constraints {
    pub(super) fn new(mobility: &DMatrix<f64>, rows: &[DVector<f64>]) -> Constraints {
        let (mut left, mut kept) = (mobility.clone(), Vec::new());
        for (i, row) in rows.iter().enumerate() {
            let along = &left * row;
            let free = row.dot(&along);
            if free > ROUNDING * row.dot(&(mobility * row)) {
                left -= &along * along.transpose() / free;
                kept.push(i);
            }
        }
        let rows = DMatrix::from_fn(kept.len(), mobility.nrows(), |i, j| rows[kept[i]][j]);
        let inverse = (&rows * mobility * rows.transpose()).try_inverse().expect("independent rows");
        Constraints { rows, kept, inverse, mobility: left }
    }

    /// Removes the part of rates that the constraints forbid. The constraints hold their rows at these `speeds`.
    pub(super) fn project(&self, mobility: &DMatrix<f64>, w: &mut DVector<f64>, speeds: &[f64]) {
        let speeds = DVector::from_fn(self.kept.len(), |i, _| speeds[self.kept[i]]);
        *w -= mobility * self.rows.transpose() * &self.inverse * (&self.rows * &*w - speeds);
    }
}

/// A machine, and the domains that its motions have met.
#[derive(Debug)]
pub(super) struct System {
    /// The dimensionless machine, in the coordinates `d`.
    pub(super) machine: Oscillator,
    pub(super) n: usize,
    /// Independent coordinates. The others are gaps whose rows depend on those of earlier gaps, which no force of free motion acts on.
    pub(super) leading: Vec<usize>,
    /// All coordinates as sums of multiples of the independent ones.
    pub(super) spread: DMatrix<f64>,
    /// Combinations of coordinates that give the displacements, divided by `units[0]`.
    from_coordinates: DMatrix<f64>,
    to_coordinates: DMatrix<f64>,
    /// Units of displacements and velocities.
    pub(super) units: [f64; 2],
    pub(super) mobility: DMatrix<f64>,
    /// Inverse factor of the mass matrix, for forces on all coordinates.
    factor: DMatrix<f64>,
    /// The elements that have a force.
    pub(super) elements: Vec<Element>,
    pub(super) springs: Vec<BentSpring>,
    domains: RefCell<HashMap<Key, Rc<Domain>>>,
}

impl System {
    pub(super) fn new(machine: &Oscillator, start: &State) -> System {
        let (to_coordinates, leading) = coordinates(machine);
        let n = to_coordinates.nrows();
        let inverse = to_coordinates.select_rows(&leading).try_inverse().expect("the rows are independent");
        let (mut from_coordinates, mut spread) =
            (DMatrix::zeros(machine.degrees(), n), &to_coordinates * &inverse);
        for (at, &i) in leading.iter().enumerate() {
            from_coordinates.set_column(i, &inverse.column(at));
            spread.row_mut(i).fill(0.0);
            spread[(i, at)] = 1.0;
        }
        // A machine without walls and loads has no length, so its start defines the scale of length.
        let of_start = start.iter().step_by(2).fold(0.0f64, |most, x| most.max(x.abs()));
        let length = match machine.length_scale() {
            scale if scale > NO_LENGTH => scale,
            _ if of_start > NO_LENGTH => of_start,
            _ => 1.0,
        };
        let units = [length, length * machine.omega];
        let machine = transformed(machine, units, &from_coordinates);
        let mass = machine.mass.select_rows(&leading).select_columns(&leading);
        let factors = mass.cholesky().expect("the mass matrix is positive definite");
        // A row along a gap must not have rounding errors in other entries.
        let clean = |row: &DVector<f64>| {
            let least = ROUNDING * row.amax();
            row.map(|x| if x.abs() > least { x } else { 0.0 })
        };
        let element = |friction: &DryFriction| {
            let DryFriction { row, static_force, speed, .. } = friction;
            Element { row: clean(row), force: friction.curve(), static_force: *static_force, speed: *speed }
        };
        let spring = |spring: &NonlinearSpring| BentSpring {
            row: clean(&spring.row),
            force: spring.curve(),
            wall: spring.wall,
        };
        System {
            n,
            units,
            mobility: &spread * factors.inverse() * spread.transpose(),
            factor: factors.l().try_inverse().expect("the factor is regular") * spread.transpose(),
            leading,
            spread,
            elements: machine.friction.iter().filter(|friction| friction.acts()).map(element).collect(),
            springs: machine.springs.iter().map(spring).collect(),
            from_coordinates,
            to_coordinates,
            machine,
            domains: RefCell::default(),
        }
    }

    pub(super) fn gaps(&self) -> usize {
        self.machine.gaps.len()
    }

    pub(super) fn walls(&self, gap: usize, side: Side) -> &[Wall] {
        &self.machine.gaps[gap].walls[side.index()]
    }

    /// Converts a state to coordinates.
    pub(super) fn to_coordinates(&self, state: &State) -> Numbers {
        let (n, t) = (self.n, &self.to_coordinates);
        let entry = |i: usize, kind: usize| {
            (0..t.ncols()).map(|j| t[(i, j)] * state[2 * j + kind]).sum::<f64>() / self.units[kind]
        };
        std::array::from_fn(|i| if i < 2 * n { entry(i % n, i / n) } else { 0.0 })
    }

    /// Converts coordinates to a state.
    pub(super) fn to_state(&self, y: &Numbers) -> State {
        let (n, t) = (self.n, &self.from_coordinates);
        let mut state = REST;
        for (i, entry) in state[..2 * t.nrows()].iter_mut().enumerate() {
            let rates = &y[n * (i % 2)..];
            *entry = self.units[i % 2] * (0..n).map(|j| t[(i / 2, j)] * rates[j]).sum::<f64>();
        }
        state
    }

    /// Returns the row of an element's sliding rate.
    pub(super) fn sliding_rate(&self, i: usize) -> Functional {
        let mut row = [0.0; WIDTH];
        row[self.n..2 * self.n].copy_from_slice(self.elements[i].row.as_slice());
        row[self.width() - 1] = -self.elements[i].speed;
        row
    }

    /// Returns the force of a curve and the row of its argument, if its piece matters.
    pub(super) fn bent(&self, i: usize, slides: &[Slide; MOST_FRICTION]) -> Option<(&Curve, Functional)> {
        let (force, row) = if i < MOST_FRICTION {
            let element = self.elements.get(i).filter(|_| slides[i] != Slide::Sticks)?;
            (&element.force, affine(&self.sliding_rate(i), slides[i].sign(), 0.0, self.width()))
        } else {
            let spring = self.springs.get(i - MOST_FRICTION)?;
            let mut row = [0.0; WIDTH];
            row[..self.n].copy_from_slice(spring.row.as_slice());
            (&spring.force, row)
        };
        (force.pieces.len() > 1).then_some((force, row))
    }

    /// Returns the pieces at a point.
    pub(super) fn pieces(&self, slides: &[Slide; MOST_FRICTION], point: &PhasePoint) -> Pieces {
        std::array::from_fn(|i| {
            self.bent(i, slides).map_or(0, |(force, row)| force.piece(dot(&row, point)) as u8)
        })
    }

    /// Whether the force of a side's last wall, in its first piece, depends on the position alone, so that its root is the wall.
    pub(super) fn is_zero_at_wall(&self, gap: usize, side: Side, stage: usize, pieces: &Pieces) -> bool {
        let Some(spring) = self.walls(gap, side).last().map(|wall| wall.springs[stage]) else { return false };
        let curve = self.springs.iter().position(|spring| spring.wall == Some((gap, side)));
        spring.damping == 0.0
            && spring.force_at_wall() == 0.0
            && curve.is_none_or(|i| pieces[MOST_FRICTION + i] == 0)
    }

    /// Returns the row of the force of a side's last wall, positive away from the wall, if this wall only pushes. None if the force never
    /// pulls behind the wall.
    pub(super) fn pushing(
        &self,
        gap: usize,
        side: Side,
        stage: usize,
        pieces: &Pieces,
    ) -> Option<Functional> {
        let wall = self.walls(gap, side).last()?;
        let curve = self.springs.iter().position(|spring| spring.wall == Some((gap, side)));
        let may_pull =
            wall.springs.iter().any(|spring| spring.damping != 0.0 || spring.force_at_wall() != 0.0)
                || curve.is_some_and(|i| self.springs[i].may_pull());
        if wall.contact != Contact::Pushing || !may_pull {
            return None;
        }
        let (spring, s) = (wall.springs[stage], side.sign());
        let mut row = [0.0; WIDTH];
        (row[gap], row[self.n + gap]) = (s * spring.stiffness, s * spring.damping);
        row[self.width() - 1] = spring.force_at_wall() - s * spring.stiffness * wall.at;
        if let Some(i) = curve {
            let [slope, force] = self.springs[i].force.pieces[usize::from(pieces[MOST_FRICTION + i])];
            row[gap] += s * slope;
            row[self.width() - 1] += force;
        }
        Some(row)
    }

    fn width(&self) -> usize {
        2 * self.n + 2 * self.machine.drives.len() + 1
    }

    /// Returns the row of `w` of a gap, in independent coordinates.
    pub(super) fn gap_row(&self, gap: usize) -> DVector<f64> {
        let mut row = DVector::zeros(self.n);
        self.leading.iter().zip(&self.spread.row(gap)).for_each(|(&i, factor)| row[i] = *factor);
        row
    }

    pub(super) fn domain(&self, key: Key) -> Rc<Domain> {
        if let Some(found) = self.domains.borrow().get(&key) {
            return Rc::clone(found);
        }
        let built = Rc::new(self.build(key));
        self.domains.borrow_mut().insert(key, Rc::clone(&built));
        built
    }

    /// Returns the largest rate of stiffness and damping.
    fn fastest(&self, stiffness: &DMatrix<f64>, damping: &DMatrix<f64>) -> f64 {
        let norm = |m: &DMatrix<f64>| (&self.factor * m * self.factor.transpose()).singular_values().max();
        norm(stiffness).sqrt() + norm(damping)
    }

    fn build(&self, key: Key) -> Domain {
        let (n, width, machine) = (self.n, self.width(), &self.machine);
        let Forces { mut stiffness, mut damping, mut load } = machine.stages[key.stage].clone();
        for (gap, &acting) in key.acting.iter().enumerate().take(self.gaps()) {
            let side = if acting > 0 { Side::Right } else { Side::Left };
            for wall in &self.walls(gap, side)[..usize::from(acting.unsigned_abs())] {
                let spring = wall.springs[key.stage];
                let Spring { stiffness: k, damping: c, .. } = spring;
                stiffness[(gap, gap)] += k;
                damping[(gap, gap)] += c;
                load[gap] += k * wall.at - side.sign() * spring.force_at_wall();
            }
        }
        for (i, element) in self.elements.iter().enumerate() {
            if key.slides[i] != Slide::Sticks {
                let [slope, force] = element.force.pieces[usize::from(key.pieces[i])];
                load -= &element.row * (key.slides[i].sign() * force - slope * element.speed);
                damping += &element.row * element.row.transpose() * slope;
            }
        }
        for (spring, piece) in self.springs.iter().zip(&key.pieces[MOST_FRICTION..]) {
            let acts = spring.wall.is_none_or(|(gap, side)| {
                let count = self.walls(gap, side).len() as i8;
                key.acting[gap] == if side == Side::Right { count } else { -count }
            });
            if acts {
                let [slope, force] = spring.force.pieces[usize::from(*piece)];
                load -= &spring.row * force;
                stiffness += &spring.row * spring.row.transpose() * slope;
            }
        }
        let mut forces = DMatrix::zeros(n, width);
        forces.columns_mut(0, n).copy_from(&-&stiffness);
        forces.columns_mut(n, n).copy_from(&-&damping);
        for (k, Drive { cos, sin, .. }) in machine.drives.iter().enumerate() {
            forces.set_column(2 * (n + k), cos);
            forces.set_column(2 * (n + k) + 1, sin);
        }
        forces.set_column(width - 1, &load);
        let gaps = || (0..self.gaps()).filter(|&gap| key.held[gap].is_some());
        let elements = || (0..self.elements.len()).filter(|&i| key.slides[i] == Slide::Sticks);
        let rows =
            gaps().map(|gap| self.gap_row(gap)).chain(elements().map(|i| self.elements[i].row.clone()));
        let bound = Constraints::new(&self.mobility, &rows.collect::<Vec<_>>());
        // The forces of the constraints are `-multipliers`.
        let multipliers = &bound.inverse * &bound.rows * &self.mobility * &forces;
        let accelerations = &bound.mobility * &forces;
        let row = |m: &DMatrix<f64>, i: usize, factor: f64| -> Functional {
            std::array::from_fn(|j| if j < width { factor * m[(i, j)] } else { 0.0 })
        };
        let is_still = |i: usize| i < n && bound.mobility[(i, i)] <= ROUNDING * self.mobility[(i, i)];
        let is_still: [bool; MOST_COORDINATES] = std::array::from_fn(is_still);
        let (held, holding) = (gaps().count(), elements().collect::<Vec<_>>());
        let mut pushes = [None; MOST_GAPS];
        let mut holds = [None; MOST_FRICTION];
        for (at, &which) in bound.kept.iter().enumerate() {
            match gaps().nth(which) {
                Some(gap) => {
                    let sign = key.held[gap].map_or(1.0, Side::sign);
                    pushes[gap] = Some(row(&multipliers, at, sign));
                }
                None => holds[holding[which - held]] = Some(row(&multipliers, at, 1.0)),
            }
        }
        let highest = f64::from(machine.highest_order());
        Domain {
            n,
            width,
            orders: machine.drives.iter().map(|drive| drive.order).collect(),
            accelerations: (0..n)
                .map(|i| if is_still[i] { [0.0; WIDTH] } else { row(&accelerations, i, 1.0) })
                .collect(),
            is_still,
            pushes,
            holds,
            radian: self.fastest(&stiffness, &damping).max(highest).recip(),
        }
    }
}

/// Returns the rows of the coordinates: the gaps, and displacements that complete them. Each gap replaces one displacement. It is the
/// displacement with the largest share in the mobility of the gap's row, after previous gaps are eliminated from this row. Also returns the
/// places of independent rows: a gap of whose row nothing is left replaces none.
fn coordinates(machine: &Oscillator) -> (DMatrix<f64>, Vec<usize>) {
    let n = machine.degrees();
    let mut rest: Vec<DVector<f64>> = machine.gaps.iter().map(|gap| gap.row.clone()).collect();
    let (mut left_out, mut leading) = (Vec::new(), Vec::new());
    for i in 0..rest.len() {
        let row = rest[i].clone();
        if row.amax() <= ROUNDING * machine.gaps[i].row.amax() {
            continue;
        }
        let part = |j: usize| row[j] * row[j] / machine.mass[(j, j)];
        let others = (0..n).filter(|j| !left_out.contains(j));
        let most = others.max_by(|&a, &b| part(a).total_cmp(&part(b))).expect("a coordinate for each gap");
        for other in &mut rest[i + 1..] {
            let share = other[most] / row[most];
            *other -= &row * share;
        }
        left_out.push(most);
        leading.push(i);
    }
    let unit = |j: usize| DVector::from_fn(n, |i, _| f64::from(u8::from(i == j)));
    let rows = machine.gaps.iter().map(|gap| gap.row.clone());
    let rows: Vec<_> = rows.chain((0..n).filter(|j| !left_out.contains(j)).map(unit)).collect();
    leading.extend(machine.gaps.len()..rows.len());
    (DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j]), leading)
}

/// Returns a machine in units of displacement and velocity, and in other coordinates. Forces act along the coordinates, and are divided by
/// the unit of displacement.
fn transformed(machine: &Oscillator, [length, speed]: [f64; 2], from: &DMatrix<f64>) -> Oscillator {
    let (back, omega) = (from.transpose(), machine.omega);
    let matrix = |m: &DMatrix<f64>, factor: f64| &back * m * from * factor;
    let vector = |v: &DVector<f64>| &back * v / length;
    let forces = |Forces { damping, stiffness, load }: &Forces| Forces {
        damping: matrix(damping, omega),
        stiffness: matrix(stiffness, 1.0),
        load: vector(load),
    };
    let wall = |wall: &Wall| {
        let spring = |&Spring { stiffness, damping, preload }: &Spring| Spring {
            stiffness,
            damping: damping * omega,
            preload: preload.map(|preload| preload / length),
        };
        let restitution = match wall.restitution {
            Restitution::BySpeed { constant, factor, power } => {
                Restitution::BySpeed { constant, factor: factor * speed.powf(power), power }
            }
            constant => constant,
        };
        Wall {
            at: wall.at / length,
            restitution,
            mesh_speed: wall.mesh_speed / speed,
            springs: wall.springs.iter().map(spring).collect(),
            ..wall.clone()
        }
    };
    let mass = matrix(&machine.mass, omega * omega);
    Oscillator {
        omega: 1.0,
        mass: 0.5 * (&mass + mass.transpose()),
        stages: machine.stages.iter().map(forces).collect(),
        schedule: machine.schedule.clone(),
        drives: machine
            .drives
            .iter()
            .map(|Drive { order, cos, sin }| Drive { order: *order, cos: vector(cos), sin: vector(sin) })
            .collect(),
        gaps: machine
            .gaps
            .iter()
            .map(|GapRow { row, walls }| GapRow {
                row: row.clone(),
                walls: walls.each_ref().map(|walls| walls.iter().map(wall).collect()),
            })
            .collect(),
        friction: machine
            .friction
            .iter()
            .map(|friction| DryFriction {
                row: &back * &friction.row,
                force: friction.force / length,
                at_speed: friction.at_speed.iter().map(|[v, force]| [v / speed, force / length]).collect(),
                static_force: friction.static_force / length,
                speed: friction.speed / speed,
            })
            .collect(),
        springs: machine
            .springs
            .iter()
            .map(|spring| NonlinearSpring {
                row: &back * &spring.row,
                points: spring.points.iter().map(|[x, force]| [x / length, force / length]).collect(),
                wall: spring.wall,
            })
            .collect(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}
