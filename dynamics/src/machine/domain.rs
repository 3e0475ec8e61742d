//! The linear equations of motion of one combination of modes.

use std::borrow::Cow;
use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};

use super::polynomial::{ORDER, Polynomial, Weights, combine, rest};
use super::system::System;
use super::{Numbers, Point, SIZE, WIDTH};
use crate::model::{MOST_COORDINATES, MOST_FRICTION, MOST_GAPS, Side};
use crate::motion::Slip;

/// Taylor radius: the largest product of a step and the rate of its domain.
const RADIUS: f64 = 1.6;

/// A mobility below this share of the unconstrained one is rounding: other constraints already hold the row.
const NO_MOBILITY: f64 = 1e-12;

/// What the linear equations depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct DomainKey {
    pub(super) stage: usize,
    /// For each gap the number of walls whose springs act: positive on the right, negative on the left.
    pub(super) engaged: [i8; MOST_GAPS],
    /// The rigid wall that each gap rests on.
    pub(super) held: [Option<Side>; MOST_GAPS],
    pub(super) slips: [Slip; MOST_FRICTION],
}

impl DomainKey {
    /// Returns a number that no other domain has.
    pub(super) fn code(&self) -> u32 {
        let engaged = self.engaged.iter().map(|engaged| (9, (engaged + 4) as u32));
        let held = self.held.iter().map(|held| (3, held.map_or(0, |side| 1 + side.index() as u32)));
        let slips = self.slips.iter().map(|&slip| (3, slip as u32));
        engaged.chain(held).chain(slips).fold(self.stage as u32, |code, (count, digit)| count * code + digit)
    }
}

/// A linear functional of a [`Point`].
#[derive(Clone, Debug)]
pub(super) struct Row(pub(super) Point);

impl Row {
    pub(super) fn dot(&self, point: &Point) -> f64 {
        self.0.iter().zip(point).map(|(a, b)| a * b).sum()
    }

    /// Returns the sum of the sizes of all terms, which rounding is relative to.
    pub(super) fn size(&self, point: &Point) -> f64 {
        self.0.iter().zip(point).map(|(a, b)| (a * b).abs()).sum()
    }

    pub(super) fn scaled(&self, factor: f64) -> Row {
        Row(self.0.map(|x| factor * x))
    }

