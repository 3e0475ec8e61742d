//! One linear forced domain: generator, Taylor table, propagators.

use nalgebra::Matrix4;
use wide::f64x4;

use super::columns::Columns;
use super::constrained::ConstrainedMotion;
use super::energy::EnergyBound;
use super::expansion::{FINEST_PART, Grid};
use super::few::Few;
use super::functional::PairFunctional;
use super::gap_polynomial::{GapPolynomial, GapWave};
use super::generator::{Generator, generator, rate};
use super::short_flight::ShortFlight;
use super::taylor::{RADIUS, partial_sum, taylor_table};
use super::{Gap, Phasor};
use crate::model::{Domain, Pair};
use crate::pair::certificate::Bernstein;

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
    gap_polynomial: GapPolynomial,
    gap_waves: Few<GapWave>,
}

impl Step {
    /// Returns the gap over the step from a state.
    #[inline(always)]
    pub(crate) fn gap(&self, q: &Gap, phasor: &Phasor) -> Bernstein {
        self.gap_polynomial.from(q, phasor, &self.gap_waves)
    }

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
    gap_rates: [PairFunctional; 3],
    /// Bound on `z^(6)`, for the gap itself; zero for motion on a rigid wall.
    pub(crate) gap_bound: EnergyBound,
    /// Bound on the sixth derivative of [`acceleration`](Self::acceleration).
    pub(crate) pressing_bound: EnergyBound,
}

impl LinearFlow {
    /// Returns the bytes on the heap.
    pub(super) fn heap_bytes(&self) -> usize {
        let of_step = |step: &Step| step.propagator.heap_bytes() + step.gap_waves.heap_bytes();
        let columns = self.table.capacity() + self.grid.stored();
        self.steps.capacity() * size_of::<Step>()
            + self.steps.iter().map(of_step).sum::<usize>()
            + columns * (size_of::<Columns>() + self.field.heap_bytes())
    }

    pub(super) fn new(oscillator: &Pair, domain: &Domain) -> LinearFlow {
        let generator = generator(oscillator, domain);
        let rate = rate(oscillator, domain);
        LinearFlow::in_domain(oscillator, domain, generator, rate)
    }

    fn in_domain(oscillator: &Pair, domain: &Domain, generator: Generator, rate: f64) -> LinearFlow {
        let bounds = |table: &[Columns], unit: f64| {
            let bound = |n: u32| EnergyBound::new(oscillator, domain, &table[n as usize - 1], n, unit);
            [bound(5), bound(7)]
        };
        let pressing = generator.row(1);
        LinearFlow::assemble(oscillator, generator, rate, pressing, bounds)
    }

    /// Builds the flow of a gap at rest on a rigid wall, while the other displacement moves. Its [`acceleration`](Self::acceleration) is
    /// the acceleration that the wall cancels.
    pub(super) fn on_rigid_wall(oscillator: &Pair, kick: f64) -> LinearFlow {
        let motion = ConstrainedMotion::new(oscillator, kick);
        let bounds = |table: &[Columns], unit: f64| [EnergyBound::NONE, motion.bound(&table[4], unit)];
        let (generator, pressing) = (motion.generator.clone(), motion.pressing.clone());
        LinearFlow::assemble(oscillator, generator, motion.rate, pressing, bounds)
    }

    /// Builds the flow of a system `a' = G a`. `pressing` is the row of [`acceleration`](Self::acceleration).
    fn assemble(
        oscillator: &Pair,
        generator: Generator,
        rate: f64,
        pressing: PairFunctional,
        bounds: impl Fn(&[Columns], f64) -> [EnergyBound; 2],
    ) -> LinearFlow {
        let unit = RADIUS / rate;
        let columns = Columns::of(&generator);
        let table = taylor_table(&columns, unit);

        // No step is longer than the forcing period.
        let fit = (oscillator.period() / unit).log2().floor();
        let coarse = fit.clamp(0.0, COARSE_LEVELS as f64) as usize;
        let grid = Grid::new(&table, 1 << coarse);

        let slope = generator.derivative(&pressing);
        let curvature = generator.derivative(&slope);
        let gap_rates = [pressing, slope, curvature];
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
        let (gap_polynomial, gap_waves) = GapPolynomial::new(&propagator, &self.gap_rates[0], h);
        Step { h, u, u6: u.powi(6), propagator, gap_polynomial, gap_waves }
    }

