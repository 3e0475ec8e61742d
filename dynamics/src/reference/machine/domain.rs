//! The linear equations of motion of one combination of modes.

use nalgebra::{DMatrix, DVector};

use super::polynomial::{ORDER, Polynomial};
use super::system::System;
use super::{Numbers, Point, SIZE, WIDTH};
use crate::flow::Slip;
use crate::model::{MOST_FRICTION, MOST_GAPS, Side};

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

/// The Taylor terms of a step, as multiples of powers of the share of the step.
pub(super) type Series = [Point; ORDER + 1];

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
        let mut rate = [0.0; WIDTH];
        self.differentiate(point, 1.0, &mut rate);
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

    /// Writes `factor` times the time derivative of a point to `rate`.
    fn differentiate(&self, point: &Point, factor: f64, rate: &mut Point) {
        let n = self.n;
        for i in 0..n {
            rate[i] = factor * point[n + i];
        }
        for (rate, row) in rate[n..].iter_mut().zip(&self.accelerations) {
            *rate = factor * dot(&row.0[..self.width], &point[..self.width]);
        }
        for (k, omega) in self.rates.iter().enumerate() {
            let (at, turn) = (2 * (n + k), factor * omega);
            (rate[at], rate[at + 1]) = (-turn * point[at + 1], turn * point[at]);
        }
        rate[self.width - 1] = 0.0;
    }

    /// Computes the Taylor terms of a step of length `h`.
    pub(super) fn expand(&self, point: &Point, h: f64, series: &mut Series) {
        series[0] = *point;
        for k in 0..ORDER {
            let (done, next) = series.split_at_mut(k + 1);
            self.differentiate(&done[k], h / (k + 1) as f64, &mut next[0]);
        }
    }

    /// Returns the whole point at a share of a step.
    pub(super) fn point(&self, series: &Series, share: f64) -> Point {
        let mut point = [0.0; WIDTH];
        for term in series.iter().rev() {
            for (x, term) in point.iter_mut().zip(&term[..self.width]) {
                *x = *x * share + term;
            }
        }
        point
    }

    /// Returns the state at a share of a step.
    pub(super) fn state(&self, series: &Series, share: f64) -> Numbers {
        let mut y = [0.0; SIZE];
        if share == 1.0 {
            // The small terms first.
            for term in series.iter().rev() {
                y.iter_mut().zip(&term[..2 * self.n]).for_each(|(y, term)| *y += term);
            }
            return y;
        }
        for term in series.iter().rev() {
            for (y, term) in y.iter_mut().zip(&term[..2 * self.n]) {
                *y = *y * share + term;
            }
        }
        y
    }

    /// Returns a functional on a step.
    pub(super) fn along(&self, row: &Row, series: &Series) -> Polynomial {
        let row = &row.0[..self.width];
        std::array::from_fn(|k| dot(row, &series[k][..self.width]))
    }

    /// Returns a tangent vector after a time of at most one step.
    pub(super) fn carry(&self, tangent: &Numbers, time: f64) -> Numbers {
        let n = self.n;
        let (mut term, mut sum) = (*tangent, *tangent);
        for k in 1..=ORDER {
            let factor = time / k as f64;
            let mut next = [0.0; SIZE];
            for i in 0..n {
                next[i] = factor * term[n + i];
                let row = &self.accelerations[i].0;
                next[n + i] = factor * (0..2 * n).map(|j| row[j] * term[j]).sum::<f64>();
            }
            term = next;
            (0..2 * n).for_each(|i| sum[i] += term[i]);
        }
        sum
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
