//! Bounds on derivatives of the gap, from the energy of differentiated solutions.

use nalgebra::{Matrix2, Matrix4};

use super::columns::Columns;
use super::{Gap, Phasor, displacement_matrix};
use crate::fused::fma;
use crate::model::{Domain, Pair};

/// Energies below this may have lost digits by underflow of the squares.
const LEAST_ENERGY: f64 = 1e-280;

/// A bound on `|z^(n+1)|` over a step, from the energy of `y^(n)` at the start of the step. The bound is scaled to the remainder of a two-point Hermite quintic in Bernstein form.
///
/// The quintic through value, slope and curvature at both ends of a step `h` differs from the function by
/// `u^3 (1-u)^3 h^6 f^(6) / 720`. The factor `u^3 (1-u)^3` is a twentieth of the middle Bernstein polynomial of
/// degree 6. So the remainder on the middle coefficient is `h^6 max|f^(6)| / 14400`.
#[derive(Clone, Debug)]
pub(crate) struct EnergyBound {
    columns: Columns,
    /// Growth by the force per Taylor step.
    growth: f64,
    /// Exponent of the growth by negative damping and negative stiffness per Taylor step; 0 without these.
    exponent: f64,
}

impl EnergyBound {
    /// The bound of a constant gap: zero.
    pub(super) const NONE: EnergyBound = EnergyBound { columns: Columns::ZERO, growth: 0.0, exponent: 0.0 };

    /// Builds a bound: the norm of the columns' product with `a`, plus `growth` per Taylor step, times an exponential.
    pub(super) fn of(columns: Columns, growth: f64, exponent: f64) -> EnergyBound {
        EnergyBound { columns, growth, exponent }
    }

    /// Builds the bound from the energy of `y^(n)`; `term` is `(G unit)^n / n!` and `unit` the Taylor step.
    pub(super) fn new(oscillator: &Pair, domain: &Domain, term: &Columns, n: u32, unit: f64) -> EnergyBound {
        let reach = oscillator.mobility(oscillator.gap).sqrt();
        let scale = reach * unit.powi(6) / 14400.0;
        let [cos, sin] = [oscillator.force, oscillator.force_sin].map(|f| oscillator.mobility(f));
        let drive = (cos + sin).sqrt();
        let higher = oscillator.harmonics.iter().map(|harmonic| {
            let [cos, sin] = [harmonic.cos, harmonic.sin].map(|f| oscillator.mobility(f));
            (cos + sin).sqrt() * (oscillator.omega * f64::from(harmonic.order)).powi(n as i32)
        });
        let higher: f64 = higher.sum();
        let factorial: u32 = (1..=n).product();
        // If the powers overflow, the bound is NaN and certifies no step.
        let power = scale / unit.powi(n as i32) * f64::from(factorial);
        EnergyBound {
            columns: term.weighted(&(energy_root(oscillator, domain) * power)),
            growth: scale * drive * oscillator.omega.powi(n as i32) * unit + scale * higher * unit,
            exponent: oscillator.growth_rate(domain) * unit,
        }
    }

    /// Returns the remainder divided by `u^6`, for a step of `u` Taylor steps from `(q, phasor)`.
    #[inline]
    pub(crate) fn remainder(&self, q: &Gap, phasor: &Phasor, u: f64) -> f64 {
        let sum = self.columns.apply(q, phasor).to_array();
        let energy = fma(sum[0], sum[0], sum[1] * sum[1]) + fma(sum[2], sum[2], sum[3] * sum[3]);
        let root = if energy < LEAST_ENERGY {
            2.0 * sum.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
        } else {
            energy.sqrt()
        };
        let bound = fma(self.growth, u, root);
        if self.exponent == 0.0 { bound } else { bound * (self.exponent * u).exp() }
    }
}

/// Returns a matrix `R` with `|R q|^2 = v M v + x |K| x`, the energy of [`Pair::growth_rate`].
fn energy_root(oscillator: &Pair, domain: &Domain) -> Matrix4<f64> {
    let back = displacement_matrix(oscillator).try_inverse().expect("the gap row is not zero");
    let k = oscillator.energy_stiffness(domain);
    let eigen = Matrix2::new(k[0][0], k[0][1], k[1][0], k[1][1]).symmetric_eigen();
    let root = Matrix2::from_diagonal(&eigen.eigenvalues.map(|l| l.max(0.0).sqrt()))
        * eigen.eigenvectors.transpose();
    let [[first, _], [below, second]] = oscillator.mass_root();
    let (potential, kinetic) = (root * back, Matrix2::new(first, below, 0.0, second) * back);
    let mut l = Matrix4::zeros();
    for i in 0..2 {
        for j in 0..2 {
            l[(i, 2 * j)] = potential[(i, j)];
            l[(2 + i, 2 * j + 1)] = kinetic[(i, j)];
        }
    }
    l
}

#[cfg(test)]
mod tests {
    use crate::model::{Domain, GearPair, Pair};
    use crate::pair::flow::tests::two_harmonics;
    use crate::pair::flow::{Gap, PairFlow, Phasor};

    #[test]
    fn the_sixth_derivative_of_the_gap_stays_within_its_bound() {
        let good = GearPair::paper(0.5).pair();
        let with = |damping, stiffness| {
            let free = Domain { damping, stiffness, load: [1.0, -2.0] };
            Pair { mass: [[2.0, 0.6], [0.6, 1.0]], gap: [0.4, -1.3], free, ..good.clone() }
        };
        let passive = [[30.0, 4.0], [4.0, 11.0]];
        let oscillators = [
            good.clone(),
            with([[2.0, -0.7], [-0.7, 0.9]], passive),
            // Negative damping.
            with([[-1.0, 0.3], [0.3, 0.4]], passive),
            // Gyroscopic.
            with([[0.2, 3.0], [-3.0, 0.1]], passive),
            // A saddle, and hills along both coordinates.
            with([[0.2, 0.0], [0.0, 0.1]], [[30.0, 24.0], [24.0, 11.0]]),
            with([[0.0; 2]; 2], [[-9.0, 2.0], [2.0, -3.0]]),
            with([[-0.5, 1.0], [-1.0, -0.2]], [[-9.0, 2.0], [2.0, 3.0]]),
        ];
        let harmonics = Pair { harmonics: two_harmonics(), ..oscillators[1].clone() };
        for oscillator in oscillators.into_iter().chain([harmonics]) {
            let flow = PairFlow::new(&oscillator);
            let mut largest = 0.0f64;
            for n in 0..2000u32 {
                let t = f64::from(n);
                let size = 10f64.powf(-4.0 + 6.0 * (0.618 * t).fract());
                let q: Gap = [2.0, 5.0, 2.0, 5.0].map(|x| x * size);
                let q = std::array::from_fn(|i| q[i] * (t * (0.7 + 0.31 * i as f64)).sin());
                let phasor: Phasor = [(0.9 * t).cos(), (0.9 * t).sin()];
                for u in [1.0, 0.25] {
                    let bound = flow.free.gap_bound.remainder(&q, &phasor, u) * 14400.0;
                    for part in 0..=16 {
                        let tau = u * flow.free.unit * f64::from(part) / 16.0;
                        let sixth =
                            flow.free.pressing_derivative(&q, &phasor, tau, 4) * flow.free.unit.powi(6);
                        let share = sixth.abs() / bound;
                        assert!(share <= 1.0 + 1e-12, "{share} of the bound: {oscillator:?}, {q:?}");
                        largest = largest.max(share);
                    }
                }
            }
            assert!(largest > 0.3, "the bound is not tight: largest share {largest}: {oscillator:?}");
        }
    }
}
