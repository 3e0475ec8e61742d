//! The linear equations of motion of one combination of modes.

use std::sync::OnceLock;

use nalgebra::DMatrix;
use wide::f64x4;

use super::constraints::{Constraint, Constraints, NO_MOBILITY};
use super::frame::Frame;
use super::modes::{Pieces, signed};
use super::polynomial::{ORDER, Polynomial, Weights, combine, rest, stretched};
use super::{Numbers, PhasePoint, ROUNDING, SIZE, WIDTH};
use crate::model::{MOST_COORDINATES, MOST_FRICTION, MOST_GAPS, Side};
use crate::motion::Slip;

/// Taylor radius: the largest product of a step and the rate of its domain.
pub(super) const RADIUS: f64 = 1.6;

/// Number of derivatives that are compared with zero. A force on one end of a chain of eight masses appears in the 16th derivative of the
/// other end.
const DERIVATIVES: usize = 16;

/// Order of the root of a function that stays zero: all derivatives are zero within rounding.
pub(super) const STAYS_ZERO: usize = usize::MAX;

/// The modes that the linear equations depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DomainKey {
    pub(super) stage: usize,
    /// For each gap the number of walls whose springs act: positive on the right, negative on the left.
    pub(super) engaged: [i8; MOST_GAPS],
    /// The rigid wall that each gap rests on.
    pub(super) held: [Option<Side>; MOST_GAPS],
    pub(super) slips: [Slip; MOST_FRICTION],
    pub(super) pieces: Pieces,
}

/// A linear functional of a [`PhasePoint`], also called a row.
#[derive(Clone, Debug)]
pub(super) struct Functional(pub(super) PhasePoint);

/// Number of SIMD registers that hold a point.
const POINT_REGISTERS: usize = WIDTH / 4;

fn registers(point: &PhasePoint) -> [f64x4; POINT_REGISTERS] {
    std::array::from_fn(|i| f64x4::new(point.as_chunks().0[i]))
}

impl Functional {
    pub(super) const ZERO: Functional = Functional([0.0; WIDTH]);

    pub(super) fn dot(&self, point: &PhasePoint) -> f64 {
        self.value_and_size(point)[0]
    }

    /// Returns the value at a point, and the sum of the moduli of its terms. Rounding errors are relative to this sum.
    pub(super) fn value_and_size(&self, point: &PhasePoint) -> [f64; 2] {
        let terms = registers(&self.0).into_iter().zip(registers(point)).map(|(row, point)| row * point);
        let sums = terms.fold([f64x4::ZERO; 2], |[sum, size], term| [sum + term, size + term.abs()]);
        sums.map(f64x4::reduce_add)
    }

    /// Whether the value at a point is 0 within rounding.
    pub(super) fn vanishes(&self, point: &PhasePoint) -> bool {
        let [value, size] = self.value_and_size(point);
        value.abs() <= ROUNDING * size
    }

    pub(super) fn scaled(&self, factor: f64) -> Functional {
        Functional(self.0.map(|x| factor * x))
    }

    /// Adds a constant.
    pub(super) fn plus(mut self, constant: f64, width: usize) -> Functional {
        self.0[width - 1] += constant;
        self
    }
}

/// A step in a domain. The coordinates are polynomials of the share of the step, from 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Path {
    /// Point at the start of the step.
    point: PhasePoint,
    /// Polynomials of the coordinates. Only the first `expanded` ones are valid.
    pub(super) coordinates: [Polynomial; MOST_COORDINATES],
    expanded: usize,
    /// Bounds on the changes of the coordinates.
    pub(super) changes: [f64; MOST_COORDINATES],
    h: f64,
}

