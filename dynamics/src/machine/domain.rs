//! The linear equations of motion of one combination of modes.

use std::sync::OnceLock;

use nalgebra::DMatrix;
use wide::f64x4;

use super::constraints::{Constraint, Constraints, NO_MOBILITY};
use super::frame::Frame;
use super::modes::{Pieces, signed};
use super::polynomial::{MOST_REGISTERS, ORDER, Polynomial, REACHES, Weights, combine, registers_for};
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

/// A linear functional of a [`PhasePoint`], also called a row, and the number of SIMD registers that its factors occupy.
#[derive(Clone, Debug)]
pub(super) struct Functional(pub(super) PhasePoint, usize);

impl Functional {
    /// Returns the row 0 for points with `width` entries.
    pub(super) fn zero(width: usize) -> Functional {
        Functional([0.0; WIDTH], width.div_ceil(4))
    }

    pub(super) fn dot(&self, point: &[f64]) -> f64 {
        self.value_and_size(point)[0]
    }

    /// Returns the value at a point, and the sum of the moduli of its terms. Rounding errors are relative to this sum.
    pub(super) fn value_and_size(&self, point: &[f64]) -> [f64; 2] {
        let [mut sum, mut size] = [f64x4::ZERO; 2];
        for (row, point) in self.0.as_chunks().0.iter().zip(point.as_chunks().0).take(self.1) {
            let term = f64x4::new(*row) * f64x4::new(*point);
            (sum, size) = (sum + term, size + term.abs());
        }
        [sum, size].map(f64x4::reduce_add)
    }

    /// Whether the value at a point is 0 within rounding.
    pub(super) fn vanishes(&self, point: &PhasePoint) -> bool {
        let [value, size] = self.value_and_size(point);
        value.abs() <= ROUNDING * size
    }

    pub(super) fn scaled(&self, factor: f64) -> Functional {
        Functional(self.0.map(|x| factor * x), self.1)
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
    /// Number of registers with coefficients.
    pub(super) registers: usize,
}

/// The numbers from 1 on, and their inverses.
const FACTORS: Polynomial = {
    let (mut factors, mut k) = ([0.0; ORDER + 1], 0);
    while k <= ORDER {
        factors[k] = (k + 1) as f64;
        k += 1;
    }
    factors
};
const INVERSES: Polynomial = {
    let (mut inverses, mut k) = (FACTORS, 0);
    while k <= ORDER {
        inverses[k] = 1.0 / inverses[k];
        k += 1;
    }
    inverses
};

/// One linear domain.
#[derive(Clone, Debug)]
pub(super) struct LinearDomain {
    pub(super) n: usize,
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
    /// Carry points over [`REACHES`] of the longest step.
    strides: [OnceLock<Carrier>; REACHES.len()],
    /// The equations of motion after the fast overdamped modes have decayed. None if its steps would not be much longer.
    pub(super) slow: Option<Box<LinearDomain>>,
    /// For equations in the slow subspace, the rates that are functions of the rest of the point.
    pub(super) slaved: Vec<(usize, Functional)>,
}

impl Default for Path {
    fn default() -> Path {
        Path {
            point: [0.0; WIDTH],
            coordinates: [[0.0; ORDER + 1]; MOST_COORDINATES],
            expanded: 0,
            changes: [0.0; MOST_COORDINATES],
            h: 0.0,
            registers: MOST_REGISTERS,
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
            let mut row = Functional::zero(width);
            (0..width).for_each(|j| row.0[j] = matrix[(i, j)]);
            row
        };
        let mut pushes = [const { None }; MOST_GAPS];
        let mut holds = [const { None }; MOST_FRICTION];
        for (i, constraint) in constraints.kinds.iter().enumerate() {
            match *constraint {
                Constraint::Wall(gap, side) => pushes[gap] = Some(row(&multipliers, i).scaled(side.sign())),
                Constraint::Element(i_element) => holds[i_element] = Some(row(&multipliers, i)),
            }
        }
        let mut domain = LinearDomain {
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
            strides: [const { OnceLock::new() }; REACHES.len()],
            slow: None,
            slaved: Vec::new(),
        };
        let forced = system.machine.omega * f64::from(system.machine.highest_order());
        domain.slow = domain.slowed(forced).map(Box::new);
        domain
    }

    /// Returns the same equations with another longest step and other slaved rates.
    pub(super) fn with_step(&self, unit: f64, slaved: Vec<(usize, Functional)>) -> LinearDomain {
        let (tables, strides) = (OnceLock::new(), [const { OnceLock::new() }; REACHES.len()]);
        LinearDomain { unit, slaved, tables, strides, slow: None, ..self.clone() }
    }

    /// Returns the largest ratio of the last coefficient in the tables and the largest one of the same polynomial.
    pub(super) fn last_coefficient(&self) -> f64 {
        let ratio = |c: &Polynomial| {
            let size = c.iter().fold(0.0f64, |size, c| size.max(c.abs()));
            if size == 0.0 { 0.0 } else { c[ORDER].abs() / size }
        };
        self.tables().flatten().map(ratio).fold(0.0, f64::max)
    }

    /// Returns the time in which the fastest rate turns by one radian.
    pub(super) fn radian(&self) -> f64 {
        self.unit / RADIUS
    }

