//! One linear forced domain: generator, Taylor table, propagators.

use nalgebra::{Matrix4, SMatrix};
use wide::f64x4;

use super::columns::Columns;
use super::constrained::ConstrainedMotion;
use super::energy::EnergyBound;
use super::expansion::{FINEST_PART, Grid};
use super::gap_polynomial::GapPolynomial;
use super::generator::{Generator, generator, rate};
use super::short_flight::ShortFlight;
use super::taylor::{RADIUS, partial_sum, taylor_table};
use super::{Gap, Phasor};
use crate::fused::fma;
use crate::model::{Domain, Oscillator};

/// Largest `|G| h` that [`LinearFlow::propagate`] sums directly before doubling. Half the Taylor radius has the
/// smallest error.
const DOUBLING_RADIUS: f64 = 0.5 * RADIUS;

/// Number of halvings of the Taylor step: enough to resolve every grazing above rounding.
const FINE_LEVELS: usize = 26;

/// Number of halvings that are stored. Only grazing and the end of a chatter need finer steps.
const STORED_FINE_LEVELS: usize = 10;

/// Largest number of doublings of the Taylor step; each loses about one bit.
const COARSE_LEVELS: usize = 3;

/// Precomputed data of steps of one length.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) h: f64,
    /// Step length in Taylor steps, and its sixth power.
    pub(crate) u: f64,
    pub(crate) u6: f64,
    /// The propagator, minus the identity.
    pub(crate) propagator: Columns,
    pub(crate) gap_polynomial: GapPolynomial,
}

impl Step {
    #[inline(always)]
    pub(crate) fn end(&self, q: &Gap, phasor: &Phasor) -> (Gap, Phasor) {
        let change = self.propagator.apply(q, phasor);
        ((f64x4::from(*q) + change).to_array(), self.propagator.carry_phasor(phasor))
    }
}

/// The exact flow of one linear domain.
#[derive(Clone, Debug)]
pub struct LinearFlow {
    generator: Generator,
    /// Bound on all rates of the domain.
    pub(crate) rate: f64,
    /// The Taylor step: the unit of time of the series below.
    pub(crate) unit: f64,
    pub(crate) per_unit: f64,
    /// Angle of the forcing over a Taylor step.
    pub(crate) turn: f64,
    /// Stored steps, longest first, each half as long as the one before.
    steps: Vec<Step>,
    /// Number of step lengths. The finest steps are not stored.
    pub(crate) levels: usize,
    /// Index of the Taylor step among the step lengths.
    pub(crate) taylor_level: usize,
    /// Taylor table of the propagator: term `n` multiplies `u^(n+1)`.
    table: Vec<Columns>,
    /// Propagators to any instant of the longest step.
    pub(crate) grid: Grid,
    pub(crate) short_flight: ShortFlight,
    /// Columns of the vector field `(w, w', v, v')`.
    field: Columns,
    /// Rows of `z'', z''', z''''` on `a`. For motion on a rigid wall: rows of the acceleration that the wall cancels,
    /// and of its first two derivatives.
    gap_rates: [[f64; 7]; 3],
    /// Bound on `z^(6)`, for the gap itself; zero for motion on a rigid wall.
    pub(crate) gap_bound: EnergyBound,
    /// Bound on the sixth derivative of [`acceleration`](Self::acceleration).
    pub(crate) pressing_bound: EnergyBound,
}

impl LinearFlow {
    /// Returns the bytes on the heap.
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

    /// Builds the flow of a gap at rest on a rigid wall, while the other displacement moves. Its
    /// [`acceleration`](Self::acceleration) is the one that the wall cancels.
    pub(super) fn on_rigid_wall(oscillator: &Oscillator, kick: f64) -> LinearFlow {
        let motion = ConstrainedMotion::new(oscillator, kick);
        let bounds = |table: &[Columns], unit: f64| [EnergyBound::NONE, motion.bound(&table[4], unit)];
        LinearFlow::assemble(oscillator, motion.generator, motion.rate, motion.pressing, bounds)
    }