    /// Returns the vector field `(w, w', v, v')` at a point.
    #[inline(always)]
    pub fn field(&self, q: &Gap, phasor: &Phasor) -> Gap {
        self.field.apply(q, phasor).to_array()
    }

    /// Returns the relative acceleration `w' = z''`; for motion on a rigid wall, the acceleration that the wall cancels.
    #[inline]
    pub fn acceleration(&self, q: &Gap, phasor: &Phasor) -> f64 {
        self.gap_rates[0].dot(q, phasor)
    }

    /// Returns [`acceleration`](Self::acceleration) and its first two derivatives.
    #[inline]
    pub(crate) fn acceleration_rates(&self, q: &Gap, phasor: &Phasor) -> [f64; 3] {
        self.gap_rates.each_ref().map(|row| row.dot(q, phasor))
    }

    /// Returns the row of [`acceleration`](Self::acceleration).
    pub(crate) fn acceleration_row(&self) -> &PairFunctional {
        &self.gap_rates[0]
    }

    /// Returns the row of the second displacement's acceleration.
    pub(crate) fn second_acceleration_row(&self) -> PairFunctional {
        self.generator.row(3)
    }

    /// Returns the fundamental matrix `exp(A tau)` in gap coordinates.
    pub fn fundamental(&self, tau: f64) -> Matrix4<f64> {
        let units = std::array::from_fn(|j| std::array::from_fn(|i| f64::from(u8::from(i == j))));
        let (step, count, rest) = self.whole_steps(tau);
        let carry = |columns: [Gap; 4], _| columns.map(|u| step.propagator.carry_tangent(&u));
        let columns = self.grid.carry(rest * self.per_unit, (0..count).fold(units, carry));
        Matrix4::from_fn(|i, j| columns[j][i])
    }

    /// Returns the state after a time `tau >= 0`: whole steps of the longest length and the rest.
    pub fn propagate(&self, q: Gap, phasor: Phasor, tau: f64) -> Gap {
        let (step, count, rest) = self.whole_steps(tau);
        let (q, phasor) = (0..count).fold((q, phasor), |(q, phasor), _| step.end(&q, &phasor));
        let u = rest * self.per_unit;
        let expansion = self.grid.expansion(&q, &phasor, u);
        expansion.state(u - expansion.start)
    }

    /// Returns the longest step, how often it fits into a time, and the rest.
    fn whole_steps(&self, tau: f64) -> (&Step, u64, f64) {
        let step = &self.steps[0];
        let count = (tau / step.h).floor();
        (step, count as u64, (-count).mul_add(step.h, tau).max(0.0))
    }

    /// Returns the `n`-th derivative of [`acceleration`](Self::acceleration) after a time `tau`.
    #[cfg(test)]
    pub(super) fn pressing_derivative(&self, q: &Gap, phasor: &Phasor, tau: f64, n: u32) -> f64 {
        let (sin, cos) = (phasor[1].atan2(phasor[0]) + self.generator.matrix[(5, 4)] * tau).sin_cos();
        let row = (0..n).fold(self.gap_rates[0].clone(), |row, _| self.generator.derivative(&row));
        row.dot(&self.propagate(*q, *phasor, tau), &[cos, sin])
    }

    /// Returns the trace of the generator on `q`: the growth rate of phase volume.
    pub fn trace(&self) -> f64 {
        self.generator.matrix.fixed_view::<4, 4>(0, 0).trace()
    }
}