/// One linear domain.
#[derive(Clone, Debug)]
pub(super) struct LinearDomain {
    n: usize,
    width: usize,
    /// Angular frequencies of the harmonics.
    rates: Vec<f64>,
    /// Rows of the accelerations.
    pub(super) accelerations: Vec<Functional>,
    /// Whether the acceleration of each coordinate is exactly 0, because constraints hold it.
    pub(super) is_still: [bool; SIZE],
    /// Elements whose sliding rate constraints hold.
    pub(super) is_driven: [bool; MOST_FRICTION],
    /// Damping matrix, with the dampers of contacts.
    pub(super) damping: DMatrix<f64>,
    /// Longest step.
    pub(super) unit: f64,
    /// For each gap at rest on a rigid wall, the row of the force with which the wall pushes it.
    pub(super) pushes: [Option<Functional>; MOST_GAPS],
    /// Rows of the forces that hold sticking elements. None if other constraints hold the element.
    pub(super) holds: [Option<Functional>; MOST_FRICTION],
    /// For each coordinate and each entry of the start point, a polynomial of the share of the longest step.
    tables: OnceLock<Vec<Polynomial>>,
    /// Carries points over the longest step.
    whole: OnceLock<Carrier>,
}

impl Default for Path {
    fn default() -> Path {
        Path {
            point: [0.0; WIDTH],
            coordinates: [[0.0; ORDER + 1]; MOST_COORDINATES],
            expanded: 0,
            changes: [0.0; MOST_COORDINATES],
            h: 0.0,
        }
    }
}