    /// Returns the row of a coordinate, or of its rate.
    pub(super) fn unit_row(&self, entry: usize) -> Functional {
        let mut row = Functional::zero(self.width);
        row.0[entry] = 1.0;
        row
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
        let mut rate = [0.0; WIDTH];
        for (acceleration, &factor) in self.accelerations.iter().zip(&row.0[n..]) {
            if factor != 0.0 {
                let (sums, factor) = (rate.as_chunks_mut().0, f64x4::splat(factor));
                for (sum, terms) in sums.iter_mut().zip(acceleration.0.as_chunks().0).take(acceleration.1) {
                    *sum = f64x4::new(*terms).mul_add(factor, f64x4::new(*sum)).to_array();
                }
            }
        }
        rate[n..2 * n].iter_mut().zip(&row.0).for_each(|(rate, x)| *rate += x);
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            rate[at] += omega * row.0[at + 1];
            rate[at + 1] -= omega * row.0[at];
        }
        Functional(rate, self.width.div_ceil(4))
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
                row = self.slow_rate_of(&row).scaled(self.unit / (k + 1) as f64);
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
        path.point[..self.width].copy_from_slice(&point[..self.width]);
        (path.h, path.expanded, path.registers) = (h, 0, registers_for(h / self.unit));
    }

    /// Expands the first `count` coordinates on a step, unless they are already expanded. The series may be shorter if only the first `share`
    /// of the step matters.
    pub(super) fn expand(&self, path: &mut Path, count: usize, share: f64) {
        if path.expanded >= count {
            return;
        }
        let part = path.h / self.unit;
        let registers = if share == 1.0 { path.registers } else { registers_for(part * share) };
        for (i, table) in self.tables().enumerate().take(count).skip(path.expanded) {
            let (factors, coordinate) = (&path.point[..self.width], &mut path.coordinates[i]);
            path.changes[i] = combine(table, factors, part, registers, coordinate);
        }
        path.expanded = count;
    }

    /// Writes the state at a share of a step. All coordinates must be expanded.
    pub(super) fn set_state(&self, y: &mut [f64], path: &Path, share: f64) {
        match registers_for(path.h / self.unit * share) {
            3 => self.set_state_in::<3>(y, path, share),
            4 => self.set_state_in::<4>(y, path, share),
            _ => self.set_state_in::<MOST_REGISTERS>(y, path, share),
        }
    }

    fn set_state_in<const R: usize>(&self, y: &mut [f64], path: &Path, share: f64) {
        let (weights, per_time) = (Weights::<R>::at(share), 1.0 / path.h);
        for (i, coordinate) in path.coordinates.iter().enumerate().take(self.n) {
            let [value, slope] = weights.of(coordinate);
            (y[i], y[self.n + i]) = (value, slope * per_time);
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
                let terms = coordinate[1..].iter().zip(&FACTORS);
                sum.iter_mut().zip(terms).for_each(|(sum, (c, k))| *sum += factor * k * c);
            }
        }
        for (k, omega) in self.rates.iter().enumerate() {
            let at = 2 * (n + k);
            if row[at] == 0.0 && row[at + 1] == 0.0 {
                continue;
            }
            let [mut cos, mut sin] = [path.point[at], path.point[at + 1]];
            let turn = omega * path.h;
            for (sum, inverse) in sum[..4 * path.registers].iter_mut().zip(&INVERSES) {
                *sum += row[at] * cos + row[at + 1] * sin;
                let turn = turn * inverse;
                (cos, sin) = (-turn * sin, turn * cos);
            }
        }
        sum
    }

    /// Returns the duration of a step over one of [`REACHES`].
    pub(super) fn duration(&self, stride: usize) -> f64 {
        REACHES[stride] * self.unit
    }

    /// Returns the carrier over one of [`REACHES`], if this is the time.
    pub(super) fn whole(&self, stride: usize, time: f64) -> Option<&Carrier> {
        let build = || {
            let mut carrier = Carrier::default();
            self.set_carrier(&mut carrier, time, self.width);
            carrier
        };
        (time == self.duration(stride)).then(|| self.strides[stride].get_or_init(build))
    }

    /// Fills a carrier with the changes of the first `count` unit vectors over a time up to the longest step.
    pub(super) fn set_carrier(&self, carrier: &mut Carrier, time: f64, count: usize) {
        match registers_for(time / self.unit) {
            3 => self.set_carrier_in::<3>(carrier, time, count),
            4 => self.set_carrier_in::<4>(carrier, time, count),
            _ => self.set_carrier_in::<MOST_REGISTERS>(carrier, time, count),
        }
    }

    fn set_carrier_in<const R: usize>(&self, carrier: &mut Carrier, time: f64, count: usize) {
        let (n, weights, per_time) = (self.n, Weights::<R>::at(time / self.unit), 1.0 / self.unit);
        carrier.0.clear();
        carrier.0.resize(count, [0.0; SIZE]);
        for (i, table) in self.tables().enumerate() {
            for (change, column) in carrier.0.iter_mut().zip(table) {
                let [value, slope] = weights.later(column);
                (change[i], change[n + i]) = (value, slope * per_time);
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
        match size.div_ceil(4) {
            1 => self.carried::<1>(from),
            2 => self.carried::<2>(from),
            3 => self.carried::<3>(from),
            _ => self.carried::<{ SIZE / 4 }>(from),
        }
    }

    #[inline(always)]
    fn carried<const P: usize>(&self, from: &[f64]) -> Numbers {
        let (mut image, mut changes) = ([0.0; SIZE], [f64x4::ZERO; P]);
        for (column, &x) in self.0.iter().zip(from) {
            let (parts, x) = (column.as_chunks().0, f64x4::splat(x));
            (0..P).for_each(|part| changes[part] = f64x4::new(parts[part]).mul_add(x, changes[part]));
        }
        let starts = from.as_chunks().0.iter();
        for ((image, start), change) in image.as_chunks_mut().0.iter_mut().zip(starts).zip(changes) {
            *image = (f64x4::new(*start) + change).to_array();
        }
        image
    }
}
