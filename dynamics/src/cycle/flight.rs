//! Flights and their derivatives by the state and by parameters.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// Angle, in radians of the fastest rate, of the longest flight whose map is a Taylor series; its number of terms. The next one is below `1e-19`.
const LONGEST: f64 = 1.0 / 16.0;
const TERMS: usize = 12;

/// Size of two terms in a row, relative to the sum, after which the others are left out.
const NEGLIGIBLE: f64 = 1e-18;

/// Largest number of radians of a flight.
const MOST_RADIANS: f64 = 1e5;

/// The equations of a flight in turns of the forcing: rows of the accelerations, multiplied by the forcing period, for points
/// `(x1 .. xn, v1 .. vn, cos, sin, ..., 1)`; or the derivatives of both by a parameter.
#[derive(Clone, Debug)]
pub(super) struct Equations {
    pub(super) period: f64,
    pub(super) accelerations: DMatrix<f64>,
}

impl Equations {
    /// Adds the rates of change of a point's state.
    fn add_rates(&self, point: &[f64], rates: &mut [f64]) {
        let n = self.accelerations.nrows();
        let (of_positions, of_velocities) = rates.split_at_mut(n);
        of_positions.iter_mut().zip(&point[n..2 * n]).for_each(|(rate, v)| *rate += self.period * v);
        for (column, x) in self.accelerations.as_slice().chunks_exact(n).zip(point) {
            of_velocities.iter_mut().zip(column).for_each(|(rate, row)| *rate += row * x);
        }
    }
}

impl Equations {
    /// Adds the product of a row and the matrix of these equations.
    fn add_product(&self, row: &[f64], to: &mut [f64]) {
        let n = self.accelerations.nrows();
        let (positions, velocities) = row[..2 * n].split_at(n);
        to[n..2 * n].iter_mut().zip(positions).for_each(|(to, x)| *to += self.period * x);
        for (column, to) in self.accelerations.as_slice().chunks_exact(n).zip(to) {
            *to += column.iter().zip(velocities).map(|(a, v)| a * v).sum::<f64>();
        }
    }
}

/// The end of a flight.
pub(super) struct End {
    /// State `(x1 .. xn, v1 .. vn)`, and its derivatives by the state at the start and by parameters.
    pub(super) state: DVector<f64>,
    pub(super) by_state: DMatrix<f64>,
    pub(super) by_parameter: Vec<Option<DVector<f64>>>,
    /// Rates of change of the state at the start and at the end, per turn of the forcing.
    pub(super) rates: [DVector<f64>; 2],
}

/// A flight over given turns of the forcing.
pub(super) struct Flight<'a> {
    pub(super) equations: &'a Equations,
    /// Derivatives of the equations by parameters; none by those on which the equations do not depend.
    pub(super) by_parameter: &'a [Option<Equations>],
    pub(super) orders: &'a [f64],
    /// Turns in which the fastest rate turns by one radian.
    pub(super) radian: f64,
    pub(super) turns: [f64; 2],
}

/// Returns the point of a state at a time in turns.
pub(super) fn point(orders: &[f64], state: &DVector<f64>, turns: f64) -> DVector<f64> {
    let phasors = orders.iter().flat_map(|order| {
        let (sin, cos) = (TAU * (order * turns.fract()).fract()).sin_cos();
        [cos, sin]
    });
    DVector::from_vec(state.iter().copied().chain(phasors).chain([1.0]).collect())
}

/// Returns the rate of change, per turn, of a function of points by the phasors alone. `row`: its factors.
pub(super) fn drift(orders: &[f64], row: &DVector<f64>, point: &DVector<f64>) -> f64 {
    let size = point.len() - 2 * orders.len() - 1;
    let of_order = |(k, order): (usize, &f64)| {
        let at = size + 2 * k;
        TAU * order * (row[at + 1] * point[at] - row[at] * point[at + 1])
    };
    orders.iter().enumerate().map(of_order).sum()
}

