//! The gap over a step of given length as a polynomial.

use wide::f64x4;

use super::columns::Columns;
use super::few::Few;
use super::functional::{PairFunctional, power};
use super::{Gap, Phasor};
use crate::pair::certificate::Bernstein;

/// The matrix that maps `a = (z, w, x, v, cos, sin, 1)` to the Bernstein coefficients of the gap's Hermite quintic.
/// The coefficients are linear in `a`, because values, slopes and curvatures at both ends are.
#[derive(Clone, Debug)]
pub(crate) struct GapPolynomial {
    columns: [[f64x4; 2]; 7],
}

/// A higher harmonic in the coefficients: its order, and the columns of its `cos` and `sin`.
pub(crate) type GapWave = (u32, [[f64x4; 2]; 2]);

impl GapPolynomial {
    /// Builds the matrix, and the higher harmonics, from the propagator of a step `h`, minus the identity, and the row of `z''`.
    pub(super) fn new(
        propagator: &Columns,
        curvature: &PairFunctional,
        h: f64,
    ) -> (GapPolynomial, Few<GapWave>) {
        let slope = [0.0, h, 0.0, 0.0, 0.0, 0.0, 0.0];
        let scaled = |(order, factors): &(u32, [f64; 2])| (*order, factors.map(|x| h * h * x));
        let bend = PairFunctional {
            base: curvature.base.map(|x| h * h * x),
            waves: curvature.waves.iter().map(scaled).collect(),
        };
        let [rise, rate] = [propagator.row(0), propagator.row(1)];
        let gained = propagator.left(&bend);
        let coefficients = |slope: f64, bend: f64, rise: f64, rate: f64, gained: f64| {
            Bernstein::from_zero(slope, bend, rise, slope + h * rate, bend + gained).wide()
        };
        let columns = std::array::from_fn(|j| {
            coefficients(slope[j], bend.base[j], rise.base[j], rate.base[j], gained.base[j])
        });
        let of_wave = |k: usize, i: usize| {
            let [bend, rise, rate, gained] = [&bend, &rise, &rate, &gained].map(|row| row.waves[k].1[i]);
            coefficients(0.0, bend, rise, rate, gained)
        };
        let wave = |(k, &(order, _)): (usize, &(u32, [f64; 2]))| (order, [0, 1].map(|i| of_wave(k, i)));
        (GapPolynomial { columns }, bend.waves.iter().enumerate().map(wave).collect())
    }

    /// Returns the polynomial for a start in the state `(q, phasor)`.
    #[inline(always)]
    pub(crate) fn from(&self, q: &Gap, phasor: &Phasor, waves: &Few<GapWave>) -> Bernstein {
        let c = &self.columns;
        let a = [q[0], q[1], q[2], q[3], phasor[0], phasor[1]].map(f64x4::splat);
        let half = |i: usize| {
            let state = c[0][i].mul_add(a[0], c[1][i] * a[1]) + c[2][i].mul_add(a[2], c[3][i] * a[3]);
            state + c[4][i].mul_add(a[4], c[5][i].mul_add(a[5], c[6][i]))
        };
        let mut halves = [half(0), half(1)];
        if !waves.is_empty() {
            let sum = sum(waves, phasor[0], phasor[1]);
            halves = [halves[0] + sum[0], halves[1] + sum[1]];
        }
        Bernstein::from_wide(q[0], halves)
    }
}

/// Returns the part of the higher harmonics in the coefficients.
#[cold]
#[inline(never)]
fn sum(waves: &[GapWave], cos: f64, sin: f64) -> [f64x4; 2] {
    let phasor = [cos, sin];
    waves.iter().fold([f64x4::ZERO; 2], |sum, (order, [cos, sin])| {
        let [c, s] = power(&phasor, *order).map(f64x4::splat);
        [0, 1].map(|i| sum[i] + cos[i].mul_add(c, sin[i] * s))
    })
}