    /// Adds a constant.
    pub(super) fn plus(mut self, constant: f64, width: usize) -> Row {
        self.0[width - 1] += constant;
        self
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Coefficients of a coordinate on the longest step: for each entry of the point at its start, a polynomial of the share.
type Table = Box<[Polynomial]>;

/// A step of a domain. The coordinates are polynomials of the share of the step.
#[derive(Clone, Debug)]
pub(super) struct Path {
    point: Point,
    pub(super) coordinates: [Polynomial; MOST_COORDINATES],
    /// Bounds on the changes of the coordinates.
    pub(super) changes: [f64; MOST_COORDINATES],
    /// Duration.
    h: f64,
}

/// One linear domain.
#[derive(Clone, Debug)]
pub(super) struct Domain {
    n: usize,
    width: usize,
    /// Angular frequencies of the harmonics.
    rates: Vec<f64>,
    /// Rows of the accelerations.
    pub(super) accelerations: Vec<Row>,
    /// Whether the acceleration of each coordinate is exactly 0, because constraints hold it.
    pub(super) is_still: [bool; SIZE],
    /// Damping matrix, with the dampers of contacts.
    pub(super) damping: DMatrix<f64>,
    /// Longest step.
    pub(super) unit: f64,
    /// Rows of the forces with which rigid walls push gaps that rest on them.
    pub(super) pushes: [Option<Row>; MOST_GAPS],
    /// Rows of the forces that hold sticking elements. None if other constraints hold the element.
    pub(super) holds: [Option<Row>; MOST_FRICTION],
    tables: OnceLock<Vec<Table>>,
    /// Carries tangent vectors over the longest step.
    whole: OnceLock<Carrier>,
}

impl Default for Path {
    fn default() -> Path {
        Path {
            point: [0.0; WIDTH],
            coordinates: [[0.0; ORDER + 1]; MOST_COORDINATES],
            changes: [0.0; MOST_COORDINATES],
            h: 0.0,
        }
    }
}

impl Domain {
    pub(super) fn new(system: &System, key: DomainKey) -> Domain {
        let (n, width) = (system.n, system.width());
        let forces = &system.stages[key.stage];
        let (mut stiffness, mut damping) = (forces.stiffness.clone(), forces.damping.clone());
        let mut load = forces.load.clone();
        for (gap, &engaged) in key.engaged.iter().enumerate().take(system.gaps()) {
            let side = if engaged > 0 { Side::Right } else { Side::Left };
            for wall in &system.walls(gap, side)[..usize::from(engaged.unsigned_abs())] {
                let spring = wall.springs[key.stage];
                stiffness[(gap, gap)] += spring.stiffness;
                damping[(gap, gap)] += spring.damping;
                load[gap] += spring.stiffness * wall.at - side.sign() * spring.preload;
            }
        }
        for (element, slip) in system.elements.iter().zip(key.slips) {
            load -= &element.row * (slip.sign() * element.force);
        }
        // Rows of the forces on each coordinate, without constraints.
        let mut rows = DMatrix::zeros(n, width);
        rows.view_mut((0, 0), (n, n)).copy_from(&-&stiffness);
        rows.view_mut((0, n), (n, n)).copy_from(&-&damping);
        for (k, [cos, sin]) in system.drives.iter().enumerate() {
            rows.set_column(2 * (n + k), cos);
            rows.set_column(2 * (n + k) + 1, sin);
        }
        rows.set_column(width - 1, &load);
        let constraints = Constraints::new(system, key);
        let free = &system.mobility * rows;
        let multipliers = &constraints.inverse * (&constraints.rows * &free);
        let mut bound = &free - &constraints.moves * &multipliers;
        let mut is_still = [false; SIZE];
        for (i, is_still) in is_still.iter_mut().enumerate().take(n) {
            if constraints.mobility[(i, i)] <= NO_MOBILITY * system.mobility[(i, i)] {
                *is_still = true;
                bound.row_mut(i).fill(0.0);
            }
        }
        let row = |matrix: &DMatrix<f64>, i: usize| {
            let mut row = [0.0; WIDTH];
            (0..width).for_each(|j| row[j] = matrix[(i, j)]);
            Row(row)
        };
        let mut pushes = [const { None }; MOST_GAPS];
        let mut holds = [const { None }; MOST_FRICTION];
        for (i, constraint) in constraints.kinds.iter().enumerate() {
            match *constraint {
                Constraint::Wall(gap, side) => pushes[gap] = Some(row(&multipliers, i).scaled(side.sign())),
                Constraint::Element(i_element) => holds[i_element] = Some(row(&multipliers, i)),
            }
        }
        Domain {
            n,
            width,
            rates: system.orders.iter().map(|order| order * system.machine.omega).collect(),
            accelerations: (0..n).map(|i| row(&bound, i)).collect(),
            is_still,
            unit: RADIUS / system.rate(&stiffness, &damping),
            damping,
            pushes,
            holds,
            tables: OnceLock::new(),
            whole: OnceLock::new(),
        }
    }

    /// Returns the time in which the fastest rate turns by one radian.
    pub(super) fn radian(&self) -> f64 {
        self.unit / RADIUS
    }

    /// Returns the row of a coordinate, or of its rate.
    pub(super) fn unit_row(&self, entry: usize) -> Row {
        let mut row = [0.0; WIDTH];
        row[entry] = 1.0;
        Row(row)
    }

    /// Returns the time derivative of a point.
    pub(super) fn derivative(&self, point: &Point) -> Point {
        let n = self.n;
        let mut rate = [0.0; WIDTH];
        rate[..n].copy_from_slice(&point[n..2 * n]);
        for (rate, row) in rate[n..].iter_mut().zip(&self.accelerations) {
            *rate = dot(&row.0[..self.width], &point[..self.width]);
        }
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            (rate[at], rate[at + 1]) = (-omega * point[at + 1], omega * point[at]);
        }
        rate
    }

    /// Returns the time derivative of a functional along the motion, as a functional.
    pub(super) fn rate_of(&self, row: &Row) -> Row {
        let n = self.n;
        let mut rate = [0.0; WIDTH];
        rate[n..2 * n].copy_from_slice(&row.0[..n]);
        for (acceleration, &factor) in
            self.accelerations.iter().zip(&row.0[n..]).filter(|(_, factor)| **factor != 0.0)
        {
            rate.iter_mut().zip(&acceleration.0).for_each(|(rate, x)| *rate += factor * x);
        }
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            rate[at] += omega * row.0[at + 1];
            rate[at + 1] -= omega * row.0[at];
        }
        Row(rate)
    }