impl Flight<'_> {
    /// Returns the rates of change of the state, per turn.
    fn rates(&self, state: &DVector<f64>, turns: f64) -> DVector<f64> {
        let mut rates = DVector::zeros(state.len());
        self.equations.add_rates(point(self.orders, state, turns).as_slice(), rates.as_mut_slice());
        rates
    }

    /// Returns the end of the flight; none if it is too long.
    pub(super) fn end(&self, state: &DVector<f64>) -> Option<End> {
        let (size, [from, to]) = (state.len(), self.turns);
        let radians = (to - from).abs() / self.radian;
        if radians.is_nan() || radians > MOST_RADIANS {
            return None;
        }
        // The map over the flight is that over a short time, squared several times (Moler and Van Loan 2003, method 3).
        let squarings = (radians / LONGEST).max(1.0).log2().ceil() as i32;
        let mut h = (to - from) * 0.5_f64.powi(squarings);
        let mut map = self.short_map(size, h);
        for _ in 0..squarings {
            map = map.squared(self.orders, h);
            h *= 2.0;
        }
        let start = point(self.orders, state, from);
        let change = map.rows_of(0);
        let end = state + &change * &start;
        let mut blocks = 1..;
        let mut of_next = || map.rows_of(blocks.next().expect("there is no last number")) * &start;
        Some(End {
            by_state: change.columns(0, size) + DMatrix::identity(size, size),
            by_parameter: self.by_parameter.iter().map(|by| by.as_ref().map(|_| of_next())).collect(),
            rates: [self.rates(state, from), self.rates(&end, to)],
            state: end,
        })
    }

    /// Returns the map over `h` turns, a short time, as a Taylor series.
    fn short_map(&self, size: usize, h: f64) -> Map {
        let by_parameter: Vec<&Equations> = self.by_parameter.iter().flatten().collect();
        let (width, blocks) = (size + 2 * self.orders.len() + 1, 1 + by_parameter.len());
        let length = size * width;
        let mut sum = vec![0.0; blocks * length];
        let (mut term, mut next) = (sum.clone(), sum.clone());
        (0..size).for_each(|i| term[i * width + i] = 1.0);
        let mut small = 0;
        for k in 1..=TERMS {
            next.fill(0.0);
            for (block, to) in next.chunks_exact_mut(length).enumerate() {
                let from = &term[block * length..(block + 1) * length];
                for (from, to) in from.chunks_exact(width).zip(to.chunks_exact_mut(width)) {
                    self.equations.add_product(from, to);
                    for (order, at) in self.orders.iter().zip((size..).step_by(2)) {
                        let rate = TAU * order;
                        to[at] += rate * from[at + 1];
                        to[at + 1] -= rate * from[at];
                    }
                }
                if let Some(by) = block.checked_sub(1).map(|j| by_parameter[j]) {
                    let of_term = term[..length].chunks_exact(width);
                    of_term.zip(to.chunks_exact_mut(width)).for_each(|(from, to)| by.add_product(from, to));
                }
            }
            let factor = h / k as f64;
            let mut is_small = true;
            for (sum, term) in sum.iter_mut().zip(&mut next) {
                *term *= factor;
                is_small = is_small && term.abs() <= NEGLIGIBLE * sum.abs();
                *sum += *term;
            }
            // Even and odd terms may vanish apart from each other.
            small = if is_small { small + 1 } else { 0 };
            if small == 2 {
                break;
            }
            std::mem::swap(&mut term, &mut next);
        }
        Map { size, width, entries: sum }
    }
}

/// The linear map of points over a time: for each entry of the state, the factors of the point at the start in the change of this entry. Changes
/// keep the precision of short times. Other blocks have the derivatives of these factors by parameters.
struct Map {
    size: usize,
    width: usize,
    /// Blocks of `size` rows of `width` entries.
    entries: Vec<f64>,
}

impl Map {
    /// Returns the rows of a block.
    fn rows_of(&self, block: usize) -> DMatrix<f64> {
        let length = self.size * self.width;
        DMatrix::from_row_slice(self.size, self.width, &self.entries[block * length..(block + 1) * length])
    }

    /// Returns the map over twice the time; `h`: the time of this one, in turns.
    fn squared(&self, orders: &[f64], h: f64) -> Map {
        let Map { size, width, entries } = self;
        let (size, width, length) = (*size, *width, size * width);
        let own = &entries[..length];
        let add_product = |left: &[f64], right: &[f64], to: &mut [f64]| {
            for (factor, row) in left[..size].iter().zip(right.chunks_exact(width)) {
                to.iter_mut().zip(row).for_each(|(to, x)| *to += factor * x);
            }
        };
        // The change over the second half, from the state after the first half.
        let mut squared: Vec<f64> = entries.iter().map(|x| 2.0 * x).collect();
        for (order, at) in orders.iter().zip((size..).step_by(2)) {
            let (sin, cos) = (TAU * order * h).sin_cos();
            for (row, to) in entries.chunks_exact(width).zip(squared.chunks_exact_mut(width)) {
                to[at] = row[at] + (cos * row[at] + sin * row[at + 1]);
                to[at + 1] = row[at + 1] + (cos * row[at + 1] - sin * row[at]);
            }
        }
        for (block, to) in squared.chunks_exact_mut(length).enumerate() {
            let of_block = &entries[block * length..(block + 1) * length];
            for (i, to) in to.chunks_exact_mut(width).enumerate() {
                let row = i * width..(i + 1) * width;
                add_product(&of_block[row.clone()], own, to);
                if block > 0 {
                    add_product(&own[row], of_block, to);
                }
            }
        }
        Map { size, width, entries: squared }
    }
}
