//! One linear forced domain: generator, Taylor table, propagators.

use nalgebra::{Matrix4, SMatrix};
use wide::f64x4;

use super::columns::Columns;
use super::constrained;
use super::energy::EnergyBound;
use super::expansion::{FINEST_PART, Grid};
use super::gap_polynomial::GapPolynomial;
use super::generator::{Generator, generator, rate};
use super::short_flight::ShortFlight;
use super::{Gap, Phasor};
use crate::fused::fma;
use crate::model::{Domain, Oscillator};

/// Terms of the Taylor table: what is left out is below `1.6^23 / 23! < 2e-18`.
pub(crate) const ORDER: usize = 22;

/// Largest `|G| h` at which the Taylor table is used. Larger costs digits by cancellation;
/// smaller costs steps (0.8 to 1.6: a third fewer steps per period, 7 % fewer instructions).
pub(crate) const RADIUS: f64 = 1.6;

/// Largest `|G| h` from which [`LinearFlow::propagate`] doubles: time matters less there,
/// and half the Taylor radius has the smallest error.
const DOUBLING_RADIUS: f64 = 0.5 * RADIUS;

/// Halvings of the Taylor step, enough to resolve any grazing that rounding leaves visible.
const FINE_LEVELS: usize = 26;

/// How many of them are stored; only grazing and the last of a chatter need more.
const STORED_FINE_LEVELS: usize = 10;

/// Doublings of the Taylor step, by squaring; each costs about one bit.
const COARSE_LEVELS: usize = 3;

/// All there is to know about steps of one length.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// Step length.
    pub(crate) h: f64,
    /// Step length in units of the Taylor step, and its sixth power.
    pub(crate) u: f64,
    pub(crate) u6: f64,
    /// The propagator, less the identity.
    pub(crate) propagator: Columns,
    /// The gap as a polynomial.
    pub(crate) gap_polynomial: GapPolynomial,
}

impl Step {
    /// State and phasor at its end.
    #[inline(always)]
    pub(crate) fn end(&self, q: &Gap, phasor: &Phasor) -> (Gap, Phasor) {
        let moved = self.propagator.apply(q, phasor);
        ((f64x4::from(*q) + moved).to_array(), self.propagator.carry_phasor(phasor))
    }
}

/// The exact flow of one linear domain.
#[derive(Clone, Debug)]
pub struct LinearFlow {
    generator: Generator,
    /// A bound on all rates of the domain.
    pub(crate) rate: f64,
    /// The Taylor step: the unit of time of the series below.
    pub(crate) unit: f64,
    /// Its inverse.
    pub(crate) per_unit: f64,
    /// Angle of the forcing over a Taylor step.
    pub(crate) turn: f64,
    /// Steps, coarsest first, each half as long as the one before; the finest are made on demand.
    steps: Vec<Step>,
    /// Lengths there are.
    pub(crate) levels: usize,
    /// Which of them is the Taylor step.
    pub(crate) taylor_level: usize,
    /// Taylor table of the propagator: term `n` multiplies `u^(n+1)`.
    table: Vec<Columns>,
    /// The way to any instant of the longest step.
    pub(crate) grid: Grid,
    /// ShortFlight flights from a wall.
    pub(crate) short_flight: ShortFlight,
    /// Columns of the vector field `(w, w', v, v')`.
    field: Columns,
    /// Rows of `z'', z''', z''''` on `a`; of motion on a rigid wall, of the acceleration that the wall takes
    /// up, and of its first two rates.
    gap_rates: [[f64; 7]; 3],
    /// Bound on `z^(6)`, for the gap itself.
    pub(crate) gap_bound: EnergyBound,
    /// Bound on `z^(8)`, for the relative acceleration; likewise.
    pub(crate) pressing_bound: EnergyBound,
}

impl LinearFlow {
    /// Bytes beside the struct itself.
    pub(super) fn heap_bytes(&self) -> usize {
        self.steps.capacity() * size_of::<Step>()
            + (self.table.capacity() + self.grid.stored()) * size_of::<Columns>()
    }

    pub(super) fn new(oscillator: &Oscillator, domain: &Domain) -> LinearFlow {
        let generator = generator(oscillator, domain);
        let rate = rate(oscillator, domain);
        let bounds = |table: &[Columns], unit: f64| {
            let bound = |n: u32| EnergyBound::new(oscillator, domain, &table[n as usize - 1], n, unit);
            [bound(5), bound(7)]
        };
        LinearFlow::assemble(oscillator, generator, rate, generator * generator, bounds)
    }

    /// Motion at rest on a rigid wall: the gap is held, and the other displacement moves on. What is called the
    /// relative acceleration is that which the wall takes up.
    pub(super) fn on_rigid_wall(oscillator: &Oscillator, kick: f64) -> LinearFlow {
        let motion = constrained::Motion::new(oscillator, kick);
        let bounds = |table: &[Columns], unit: f64| [EnergyBound::NONE, motion.bound(&table[4], unit)];
        LinearFlow::assemble(oscillator, motion.generator, motion.rate, motion.watched, bounds)
    }

