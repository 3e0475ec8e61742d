//! Overdamped modes that decay much faster than everything else moves.
//!
//! Light bodies on dampers have them. Soon after an event they have decayed, and the state lies in the *slow subspace*, in which the rates of
//! some coordinates are linear functions of the rest of the point. These rates, and so the equations of motion in this subspace, follow from
//! the left eigenvectors of the fast modes, which power iteration finds. A step there is as long as the slow modes allow.

use nalgebra::{DMatrix, Schur};

use super::domain::{Functional, LinearDomain, RADIUS};
use super::{PhasePoint, ROUNDING};

/// Smallest ratio of the rates of fast and slow modes.
const SEPARATION: f64 = 4.0;

/// Smallest ratio of the decay rate and the modulus of an overdamped mode. Rounding may give a double mode an imaginary part.
const OVERDAMPED: f64 = 0.99;

/// Largest factor of another rate in a slaved rate, and of a displacement in units of the fastest rate. Larger ones are those of modes that
/// share a coordinate.
const MOST_FACTOR: f64 = 100.0;

/// Largest number of steps of the decomposition that gives the eigenvalues.
const MOST_SCHUR_STEPS: usize = 10_000;

/// Largest number of power iterations. At the smallest ratio, 27 reach rounding.
const MOST_ITERATIONS: usize = 64;

/// Largest ratio of the last coefficient of a step's polynomials and the largest one.
const LAST_COEFFICIENT: f64 = 1e-17;

/// Largest number of times that a step is halved because its last coefficient is too large.
const MOST_HALVINGS: u32 = 4;

/// Longest step while a fast mode decays, relative to that of a mode with full amplitude.
const LONGEST_DECAY: f64 = 4.0;

impl LinearDomain {
    /// Returns the equations of motion in the slow subspace. None if their steps would not be much longer. `forced` is the fastest rate of
    /// the forcing.
    pub(super) fn slowed(&self, forced: f64) -> Option<LinearDomain> {
        let (n, bound) = (self.n, 1.0 / self.radian());
        if bound <= SEPARATION * forced {
            return None;
        }
        let state = DMatrix::from_fn(2 * n, 2 * n, |i, j| match i.checked_sub(n) {
            None => f64::from(u8::from(j == n + i)),
            Some(i) => self.accelerations[i].0[j],
        });
        let eigenvalues = Schur::try_new(state, f64::EPSILON, MOST_SCHUR_STEPS)?.complex_eigenvalues();
        let mut modes: Vec<_> = eigenvalues.iter().map(|mode| (mode.norm(), mode.re)).collect();
        modes.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rate_after = |count: usize| modes[count].0.max(forced);
        let decay = |(rate, real): &(f64, f64)| -*real >= OVERDAMPED * rate;
        let strong = modes.iter().take_while(|mode| decay(mode)).count().min(n);
        // Without fast modes, constraints may make the motion much slower than the bound.
        let fastest = |count: usize| if count == 0 { bound } else { modes[count - 1].0 };
        let separate = (0..=strong).rev().filter(|&count| fastest(count) > SEPARATION * rate_after(count));
        separate.filter_map(|count| self.slowed_to(rate_after(count), self.slaved(count)?)).next()
    }

    /// Returns the equations in the slow subspace for the fastest rate in it.
    fn slowed_to(&self, rate: f64, slaved: Vec<(usize, Functional)>) -> Option<LinearDomain> {
        let steps = (0..MOST_HALVINGS).map(|halvings| RADIUS / rate * 0.5f64.powi(halvings as i32));
        let slowed = steps.map(|unit| self.with_step(unit, slaved.clone()));
        slowed
            .take_while(|slow| slow.unit > self.unit)
            .find(|slow| slow.last_coefficient() <= LAST_COEFFICIENT)
    }