    /// Builds the flow of a system `a' = G a`. The first row of `pressing` is that of
    /// [`acceleration`](Self::acceleration).
    fn assemble(
        oscillator: &Oscillator,
        generator: Generator,
        rate: f64,
        pressing: Generator,
        bounds: impl Fn(&[Columns], f64) -> [EnergyBound; 2],
    ) -> LinearFlow {
        let unit = RADIUS / rate;
        let columns = Columns::of(&generator);
        let table = taylor_table(&columns, unit);

        // No step is longer than the forcing period.
        let fit = (oscillator.period() / unit).log2().floor();
        let coarse = fit.clamp(0.0, COARSE_LEVELS as f64) as usize;
        let grid = Grid::new(&table, 1 << coarse);

        let mut power = pressing;
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

    #[inline(always)]
    pub(crate) fn step(&self, level: usize) -> Option<&Step> {
        self.steps.get(level)
    }

    /// Computes the step of a level below [`levels`](Self::levels).
    #[inline(never)]
    pub(crate) fn new_step(&self, level: usize) -> Step {
        let u = 0.5f64.powi(level as i32 - self.taylor_level as i32);
        let propagator = if u < FINEST_PART { partial_sum(&self.table, u) } else { self.grid.propagator(u) };
        let h = u * self.unit;
        let gap_polynomial = GapPolynomial::new(&propagator, &self.gap_rates[0], h);
        Step { h, u, u6: u.powi(6), propagator, gap_polynomial }
    }

    /// Returns the vector field `(w, w', v, v')` at a point.
    #[inline(always)]
    pub fn field(&self, q: &Gap, phasor: &Phasor) -> Gap {
        self.field.apply(q, phasor).to_array()
    }

    /// Returns the relative acceleration `w' = z''`; for motion on a rigid wall, the one that the wall cancels.
    #[inline]
    pub fn acceleration(&self, q: &Gap, phasor: &Phasor) -> f64 {
        dot(&self.gap_rates[0], q, phasor)
    }

    /// Returns [`acceleration`](Self::acceleration) and its first two derivatives.
    #[inline]
    pub(crate) fn acceleration_rates(&self, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        self.gap_rates.map(|row| dot(&row, q, phasor))
    }

    /// Returns the row of [`acceleration`](Self::acceleration) on `a = (z, w, x, v, cos, sin, 1)`.
    pub(crate) fn acceleration_row(&self) -> &[f64; 7] {
        &self.gap_rates[0]
    }

    /// Returns the row of the second displacement's acceleration on `a`.
    pub(crate) fn second_acceleration_row(&self) -> [f64; 7] {
        std::array::from_fn(|j| self.generator[(3, j)])
    }

    /// Returns the fundamental matrix `exp(A tau)` in gap coordinates.
    pub fn fundamental(&self, tau: f64) -> Matrix4<f64> {
        Matrix4::identity() + self.propagator_minus_identity(tau).fixed_view::<4, 4>(0, 0)
    }

    /// Returns the state after any time `tau >= 0`.
    ///
    /// It scales and squares the Taylor table. The error is that of rounding in `|G| tau`.
    pub fn propagate(&self, q: Gap, phasor: Phasor, tau: f64) -> Gap {
        let a = SMatrix::<f64, 7, 1>::from([q[0], q[1], q[2], q[3], phasor[0], phasor[1], 1.0]);
        let change = self.propagator_minus_identity(tau) * a;
        std::array::from_fn(|i| q[i] + change[i])
    }

    /// Returns `exp(G tau)` minus the identity, which loses fewer digits in squaring than `exp(G tau)`.
    fn propagator_minus_identity(&self, tau: f64) -> Generator {
        let doublings = (self.rate * tau / DOUBLING_RADIUS).log2().ceil().max(0.0) as i32;
        let u = tau / self.unit * 0.5f64.powi(doublings);
        let part = partial_sum(&self.table, u).matrix();
        (0..doublings).fold(part, |less, _| less * less + less * 2.0)
    }

    /// Returns the `n`-th derivative of [`acceleration`](Self::acceleration) after a time `tau`.
    #[cfg(test)]
    pub(super) fn pressing_derivative(&self, q: &Gap, phasor: &Phasor, tau: f64, n: u32) -> f64 {
        let a = SMatrix::<f64, 7, 1>::from([q[0], q[1], q[2], q[3], phasor[0], phasor[1], 1.0]);
        let later = a + self.propagator_minus_identity(tau) * a;
        let derivative = (0..n).fold(later, |a, _| self.generator * a);
        SMatrix::<f64, 1, 7>::from(self.gap_rates[0]).dot(&derivative.transpose())
    }

    /// Returns the trace of the generator on `q`: the growth rate of phase volume.
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
