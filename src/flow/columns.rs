//! A 4 x 7 matrix on `a = (z, w, x, v, cos, sin, 1)` with the phasor's rotation: the form
//! that propagators, vector fields and Taylor terms share.

use super::linear::Generator;
use super::{Gap, Phasor};

/// Numbers in a [`Columns`]: seven columns of four, the rotation, and padding to 32.
const SIZE: usize = 32;

/// Where the rotation `(cos, sin)` stands.
const ROTATION: usize = 28;

/// Seven columns of `(z, w, x, v)` and the rotation of the phasor, in one flat array that
/// compilers turn into wide registers.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(crate) struct Columns([f64; SIZE]);

impl Columns {
    /// The first four rows of a 7 x 7 matrix, and its rotation.
    pub(super) fn of(matrix: &Generator) -> Columns {
        let mut flat = [0.0; SIZE];
        for j in 0..7 {
            for i in 0..4 {
                flat[4 * j + i] = matrix[(i, j)];
            }
        }
        flat[ROTATION] = matrix[(4, 4)];
        flat[ROTATION + 1] = matrix[(5, 4)];
        Columns(flat)
    }

    /// The 7 x 7 matrix.
    pub(super) fn matrix(&self) -> Generator {
        let mut matrix = Generator::zeros();
        for j in 0..7 {
            for i in 0..4 {
                matrix[(i, j)] = self.0[4 * j + i];
            }
        }
        let [cos, sin] = [self.0[ROTATION], self.0[ROTATION + 1]];
        matrix[(4, 4)] = cos;
        matrix[(5, 5)] = cos;
        matrix[(4, 5)] = -sin;
        matrix[(5, 4)] = sin;
        matrix
    }

    /// `u (t_0 + u (t_1 + u (t_2 + ...)))`.
    #[inline(always)]
    pub(super) fn horner(terms: &[Columns], u: f64) -> Columns {
        let mut sum = [0.0; SIZE];
        for Columns(term) in terms.iter().rev() {
            for (sum, c) in sum.iter_mut().zip(term) {
                *sum = *sum * u + c;
            }
        }
        Columns(sum.map(|value| value * u))
    }

    /// `sum_j column_j a_j`, in pairs to shorten the chain of additions.
    #[inline(always)]
    pub(crate) fn apply(&self, q: &Gap, phasor: &Phasor) -> Gap {
        let c = &self.0;
        let mut sum = [0.0; 4];
        for i in 0..4 {
            sum[i] = ((c[i] * q[0] + c[4 + i] * q[1]) + (c[8 + i] * q[2] + c[12 + i] * q[3]))
                + ((c[16 + i] * phasor[0] + c[20 + i] * phasor[1]) + c[24 + i]);
        }
        sum
    }

    /// The same without the constant column: for derivatives.
    #[inline(always)]
    pub(crate) fn apply_unloaded(&self, q: &Gap, phasor: &Phasor) -> Gap {
        let c = &self.0;
        let mut sum = [0.0; 4];
        for i in 0..4 {
            sum[i] = ((c[i] * q[0] + c[4 + i] * q[1]) + (c[8 + i] * q[2] + c[12 + i] * q[3]))
                + (c[16 + i] * phasor[0] + c[20 + i] * phasor[1]);
        }
        sum
    }

    /// The same for a tangent vector, which feels neither forcing nor load.
    #[inline(always)]
    pub(crate) fn apply_tangent(&self, u: &Gap) -> Gap {
        let c = &self.0;
        let mut sum = [0.0; 4];
        for i in 0..4 {
            sum[i] = (c[i] * u[0] + c[4 + i] * u[1]) + (c[8 + i] * u[2] + c[12 + i] * u[3]);
        }
        sum
    }

    /// The phasor times the rotation.
    #[inline(always)]
    pub(crate) fn rotate(&self, p: &Phasor) -> Phasor {
        let (c, s) = (self.0[ROTATION], self.0[ROTATION + 1]);
        [c * p[0] - s * p[1], s * p[0] + c * p[1]]
    }
}

/// Sum of two vectors.
#[inline(always)]
pub(crate) fn add(a: &Gap, b: &Gap) -> Gap {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}