    /// Returns the coefficients of all coordinates on the longest step.
    fn new_tables(&self) -> Vec<Table> {
        let table = |i: usize| {
            let mut table = vec![[0.0; ORDER + 1]; self.width].into_boxed_slice();
            let mut row = self.unit_row(i);
            for k in 0..=ORDER {
                table.iter_mut().zip(&row.0).for_each(|(column, x)| column[k] = *x);
                row = self.rate_of(&row).scaled(self.unit / (k + 1) as f64);
            }
            table
        };
        (0..self.n).map(table).collect()
    }

    fn tables(&self) -> &[Table] {
        self.tables.get_or_init(|| self.new_tables())
    }

    /// Follows the motion from a point over a time `h` of at most the longest step.
    pub(super) fn follow(&self, point: &Point, h: f64, path: &mut Path) {
        (path.point, path.h) = (*point, h);
        let part = h / self.unit;
        for ((coordinate, change), table) in
            path.coordinates.iter_mut().zip(&mut path.changes).zip(self.tables())
        {
            *coordinate = combine(table, &point[..self.width]);
            if h < self.unit {
                let mut power = 1.0;
                for c in coordinate.iter_mut() {
                    *c *= power;
                    power *= part;
                }
            }
            *change = rest(coordinate);
        }
    }

    /// Returns the state at a share of a step.
    pub(super) fn state(&self, path: &Path, share: f64) -> Numbers {
        let weights = Weights::at(share);
        let mut y = [0.0; SIZE];
        for (i, coordinate) in path.coordinates.iter().enumerate().take(self.n) {
            let [value, slope] = weights.of(coordinate);
            (y[i], y[self.n + i]) = (value, slope / path.h);
        }
        y
    }

    /// Returns the whole point at a share of a step.
    pub(super) fn point(&self, path: &Path, share: f64) -> Point {
        let mut point = [0.0; WIDTH];
        point[..SIZE].copy_from_slice(&self.state(path, share));
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (self.n + k);
            let ([cos, sin], (sin_turn, cos_turn)) =
                ([path.point[at], path.point[at + 1]], (omega * share * path.h).sin_cos());
            (point[at], point[at + 1]) = (cos * cos_turn - sin * sin_turn, sin * cos_turn + cos * sin_turn);
        }
        point[self.width - 1] = 1.0;
        point
    }

    /// Returns a functional on a step.
    pub(super) fn along(&self, row: &Row, path: &Path) -> Polynomial {
        let (n, row) = (self.n, &row.0);
        let mut sum = [0.0; ORDER + 1];
        sum[0] = row[self.width - 1];
        for (i, coordinate) in path.coordinates.iter().enumerate().take(n) {
            if row[i] != 0.0 {
                sum.iter_mut().zip(coordinate).for_each(|(sum, c)| *sum += row[i] * c);
            }
            if row[n + i] != 0.0 {
                let factor = row[n + i] / path.h;
                (0..ORDER).for_each(|k| sum[k] += factor * (k + 1) as f64 * coordinate[k + 1]);
            }
        }
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            if row[at] == 0.0 && row[at + 1] == 0.0 {
                continue;
            }
            let [mut cos, mut sin] = [path.point[at], path.point[at + 1]];
            for (k, sum) in sum.iter_mut().enumerate() {
                *sum += row[at] * cos + row[at + 1] * sin;
                let turn = omega * path.h / (k + 1) as f64;
                (cos, sin) = (-turn * sin, turn * cos);
            }
        }
        sum
    }

    /// Returns the images of the unit vectors after a time of at most the longest step. Each has `2 n` entries.
    pub(super) fn carrier(&self, time: f64) -> Cow<'_, Carrier> {
        if time == self.unit {
            Cow::Borrowed(self.whole.get_or_init(|| self.new_carrier(time)))
        } else {
            Cow::Owned(self.new_carrier(time))
        }
    }

    fn new_carrier(&self, time: f64) -> Carrier {
        let (n, weights) = (self.n, Weights::at(time / self.unit));
        let mut carrier = Carrier([[0.0; SIZE]; SIZE]);
        for (i, table) in self.tables().iter().enumerate() {
            for (j, column) in table[..2 * n].iter().enumerate() {
                let [value, slope] = weights.of(column);
                (carrier.0[j][i], carrier.0[j][n + i]) = (value, slope / self.unit);
            }
        }
        carrier
    }
}

