//! The gap over a step of given length as a polynomial.

use wide::f64x4;

use super::columns::Columns;
use super::{Gap, Phasor};
use crate::certificate::Bernstein;

/// The matrix that maps `a = (z, w, x, v, cos, sin, 1)` to the Bernstein coefficients of the gap's Hermite quintic.
/// The coefficients are linear in `a`, because values, slopes and curvatures at both ends are.
#[derive(Clone, Debug)]
pub(crate) struct GapPolynomial {
    columns: [[f64x4; 2]; 7],
}

impl GapPolynomial {
    /// Builds the matrix from the propagator of a step `h`, minus the identity, and the row of `z''`.
    pub(super) fn new(propagator: &Columns, curvature: &[f64; 7], h: f64) -> GapPolynomial {
        let slope = [0.0, h, 0.0, 0.0, 0.0, 0.0, 0.0];
        let bend = curvature.map(|x| h * h * x);
        let rise = propagator.row(0);
        let slope_end: [f64; 7] = std::array::from_fn(|j| slope[j] + h * propagator.row(1)[j]);
        let bend_gained = propagator.left(&bend);
        let bend_end: [f64; 7] = std::array::from_fn(|j| bend[j] + bend_gained[j]);
        let columns = std::array::from_fn(|j| {
            Bernstein::from_zero(slope[j], bend[j], rise[j], slope_end[j], bend_end[j]).wide()
        });
        GapPolynomial { columns }
    }

    /// Returns the polynomial for a start in the state `(q, phasor)`.
    #[inline(always)]
    pub(crate) fn from(&self, q: &Gap, phasor: &Phasor) -> Bernstein {
        let c = &self.columns;
        let a = [q[0], q[1], q[2], q[3], phasor[0], phasor[1]].map(f64x4::splat);
        let half = |i: usize| {
            let state = c[0][i].mul_add(a[0], c[1][i] * a[1]) + c[2][i].mul_add(a[2], c[3][i] * a[3]);
            state + c[4][i].mul_add(a[4], c[5][i].mul_add(a[5], c[6][i]))
        };
        Bernstein::from_wide(q[0], [half(0), half(1)])
    }
}
