//! A 4 x 7 matrix on `a = (z, w, x, v, cos, sin, 1)` with the phasor's rotation: the form
//! that propagators, vector fields and Taylor terms share.

use wide::f64x4;

use super::generator::Generator;
use super::{Gap, Phasor};

/// Seven columns of `(z, w, x, v)`, one wide register each, and the phasor's rotation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    columns: [f64x4; 7],
    rotation: Phasor,
}

impl Columns {
    /// The first four rows of a 7 x 7 matrix, and its rotation.
    pub(super) fn of(matrix: &Generator) -> Columns {
        Columns {
            columns: std::array::from_fn(|j| {
                f64x4::from(std::array::from_fn::<f64, 4, _>(|i| matrix[(i, j)]))
            }),
            rotation: [matrix[(4, 4)], matrix[(5, 4)]],
        }
    }

    /// The 7 x 7 matrix.
    pub(super) fn matrix(&self) -> Generator {
        let mut matrix = Generator::zeros();
        for (j, column) in self.columns.iter().enumerate() {
            for (i, &value) in column.to_array().iter().enumerate() {
                matrix[(i, j)] = value;
            }
        }
        let [cos, sin] = self.rotation;
        matrix[(4, 4)] = cos;
        matrix[(5, 5)] = cos;
        matrix[(4, 5)] = -sin;
        matrix[(5, 4)] = sin;
        matrix
    }

    /// `u (t_0 + u (t_1 + u (t_2 + ...)))`. Seven chains side by side keep both multipliers
    /// busy; splitting even and odd terms was tried and only spilled registers.
    #[inline(always)]
    pub(super) fn horner(terms: &[Columns], u: f64) -> Columns {
        let wide = f64x4::splat(u);
        let mut sum = terms[terms.len() - 1];
        for term in terms[..terms.len() - 1].iter().rev() {
            for j in 0..7 {
                sum.columns[j] = sum.columns[j].mul_add(wide, term.columns[j]);
            }
            sum.rotation = [sum.rotation[0] * u + term.rotation[0], sum.rotation[1] * u + term.rotation[1]];
        }
        Columns { columns: sum.columns.map(|c| c * wide), rotation: sum.rotation.map(|c| c * u) }
    }

    /// `sum_j column_j a_j`, in two halves to shorten the chain of additions.
    #[inline(always)]
    pub(crate) fn apply(&self, q: &Gap, phasor: &Phasor) -> Gap {
        let forced = self.forcing(phasor, self.columns[6]);
        (self.homogeneous(q) + forced).to_array()
    }

    /// The same without the constant column: for derivatives.
    #[inline(always)]
    pub(crate) fn apply_unloaded(&self, q: &Gap, phasor: &Phasor) -> Gap {
        (self.homogeneous(q) + self.forcing(phasor, f64x4::ZERO)).to_array()
    }

    /// The same for a tangent vector, which feels neither forcing nor load.
    #[inline(always)]
    pub(crate) fn apply_tangent(&self, u: &Gap) -> Gap {
        self.homogeneous(u).to_array()
    }

    #[inline(always)]
    fn homogeneous(&self, q: &Gap) -> f64x4 {
        let c = &self.columns;
        let [q0, q1, q2, q3] = q.map(f64x4::splat);
        c[0].mul_add(q0, c[1] * q1) + c[2].mul_add(q2, c[3] * q3)
    }

    #[inline(always)]
    fn forcing(&self, phasor: &Phasor, load: f64x4) -> f64x4 {
        let [cos, sin] = phasor.map(f64x4::splat);
        self.columns[4].mul_add(cos, self.columns[5].mul_add(sin, load))
    }

    /// The phasor times the rotation.
    #[inline(always)]
    pub(crate) fn rotate(&self, p: &Phasor) -> Phasor {
        let [c, s] = self.rotation;
        [c * p[0] - s * p[1], s * p[0] + c * p[1]]
    }
}

/// Sum of two vectors.
#[inline(always)]
pub(crate) fn add(a: &Gap, b: &Gap) -> Gap {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}