impl LinearDomain {
    pub(super) fn new(system: &Frame, key: DomainKey) -> LinearDomain {
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
                load[gap] += spring.stiffness * wall.at - side.sign() * spring.force_at_wall();
            }
        }
        // Friction resists, but its power is not that of a damper.
        let mut resistance = damping.clone();
        for ((element, slip), piece) in system.elements.iter().zip(key.slips).zip(key.pieces) {
            if slip != Slip::Stick {
                let [slope, force] = element.curve.pieces[usize::from(piece)];
                load -= &element.row * (slip.sign() * force - slope * element.speed);
                resistance += &element.row * element.row.transpose() * slope;
            }
        }
        for (spring, &piece) in system.springs.iter().zip(&key.pieces[MOST_FRICTION..]) {
            if let Some((gap, side)) = spring.wall
                && key.engaged[gap] != signed(side, system.walls(gap, side).len())
            {
                continue;
            }
            let [slope, force] = spring.curve.pieces[usize::from(piece)];
            load -= &spring.row * force;
            stiffness += &spring.row * spring.row.transpose() * slope;
        }
        // Rows of the forces on each coordinate, without constraints.
        let mut rows = DMatrix::zeros(n, width);
        rows.view_mut((0, 0), (n, n)).copy_from(&-&stiffness);
        rows.view_mut((0, n), (n, n)).copy_from(&-&resistance);
        for (k, [cos, sin]) in system.drives.iter().enumerate() {
            rows.set_column(2 * (n + k), cos);
            rows.set_column(2 * (n + k) + 1, sin);
        }
        rows.set_column(width - 1, &load);
        let constraints = Constraints::new(system, &key.held, &key.slips);
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
        let mut is_driven = [false; MOST_FRICTION];
        for (element, is_driven) in system.elements.iter().zip(&mut is_driven) {
            let [left, all] =
                [&constraints.mobility, &system.mobility].map(|m| (m * &element.row).dot(&element.row));
            *is_driven = left <= NO_MOBILITY * all;
        }
        let row = |matrix: &DMatrix<f64>, i: usize| {
            Functional(std::array::from_fn(|j| if j < width { matrix[(i, j)] } else { 0.0 }))
        };
        let mut pushes = [const { None }; MOST_GAPS];
        let mut holds = [const { None }; MOST_FRICTION];
        for (i, constraint) in constraints.kinds.iter().enumerate() {
            match *constraint {
                Constraint::Wall(gap, side) => pushes[gap] = Some(row(&multipliers, i).scaled(side.sign())),
                Constraint::Element(i_element) => holds[i_element] = Some(row(&multipliers, i)),
            }
        }
        LinearDomain {
            n,
            width,
            rates: system.orders.iter().map(|order| order * system.machine.omega).collect(),
            accelerations: (0..n).map(|i| row(&bound, i)).collect(),
            is_still,
            is_driven,
            unit: RADIUS / system.rate(&stiffness, &resistance),
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
    pub(super) fn unit_row(&self, entry: usize) -> Functional {
        let mut row = [0.0; WIDTH];
        row[entry] = 1.0;
        Functional(row)
    }

    /// Returns the time derivative of a point.
    pub(super) fn derivative(&self, point: &PhasePoint) -> PhasePoint {
        let n = self.n;
        let mut rate = [0.0; WIDTH];
        rate[..n].copy_from_slice(&point[n..2 * n]);
        rate[n..].iter_mut().zip(&self.accelerations).for_each(|(rate, row)| *rate = row.dot(point));
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            (rate[at], rate[at + 1]) = (-omega * point[at + 1], omega * point[at]);
        }
        rate
    }

    /// Returns the time derivative of a functional along the motion, as a functional.
    pub(super) fn rate_of(&self, row: &Functional) -> Functional {
        let n = self.n;
        let mut sums = [f64x4::ZERO; POINT_REGISTERS];
        for (acceleration, &factor) in self.accelerations.iter().zip(&row.0[n..]) {
            if factor != 0.0 {
                let (terms, factor) = (registers(&acceleration.0), f64x4::splat(factor));
                (0..POINT_REGISTERS).for_each(|i| sums[i] = terms[i].mul_add(factor, sums[i]));
            }
        }
        let mut rate = [0.0; WIDTH];
        rate.as_chunks_mut().0.iter_mut().zip(sums).for_each(|(rate, sum)| *rate = sum.to_array());
        rate[n..2 * n].iter_mut().zip(&row.0).for_each(|(rate, x)| *rate += x);
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            rate[at] += omega * row.0[at + 1];
            rate[at + 1] -= omega * row.0[at];
        }
        Functional(rate)
    }

    /// Finds the first derivative, of order `first` or higher, that is not 0 within rounding. Returns its order and value, or
    /// [`STAYS_ZERO`] and 0 if there is none.
    pub(super) fn first_derivative(
        &self,
        row: &Functional,
        point: &PhasePoint,
        first: usize,
    ) -> (usize, f64) {
        let value = |row: &Functional| {
            let [value, size] = row.value_and_size(point);
            (value.abs() > ROUNDING * size).then_some(value)
        };
        if first == 0
            && let Some(value) = value(row)
        {
            return (0, value);
        }
        let mut rate = self.rate_of(row);
        for order in 1..first + DERIVATIVES {
            if order >= first
                && let Some(value) = value(&rate)
            {
                return (order, value);
            }
            rate = self.rate_of(&rate);
        }
        (STAYS_ZERO, 0.0)
    }

    /// Finds the first derivative of a coordinate, of order 2 or higher, that is not 0 within rounding, like [`LinearDomain::first_derivative`].
    pub(super) fn departure(&self, coordinate: usize, point: &PhasePoint) -> (usize, f64) {
        let (order, value) = self.first_derivative(&self.accelerations[coordinate], point, 0);
        (order.saturating_add(2), value)
    }

    /// Returns the coefficients of all coordinates on the longest step.
    fn new_tables(&self) -> Vec<Polynomial> {
        let mut tables = vec![[0.0; ORDER + 1]; self.n * self.width];
        for (i, table) in tables.chunks_exact_mut(self.width).enumerate() {
            let mut row = self.unit_row(i);
            for k in 0..=ORDER {
                table.iter_mut().zip(&row.0).for_each(|(column, x)| column[k] = *x);
                row = self.rate_of(&row).scaled(self.unit / (k + 1) as f64);
            }
        }
        tables
    }

    /// Returns the coefficients of each coordinate on the longest step.
    fn tables(&self) -> impl Iterator<Item = &[Polynomial]> {
        self.tables.get_or_init(|| self.new_tables()).chunks_exact(self.width)
    }

    /// Begins a step over a time `h` of at most the longest step.
    pub(super) fn begin(&self, point: &PhasePoint, h: f64, path: &mut Path) {
        (path.point, path.h, path.expanded) = (*point, h, 0);
    }

    /// Expands the first `count` coordinates on a step, unless they are already expanded.
    pub(super) fn expand(&self, path: &mut Path, count: usize) {
        let part = path.h / self.unit;
        for (i, table) in self.tables().enumerate().take(count).skip(path.expanded) {
            let whole = combine(table, &path.point[..self.width]);
            path.coordinates[i] = if path.h < self.unit { stretched(&whole, part) } else { whole };
            path.changes[i] = rest(&path.coordinates[i]);
        }
        path.expanded = path.expanded.max(count);
    }

    /// Writes the state at a share of a step. All coordinates must be expanded.
    pub(super) fn set_state(&self, y: &mut [f64], path: &Path, share: f64) {
        let weights = Weights::at(share);
        for (i, coordinate) in path.coordinates.iter().enumerate().take(self.n) {
            let [value, slope] = weights.of(coordinate);
            (y[i], y[self.n + i]) = (value, slope / path.h);
        }
    }

    /// Returns the whole point at a share of a step.
    pub(super) fn point(&self, path: &Path, share: f64) -> PhasePoint {
        let mut point = [0.0; WIDTH];
        self.set_state(&mut point, path, share);
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (self.n + k);
            let ([cos, sin], (sin_turn, cos_turn)) =
                ([path.point[at], path.point[at + 1]], (omega * share * path.h).sin_cos());
            (point[at], point[at + 1]) = (cos * cos_turn - sin * sin_turn, sin * cos_turn + cos * sin_turn);
        }
        point[self.width - 1] = 1.0;
        point
    }

    /// Returns a functional as a polynomial of the share of a step.
    pub(super) fn along(&self, row: &Functional, path: &Path) -> Polynomial {
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

    /// Returns the carrier over the longest step.
    pub(super) fn whole(&self) -> &Carrier {
        self.whole.get_or_init(|| {
            let mut carrier = Carrier::default();
            self.set_carrier(&mut carrier, self.unit, self.width);
            carrier
        })
    }

    /// Fills a carrier with the changes of the first `count` unit vectors over a time up to the longest step.
    pub(super) fn set_carrier(&self, carrier: &mut Carrier, time: f64, count: usize) {
        let (n, weights) = (self.n, Weights::at(time / self.unit));
        carrier.0.clear();
        carrier.0.resize(count, [0.0; SIZE]);
        for (i, table) in self.tables().enumerate() {
            for (change, column) in carrier.0.iter_mut().zip(table) {
                let [value, slope] = weights.later(column);
                (change[i], change[n + i]) = (value, slope / self.unit);
            }
        }
    }
}

/// The propagator over a time, minus the identity: its columns are the changes of unit vectors.
#[derive(Clone, Debug, Default)]
pub(super) struct Carrier(Vec<Numbers>);

impl Carrier {
    /// Applies the propagator to a point or to a tangent vector. Only the first `size` entries of the result are valid.
    pub(super) fn carry(&self, from: &[f64], size: usize) -> Numbers {
        let mut image = [0.0; SIZE];
        let parts = image.as_chunks_mut::<4>().0.iter_mut().zip(from.as_chunks().0).take(size.div_ceil(4));
        for (part, (image, &start)) in parts.enumerate() {
            let mut change = f64x4::ZERO;
            for (column, &x) in self.0.iter().zip(from) {
                change = f64x4::new(column.as_chunks().0[part]).mul_add(f64x4::splat(x), change);
            }
            *image = (f64x4::new(start) + change).to_array();
        }
        image
    }
}