    /// Returns the rates that are functions of the rest of the point if the `count` fastest modes have decayed: the coordinate, and the rate
    /// as a row.
    fn slaved(&self, count: usize) -> Option<Vec<(usize, Functional)>> {
        let n = self.n;
        if count == 0 {
            return Some(Vec::new());
        }
        let mut rows: Vec<Functional> = (n..2 * n).map(|i| self.unit_row(i)).collect();
        let mut places = Vec::new();
        // Fast motion is that of coordinates with large accelerations.
        let size = |row: &Functional| row.0[n..2 * n].iter().map(|x| x.abs()).sum();
        let sizes: Vec<f64> = self.accelerations.iter().map(size).collect();
        for _ in 0..MOST_ITERATIONS {
            let before = rows.clone();
            rows = rows.iter().map(|row| self.rate_of(row)).collect();
            places = reduce(&mut rows, count, &sizes, &places)?;
            let change = |(row, before): (&Functional, &Functional)| {
                let size = row.0.iter().fold(0.0f64, |size, x| size.max(x.abs()));
                row.0.iter().zip(before.0).all(|(x, y)| (x - y).abs() <= ROUNDING * size)
            };
            if before.len() == rows.len() && rows.iter().zip(&before).all(change) {
                let rate = |(&place, row): (&usize, Functional)| {
                    let mut rate = row.scaled(-1.0);
                    places.iter().for_each(|place| rate.0[n + place] = 0.0);
                    (place, rate)
                };
                let is_small = |row: &Functional| {
                    let [displacements, rates] = [&row.0[..n], &row.0[n..2 * n]];
                    displacements.iter().all(|x| x.abs() * self.radian() <= MOST_FACTOR)
                        && rates.iter().all(|x| x.abs() <= MOST_FACTOR)
                };
                return rows.iter().all(is_small).then(|| places.iter().zip(rows).map(rate).collect());
            }
        }
        None
    }

    /// Returns the time derivative of a functional along the slow motion. No row contains the slaved rates.
    pub(super) fn slow_rate_of(&self, row: &Functional) -> Functional {
        let mut rate = self.rate_of(row);
        for (place, slaved) in &self.slaved {
            let factor = std::mem::take(&mut rate.0[self.n + place]);
            rate.0.iter_mut().zip(slaved.0).for_each(|(rate, x)| *rate += factor * x);
        }
        rate
    }

    /// Returns how far a point or tangent vector is from the slow subspace, relative to its terms.
    pub(super) fn excitation(&self, point: &[f64]) -> f64 {
        let excess = |(place, slaved): &(usize, Functional)| {
            let rate = point[self.n + place];
            let [value, size] = slaved.value_and_size(point);
            if value == rate { 0.0 } else { (rate - value).abs() / (size + rate.abs()) }
        };
        self.slaved.iter().map(excess).fold(0.0, f64::max)
    }

    /// Removes what is left of the fast modes.
    pub(super) fn settle(&self, point: &mut [f64]) {
        for (place, slaved) in &self.slaved {
            point[self.n + place] = slaved.value_and_size(point)[0];
        }
    }
}

/// Returns the longest step while the fast modes decay, relative to that for full amplitude: 24 terms of the series are exact within rounding.
pub(super) fn decaying_step(excitation: f64) -> f64 {
    excitation.powf(-1.0 / 24.0).min(LONGEST_DECAY)
}

/// Solves rows for the rates of `count` coordinates, so that each row has the factor 1 for one of them and 0 for the others. Keeps one row
/// for each. The coordinates are those with the largest products of factors and `sizes`, unless `places` has them already.
fn reduce(rows: &mut Vec<Functional>, count: usize, sizes: &[f64], places: &[usize]) -> Option<Vec<usize>> {
    let (n, mut chosen) = (sizes.len(), Vec::new());
    for nth in 0..count {
        let candidates = (nth..rows.len()).flat_map(|row| (0..n).map(move |place| (row, place)));
        let free = candidates.filter(|(_, place)| match places.get(nth) {
            Some(known) => place == known,
            None => !chosen.contains(place),
        });
        let size = |&(row, place): &(usize, usize)| rows[row].0[n + place].abs() * sizes[place];
        let (row, place) = free.max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let pivot = rows[row].0[n + place];
        if pivot * sizes[place] == 0.0 || !pivot.is_finite() {
            return None;
        }
        rows.swap(nth, row);
        rows[nth] = rows[nth].scaled(1.0 / pivot);
        let own: PhasePoint = rows[nth].0;
        for (_, row) in rows.iter_mut().enumerate().filter(|(other, _)| *other != nth) {
            let factor = row.0[n + place];
            row.0.iter_mut().zip(own).for_each(|(x, own)| *x -= factor * own);
        }
        chosen.push(place);
    }
    rows.truncate(count);
    Some(chosen)
}
