//! One linear forced domain: generator, Taylor table, propagators.

use nalgebra::{Matrix4, SMatrix};

use super::columns::{Columns, add};
use super::energy::EnergyBound;
use super::generator::{Generator, generator, rate};
use super::{Gap, Phasor};
use crate::model::{Domain, Oscillator};

/// Terms of the Taylor table: what is left out is below `1.6^23 / 23! < 2e-18`.
pub(crate) const ORDER: usize = 22;

/// Largest `|G| h` at which the Taylor table is used. Larger costs digits by cancellation;
/// smaller costs steps (0.8 to 1.6: a third fewer steps per period, 7 % fewer instructions).
const RADIUS: f64 = 1.6;

/// Largest `|G| h` from which [`LinearFlow::propagate`] doubles: time matters less there,
/// and half the Taylor radius has the smallest error.
const DOUBLING_RADIUS: f64 = 0.5 * RADIUS;

/// Halvings of the Taylor step, enough to resolve any grazing that rounding leaves visible.
const FINE_LEVELS: usize = 26;

/// Doublings of the Taylor step, by squaring; each costs about one bit.
const COARSE_LEVELS: usize = 3;

/// The propagator of a partial step, less the identity, so that small departures keep
/// their relative accuracy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Partial(Columns);

impl Partial {
    /// What is added to the state.
    #[inline(always)]
    pub(crate) fn increment(&self, q: &Gap, phasor: &Phasor) -> Gap {
        self.0.apply(q, phasor)
    }

    /// The tangent vector after the partial step.
    #[inline(always)]
    pub(crate) fn apply_tangent(&self, u: &Gap) -> Gap {
        add(u, &self.0.apply_tangent(u))
    }

    /// The forcing phasor after the partial step.
    #[inline(always)]
    pub(crate) fn rotate(&self, p: &Phasor) -> Phasor {
        let [c, s] = self.0.rotate(p);
        [p[0] + c, p[1] + s]
    }
}

/// The propagator of one step length.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// Step length.
    pub(crate) h: f64,
    /// Step length in units of the Taylor step, and its sixth power.
    pub(crate) u: f64,
    pub(crate) u6: f64,
    /// The propagator, less the identity.
    pub(crate) propagator: Partial,
}

/// The exact flow of one linear domain.
#[derive(Clone, Debug)]
pub struct LinearFlow {
    generator: Generator,
    omega: f64,
    /// A bound on all rates of the domain.
    pub(crate) rate: f64,
    /// The Taylor step: the unit of time of the series below.
    pub(crate) unit: f64,
    /// Propagators, coarsest first, each half as long as the one before.
    pub(crate) steps: Vec<Step>,
    /// Index of the longest step that the Taylor table covers.
    pub(crate) taylor_level: usize,
    /// Taylor table of the propagator: term `n` multiplies `u^(n+1)`.
    table: Vec<Columns>,
    /// Columns of the vector field `(w, w', v, v')`.
    field: Columns,
    /// Rows of `z'', z''', z''''` on `a`.
    gap_rates: [[f64; 7]; 3],
    /// Bound on `z^(6)`, for the gap itself.
    pub(crate) gap_bound: EnergyBound,
    /// Bound on `z^(8)`, for the relative acceleration.
    pub(crate) pressing_bound: EnergyBound,
}

impl LinearFlow {
    /// Bytes beside the struct itself.
    #[cfg(test)]
    pub(super) fn heap_bytes(&self) -> usize {
        self.steps.capacity() * size_of::<Step>() + self.table.capacity() * size_of::<Columns>()
    }

    pub(super) fn new(oscillator: &Oscillator, domain: &Domain) -> LinearFlow {
        let generator = generator(oscillator, domain);
        let rate = rate(oscillator, domain);
        let unit = RADIUS / rate;
        let table = taylor_table(&generator, unit);
        let omega = oscillator.omega;

        // Steps longer than half a forcing period would only be cut short by the strobe.
        let fit = (0.5 * oscillator.period() / unit).log2().floor();
        let coarse = fit.clamp(0.0, COARSE_LEVELS as f64) as usize;
        let mut longer = vec![departure(&table, 1.0)];
        for _ in 0..coarse {
            let last = longer[longer.len() - 1];
            longer.push(doubled(&last));
        }
        let step = |halvings: i32, less: &Generator| {
            let u = 0.5f64.powi(halvings);
            Step { h: u * unit, u, u6: u.powi(6), propagator: Partial(Columns::of(less)) }
        };
        let mut steps: Vec<Step> =
            longer.iter().enumerate().rev().map(|(i, less)| step(-(i as i32), less)).collect();
        for halvings in 1..=FINE_LEVELS as i32 {
            steps.push(step(halvings, &departure(&table, 0.5f64.powi(halvings))));
        }

        let mut power = generator;
        let mut gap_rates = [[0.0; 7]; 3];
        for rates in &mut gap_rates {
            power *= generator;
            *rates = std::array::from_fn(|j| power[(0, j)]);
        }
        LinearFlow {
            field: Columns::of(&generator),
            gap_bound: EnergyBound::new(oscillator, domain, &generator, 5, unit),
            pressing_bound: EnergyBound::new(oscillator, domain, &generator, 7, unit),
            generator,
            omega,
            rate,
            unit,
            steps,
            taylor_level: coarse,
            table,
            gap_rates,
        }
    }