    /// All there is to know of a system `a' = G a`; the first row of `watched` is that of `z''`, or of what is
    /// watched in its place.
    fn assemble(
        oscillator: &Oscillator,
        generator: Generator,
        rate: f64,
        watched: Generator,
        bounds: impl Fn(&[Columns], f64) -> [EnergyBound; 2],
    ) -> LinearFlow {
        let unit = RADIUS / rate;
        let columns = Columns::of(&generator);
        let table = taylor_table(&columns, unit);

        // Longer steps would only be cut short by the strobe.
        let fit = (oscillator.period() / unit).log2().floor();
        let coarse = fit.clamp(0.0, COARSE_LEVELS as f64) as usize;
        let grid = Grid::new(&table, 1 << coarse);

        let mut power = watched;
        let gap_rates = std::array::from_fn(|_| {
            let rates = std::array::from_fn(|j| power[(0, j)]);
            power *= generator;
            rates
        });
        let [gap_bound, pressing_bound] = bounds(&table, unit);
        let mut linear = LinearFlow {
            field: columns,
            gap_bound,
            pressing_bound,
            generator,
            rate,
            unit,
            per_unit: 1.0 / unit,
            turn: oscillator.omega * unit,
            steps: Vec::new(),
            levels: coarse + 1 + FINE_LEVELS,
            taylor_level: coarse,
            short_flight: ShortFlight::new(&table),
            table,
            grid,
            gap_rates,
        };
        linear.steps = (0..=coarse + STORED_FINE_LEVELS).map(|level| linear.new_step(level)).collect();
        linear
    }

    /// The step of a level, where it is stored.
    #[inline(always)]
    pub(crate) fn step(&self, level: usize) -> Option<&Step> {
        self.steps.get(level)
    }

    /// Makes the step of a level below [`levels`](Self::levels).
    #[inline(never)]
    pub(crate) fn new_step(&self, level: usize) -> Step {
        let u = 0.5f64.powi(level as i32 - self.taylor_level as i32);
        let propagator = if u < FINEST_PART {
            Columns::horner(&self.table[..terms(u)], u)
        } else {
            self.grid.propagator(u)
        };
        let h = u * self.unit;
        let gap_polynomial = GapPolynomial::new(&propagator, &self.gap_rates[0], h);
        Step { h, u, u6: u.powi(6), propagator, gap_polynomial }
    }

    /// The vector field `(w, w', v, v')` at a point.
    #[inline(always)]
    pub fn field(&self, q: &Gap, phasor: &Phasor) -> Gap {
        self.field.apply(q, phasor).to_array()
    }

    /// The relative acceleration `w' = z''`; of motion on a rigid wall, what the wall takes up of it.
    #[inline]
    pub fn acceleration(&self, q: &Gap, phasor: &Phasor) -> f64 {
        dot(&self.gap_rates[0], q, phasor)
    }

    /// `z'', z''', z''''`, or what the wall takes up, and its first two rates.
    #[inline]
    pub(crate) fn acceleration_rates(&self, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        self.gap_rates.map(|row| dot(&row, q, phasor))
    }

    /// The row of the relative acceleration on `a = (z, w, x, v, cos, sin, 1)`.
    pub(crate) fn acceleration_row(&self) -> &[f64; 7] {
        &self.gap_rates[0]
    }

    /// The row of the second displacement's acceleration on `a`.
    pub(crate) fn second_acceleration_row(&self) -> [f64; 7] {
        std::array::from_fn(|j| self.generator[(3, j)])
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
        std::array::from_fn(|i| q[i] + moved[i])
    }

    /// `exp(G tau)`, less the identity: squaring that loses fewer digits than squaring the whole.
    fn departure(&self, tau: f64) -> Generator {
        let doublings = (self.rate * tau / DOUBLING_RADIUS).log2().ceil().max(0.0) as i32;
        let u = tau / self.unit * 0.5f64.powi(doublings);
        let part = Columns::horner(&self.table[..terms(u)], u).matrix();
        (0..doublings).fold(part, |less, _| less * less + less * 2.0)
    }

    /// The `n`-th derivative, a time `tau` on, of what [`acceleration`](Self::acceleration) is.
    #[cfg(test)]
    pub(super) fn pressing_derivative(&self, q: &Gap, phasor: &Phasor, tau: f64, n: u32) -> f64 {
        let a = SMatrix::<f64, 7, 1>::from([q[0], q[1], q[2], q[3], phasor[0], phasor[1], 1.0]);
        let later = a + self.departure(tau) * a;
        let derivative = (0..n).fold(later, |a, _| self.generator * a);
        SMatrix::<f64, 1, 7>::from(self.gap_rates[0]).dot(&derivative.transpose())
    }

    /// Trace of the generator on `q`: the rate at which phase volume shrinks.
    pub fn trace(&self) -> f64 {
        self.generator.fixed_view::<4, 4>(0, 0).trace()
    }
}

#[inline]
fn dot(row: &[f64; 7], q: &Gap, phasor: &Phasor) -> f64 {
    let gap = fma(row[0], q[0], fma(row[1], q[1], row[6]));
    let other = fma(row[2], q[2], row[3] * q[3]);
    gap + fma(row[4], phasor[0], fma(row[5], phasor[1], other))
}

/// Terms `(G unit)^(n+1) / (n+1)!` of the propagator.
fn taylor_table(generator: &Columns, unit: f64) -> Vec<Columns> {
    let mut table = vec![generator.scaled(unit)];
    for n in 2..=ORDER {
        table.push(table[n - 2].times(generator).scaled(unit / n as f64));
    }
    table
}

/// Terms that matter, by the size of `u`: the first one left out is below 1e-17.
pub(super) fn terms(u: f64) -> usize {
    match u {
        u if u < 0.02 => 8,
        u if u < 0.15 => 12,
        u if u < 0.5 => 17,
        _ => ORDER,
    }
}
