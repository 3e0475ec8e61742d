//! Flights and their derivatives by the state and by parameters.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// Number of terms of a Taylor series over one radian of the fastest rate; the next one is below `1e-21`.
const TERMS: usize = 22;

/// Size of two terms in a row, relative to the sum, after which the others are left out.
const NEGLIGIBLE: f64 = 1e-18;

/// Largest number of steps of a flight.
const MOST_STEPS: f64 = 1e5;

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

/// The end of a flight.
pub(super) struct End {
    /// State `(x1 .. xn, v1 .. vn)`, and its derivatives by the state at the start and by parameters.
    pub(super) state: DVector<f64>,
    pub(super) by_state: DMatrix<f64>,
    pub(super) by_parameter: Vec<DVector<f64>>,
    /// Rates of change of the state at the start and at the end, per turn of the forcing.
    pub(super) rates: [DVector<f64>; 2],
}

/// A flight over given turns of the forcing.
pub(super) struct Flight<'a> {
    pub(super) equations: &'a Equations,
    /// Derivatives of the equations by parameters.
    pub(super) by_parameter: &'a [Equations],
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

    /// Returns the end of the flight; none if it needs too many steps.
    pub(super) fn end(&self, state: &DVector<f64>) -> Option<End> {
        let (size, count, [from, to]) = (state.len(), self.by_parameter.len(), self.turns);
        let steps = ((to - from).abs() / self.radian).ceil().max(1.0);
        if steps.is_nan() || steps > MOST_STEPS {
            return None;
        }
        let h = (to - from) / steps;
        let mut columns = DMatrix::zeros(size + 2 * self.orders.len() + 1, 1 + size + count);
        columns.view_mut((0, 1), (size, size)).fill_with_identity();
        let mut now = state.clone();
        for step in 0..steps as usize {
            columns.set_column(0, &point(self.orders, &now, from + h * step as f64));
            self.step(&mut columns, h);
            now = columns.view((0, 0), (size, 1)).column(0).into_owned();
        }
        Some(End {
            by_state: columns.view((0, 1), (size, size)).into_owned(),
            by_parameter: (0..count)
                .map(|j| columns.view((0, 1 + size + j), (size, 1)).column(0).into_owned())
                .collect(),
            rates: [self.rates(state, from), self.rates(&now, to)],
            state: now,
        })
    }

    /// Carries columns over `h` turns: a point, tangent vectors, and derivatives of the point by parameters.
    fn step(&self, columns: &mut DMatrix<f64>, h: f64) {
        let (width, count) = columns.shape();
        let (size, parameters) = (width - 2 * self.orders.len() - 1, count - self.by_parameter.len());
        let (mut term, mut next) = (columns.clone(), DMatrix::zeros(width, count));
        let (mut small, sum) = (0, columns.as_mut_slice());
        for k in 1..=TERMS {
            next.fill(0.0);
            let (from, to) = (term.as_slice(), next.as_mut_slice());
            for j in 0..count {
                let (column, rates) =
                    (&from[j * width..(j + 1) * width], &mut to[j * width..(j + 1) * width]);
                self.equations.add_rates(column, rates);
                if let Some(by) = j.checked_sub(parameters).map(|j| &self.by_parameter[j]) {
                    by.add_rates(&from[..width], rates);
                }
                for (k, order) in self.orders.iter().enumerate() {
                    let (at, rate) = (size + 2 * k, TAU * order);
                    (rates[at], rates[at + 1]) = (-rate * column[at + 1], rate * column[at]);
                }
            }
            let factor = h / k as f64;
            let mut is_small = true;
            for (sum, term) in sum.iter_mut().zip(to) {
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
    }
}