    /// The vector field `(w, w', v, v')` at a point.
    #[inline(always)]
    pub fn field(&self, q: &Gap, phasor: &Phasor) -> Gap {
        self.field.apply(q, phasor)
    }

    /// The first four time derivatives of `q` along the solution.
    #[inline(always)]
    pub(crate) fn derivatives(&self, q: &Gap, phasor: &Phasor) -> [Gap; 4] {
        let turn = |p: &Phasor| [-self.omega * p[1], self.omega * p[0]];
        let p1 = turn(phasor);
        let p2 = turn(&p1);
        let d1 = self.field.apply(q, phasor);
        let d2 = self.field.apply_unloaded(&d1, &p1);
        let d3 = self.field.apply_unloaded(&d2, &p2);
        [d1, d2, d3, self.field.apply_unloaded(&d3, &turn(&p2))]
    }

    /// The tangent vector a small time `delta` later, to second order.
    #[inline(always)]
    pub(crate) fn nudge_tangent(&self, u: &Gap, delta: f64) -> Gap {
        let first = self.field.apply_tangent(u);
        let second = self.field.apply_tangent(&first);
        std::array::from_fn(|i| u[i] + delta * (first[i] + 0.5 * delta * second[i]))
    }

    /// The propagator, less the identity, of `u` Taylor units, `0 <= u <= 1`.
    #[inline(always)]
    pub(crate) fn partial(&self, u: f64) -> Partial {
        Partial(Columns::horner(&self.table[..terms(u)], u))
    }

    /// The relative acceleration `w' = z''`.
    #[inline]
    pub fn acceleration(&self, q: &Gap, phasor: &Phasor) -> f64 {
        dot(&self.gap_rates[0], q, phasor)
    }

    /// `z'', z''', z''''`.
    #[inline]
    pub(crate) fn acceleration_rates(&self, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        self.gap_rates.map(|row| dot(&row, q, phasor))
    }

    /// The row of the relative acceleration on `a = (z, w, x, v, cos, sin, 1)`.
    pub(crate) fn acceleration_row(&self) -> &[f64; 7] {
        &self.gap_rates[0]
    }

    /// The fundamental matrix `exp(A tau)` in gap coordinates.
    pub fn fundamental(&self, tau: f64) -> Matrix4<f64> {
        Matrix4::identity() + self.departure(tau).fixed_view::<4, 4>(0, 0)
    }

    /// The state a time `tau >= 0` later, for any `tau`.
    ///
    /// Scaling and squaring of the Taylor table; the error grows like rounding in
    /// `|G| tau` does.
    pub fn propagate(&self, q: Gap, phasor: Phasor, tau: f64) -> Gap {
        let a = SMatrix::<f64, 7, 1>::from([q[0], q[1], q[2], q[3], phasor[0], phasor[1], 1.0]);
        let moved = self.departure(tau) * a;
        add(&q, &[moved[0], moved[1], moved[2], moved[3]])
    }

    /// `exp(G tau)`, less the identity.
    fn departure(&self, tau: f64) -> Generator {
        let doublings = (self.rate * tau / DOUBLING_RADIUS).log2().ceil().max(0.0) as i32;
        let u = tau / self.unit * 0.5f64.powi(doublings);
        (0..doublings).fold(departure(&self.table, u), |less, _| doubled(&less))
    }

    /// Trace of the generator on `q`: the rate at which phase volume shrinks.
    pub fn trace(&self) -> f64 {
        self.generator.fixed_view::<4, 4>(0, 0).trace()
    }
}

#[inline]
fn dot(row: &[f64; 7], q: &Gap, phasor: &Phasor) -> f64 {
    (row[0] * q[0] + row[1] * q[1])
        + (row[2] * q[2] + row[3] * q[3])
        + (row[4] * phasor[0] + row[5] * phasor[1])
        + row[6]
}

/// Terms `(G unit)^(n+1) / (n+1)!` of the propagator.
fn taylor_table(generator: &Generator, unit: f64) -> Vec<Columns> {
    let mut power = Generator::identity();
    let mut term = |n: usize| {
        power = power * generator * (unit / n as f64);
        Columns::of(&power)
    };
    (1..=ORDER).map(&mut term).collect()
}

/// Terms that matter, by the size of `u`: the first one left out is below 1e-17.
#[inline(always)]
fn terms(u: f64) -> usize {
    match u {
        u if u < 0.02 => 8,
        u if u < 0.15 => 12,
        u if u < 0.5 => 17,
        _ => ORDER,
    }
}

/// The propagator of `u` Taylor units, `0 <= u <= 1`, less the identity.
fn departure(table: &[Columns], u: f64) -> Generator {
    Columns::horner(table, u).matrix()
}

/// The propagator of twice the time, less the identity, from that of once: squaring the
/// departure instead of the whole loses fewer digits.
fn doubled(less: &Generator) -> Generator {
    less * less + less * 2.0
}
