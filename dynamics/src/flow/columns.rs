//! The matrix type of propagators, vector fields and Taylor terms: 4 x 7, on `a = (z, w, x, v, cos, sin, 1)`, and the
//! rotation of the phasor.

use nalgebra::Matrix4;
use wide::f64x4;

use super::generator::Generator;
use super::{Gap, Phasor};

/// Seven columns of `(z, w, x, v)`, one wide register each, and the rotation of the phasor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    columns: [f64x4; 7],
    rotation: Phasor,
}

impl Columns {
    pub(super) const ZERO: Columns = Columns { columns: [f64x4::ZERO; 7], rotation: [0.0; 2] };

    /// Takes the first four rows and the rotation of a 7 x 7 matrix.
    pub(super) fn of(matrix: &Generator) -> Columns {
        Columns {
            columns: std::array::from_fn(|j| {
                f64x4::from(std::array::from_fn::<f64, 4, _>(|i| matrix[(i, j)]))
            }),
            rotation: [matrix[(4, 4)], matrix[(5, 4)]],
        }
    }

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

    pub(super) fn row(&self, i: usize) -> [f64; 7] {
        self.columns.map(|column| column.to_array()[i])
    }

    /// Multiplies a row vector by the matrix.
    pub(super) fn left(&self, row: &[f64; 7]) -> [f64; 7] {
        let along = |column: &f64x4| {
            let c = column.to_array();
            (row[0] * c[0] + row[1] * c[1]) + (row[2] * c[2] + row[3] * c[3])
        };
        let mut product: [f64; 7] = std::array::from_fn(|j| along(&self.columns[j]));
        let [c, s] = self.rotation;
        product[4] += row[4] * c + row[5] * s;
        product[5] += row[5] * c - row[4] * s;
        product
    }

    /// Returns the product of two 7 x 7 matrices whose last row is zero.
    pub(super) fn times(&self, other: &Columns) -> Columns {
        let b = &other.columns;
        let [c, s] = other.rotation;
        let inner = |j: usize| self.homogeneous(&b[j].to_array());
        Columns {
            columns: [
                inner(0),
                inner(1),
                inner(2),
                inner(3),
                inner(4) + self.forcing(&[c, s], f64x4::ZERO),
                inner(5) + self.forcing(&[-s, c], f64x4::ZERO),
                inner(6),
            ],
            rotation: self.rotate(&other.rotation),
        }
    }

    /// Returns `(1 + A) (1 + B) - 1`, the composition of two propagators that are stored minus the identity.
    pub(super) fn after(&self, first: &Columns) -> Columns {
        let product = self.times(first);
        Columns {
            columns: std::array::from_fn(|j| product.columns[j] + (self.columns[j] + first.columns[j])),
            rotation: [0, 1].map(|i| product.rotation[i] + (self.rotation[i] + first.rotation[i])),
        }
    }

    pub(super) fn scaled(&self, factor: f64) -> Columns {
        Columns {
            columns: self.columns.map(|column| column * f64x4::splat(factor)),
            rotation: self.rotation.map(|x| x * factor),
        }
    }

    /// Multiplies the matrix by `weight` from the left. The rotation is dropped.
    pub(super) fn weighted(&self, weight: &Matrix4<f64>) -> Columns {
        let mut weights = Columns::ZERO;
        for (j, column) in weights.columns.iter_mut().take(4).enumerate() {
            *column = f64x4::from(std::array::from_fn::<f64, 4, _>(|i| weight[(i, j)]));
        }
        Columns { columns: self.columns.map(|c| weights.homogeneous(&c.to_array())), rotation: [0.0; 2] }
    }

    /// Adds a constant to the load of one row.
    pub(super) fn plus_constant(mut self, row: usize, value: f64) -> Columns {
        let mut constant = self.columns[6].to_array();
        constant[row] += value;
        self.columns[6] = f64x4::from(constant);
        self
    }

    /// Returns `u (t_0 + u (t_1 + u (t_2 + ...)))`. The seven independent chains keep both multipliers busy;
    /// splitting even and odd terms was slower, because it spilled registers.
    pub(super) fn horner(terms: &[Columns], u: f64) -> Columns {
        let wide = f64x4::splat(u);
        let mut sum = terms[terms.len() - 1];
        for term in terms[..terms.len() - 1].iter().rev() {
            for j in 0..7 {
                sum.columns[j] = sum.columns[j].mul_add(wide, term.columns[j]);
            }
            sum.rotation = [sum.rotation[0] * u + term.rotation[0], sum.rotation[1] * u + term.rotation[1]];
        }
        sum.scaled(u)
    }

    /// Applies the propagator `1 + u (t_0 + u (t_1 + ...))` to tangent vectors.
    #[inline(always)]
    pub(super) fn carry<const N: usize>(terms: &[Columns], u: f64, tangents: [Gap; N]) -> [Gap; N] {
        let wide = f64x4::splat(u);
        let mut sum = [f64x4::ZERO; 4];
        for term in terms.iter().rev() {
            for (sum, column) in sum.iter_mut().zip(&term.columns) {
                *sum = sum.mul_add(wide, *column);
            }
        }
        let sum = sum.map(|column| column * wide);
        tangents.map(|t| {
            let [t0, t1, t2, t3] = t.map(f64x4::splat);
            let change = sum[0].mul_add(t0, sum[1] * t1) + sum[2].mul_add(t2, sum[3] * t3);
            (f64x4::from(t) + change).to_array()
        })
    }

    /// Returns `sum_j column_j a_j`, in two halves to shorten the chain of additions.
    #[inline(always)]
    pub(crate) fn apply(&self, q: &Gap, phasor: &Phasor) -> f64x4 {
        self.homogeneous(q) + self.forcing(phasor, self.columns[6])
    }

    /// Returns `sum_j column_j a_j` with the fewest products, for many matrices in parallel.
    #[inline(always)]
    pub(super) fn apply_lean(&self, q: &Gap, phasor: &Phasor) -> f64x4 {
        let c = &self.columns;
        let [q0, q1, q2, q3] = q.map(f64x4::splat);
        let [cos, sin] = phasor.map(f64x4::splat);
        let gap = c[2].mul_add(q2, c[1].mul_add(q1, c[0].mul_add(q0, c[6])));
        gap + c[5].mul_add(sin, c[4].mul_add(cos, c[3] * q3))
    }

    /// Applies the propagator, stored minus the identity, to a tangent vector.
    #[inline(always)]
    pub(crate) fn carry_tangent(&self, u: &Gap) -> Gap {
        (f64x4::from(*u) + self.homogeneous(u)).to_array()
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

    #[inline(always)]
    pub(crate) fn rotate(&self, p: &Phasor) -> Phasor {
        let [c, s] = self.rotation;
        [c * p[0] - s * p[1], s * p[0] + c * p[1]]
    }

    /// Applies the propagator, stored minus the identity, to a phasor.
    #[inline(always)]
    pub(crate) fn carry_phasor(&self, p: &Phasor) -> Phasor {
        let [c, s] = self.rotate(p);
        [p[0] + c, p[1] + s]
    }
}