/// Carries tangent vectors along a flight: the images of the unit vectors.
#[derive(Clone, Debug)]
pub(super) struct Carrier([Numbers; SIZE]);

impl Carrier {
    /// Returns the image of a tangent vector with `size` entries.
    pub(super) fn carry(&self, tangent: &Numbers, size: usize) -> Numbers {
        const PART: usize = 4;
        let mut image = [0.0; SIZE];
        for part in 0..size.div_ceil(PART) {
            let mut sums = [0.0; PART];
            for (column, x) in self.0.iter().zip(&tangent[..size]) {
                let terms = &column[part * PART..][..PART];
                (0..PART).for_each(|i| sums[i] += x * terms[i]);
            }
            image[part * PART..][..PART].copy_from_slice(&sums);
        }
        image
    }
}

/// What a row of constraints holds.
#[derive(Clone, Copy, Debug)]
pub(super) enum Constraint {
    /// A gap on a rigid wall.
    Wall(usize, Side),
    /// A sticking element.
    Element(usize),
}

/// Constraints on rates: each holds a row of `w` still.
pub(super) struct Constraints {
    pub(super) kinds: Vec<Constraint>,
    /// The rows, and their products with the mobility.
    rows: DMatrix<f64>,
    moves: DMatrix<f64>,
    /// Inverse of `rows mobility rows^T`.
    inverse: DMatrix<f64>,
    /// Changes of `w` by unit impulses, in the directions that are still free.
    pub(super) mobility: DMatrix<f64>,
}

impl Constraints {
    /// Collects the constraints of a domain. A row that those before it hold is left out.
    pub(super) fn new(system: &System, key: DomainKey) -> Constraints {
        let n = system.n;
        let held = (0..system.gaps()).filter_map(|gap| Some((gap, key.held[gap]?)));
        let of_walls = held.map(|(gap, side)| {
            let mut row = DVector::zeros(n);
            row[gap] = 1.0;
            (Constraint::Wall(gap, side), row)
        });
        let sticks = |&(i, _): &(usize, &super::system::Element)| key.slips[i] == Slip::Stick;
        let of_elements = system.elements.iter().enumerate().filter(sticks);
        let of_elements = of_elements.map(|(i, element)| (Constraint::Element(i), element.row.clone()));
        Constraints::of(&system.mobility, of_walls.chain(of_elements))
    }

    pub(super) fn of(
        mobility: &DMatrix<f64>,
        rows: impl IntoIterator<Item = (Constraint, DVector<f64>)>,
    ) -> Constraints {
        let (mut left, mut kinds, mut kept) = (mobility.clone(), Vec::new(), Vec::new());
        for (kind, row) in rows {
            let along = &left * &row;
            let free = along.dot(&row);
            if free > NO_MOBILITY * (mobility * &row).dot(&row) {
                left -= &along * along.transpose() / free;
                kinds.push(kind);
                kept.push(row);
            }
        }
        let n = mobility.nrows();
        let rows = DMatrix::from_fn(kept.len(), n, |i, j| kept[i][j]);
        let moves = mobility * rows.transpose();
        let inverse =
            (&rows * &moves).try_inverse().unwrap_or_else(|| DMatrix::zeros(kept.len(), kept.len()));
        Constraints { kinds, rows, moves, inverse, mobility: left }
    }
}
