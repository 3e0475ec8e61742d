//! The matrix type of propagators, vector fields and Taylor terms: on `a = (z, w, x, v, cos, sin, 1)` and on the phasors of
//! higher harmonics, with the rotations of all phasors.

use nalgebra::Matrix4;
use wide::f64x4;

use super::few::Few;
use super::functional::{PairFunctional, power};
use super::generator::Generator;
use super::{Gap, Phasor};

/// Seven columns of `(z, w, x, v)`, one wide register each, the rotation of the phasor, and the higher harmonics.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    columns: [f64x4; 7],
    rotation: Phasor,
    waves: Few<Wave>,
}

/// The columns of a higher harmonic's `cos` and `sin`, and the rotation of its phasor.
#[derive(Clone, Copy, Debug)]
struct Wave {
    order: u32,
    columns: [f64x4; 2],
    rotation: Phasor,
}

impl Wave {
    /// Applies a function to the numbers of two waves of one order.
    fn with(
        &self,
        other: &Wave,
        wide: impl Fn(f64x4, f64x4) -> f64x4,
        real: impl Fn(f64, f64) -> f64,
    ) -> Wave {
        Wave {
            order: self.order,
            columns: [0, 1].map(|i| wide(self.columns[i], other.columns[i])),
            rotation: [0, 1].map(|i| real(self.rotation[i], other.rotation[i])),
        }
    }

    #[inline(always)]
    fn forcing(&self, [cos, sin]: Phasor) -> f64x4 {
        self.columns[0].mul_add(f64x4::splat(cos), self.columns[1] * f64x4::splat(sin))
    }
}

/// Multiplies a phasor by another.
#[inline(always)]
fn rotated([c, s]: Phasor, p: &Phasor) -> Phasor {
    [c * p[0] - s * p[1], s * p[0] + c * p[1]]
}

impl Columns {
    pub(super) const ZERO: Columns =
        Columns { columns: [f64x4::ZERO; 7], rotation: [0.0; 2], waves: Few::NONE };

    /// Returns zeros for the same harmonics.
    pub(super) fn cleared(&self) -> Columns {
        let none = |wave: &Wave| Wave { columns: [f64x4::ZERO; 2], rotation: [0.0; 2], ..*wave };
        Columns { waves: self.waves.iter().map(none).collect(), ..Columns::ZERO }
    }

    /// Takes the rows of the motion and the rotations of a generator.
    pub(super) fn of(generator: &Generator) -> Columns {
        let matrix = &generator.matrix;
        let wave = |wave: &super::generator::ForceWave| Wave {
            order: wave.order,
            columns: [0, 1].map(|i| f64x4::from([0.0, wave.gap[i], 0.0, wave.other[i]])),
            rotation: [0.0, f64::from(wave.order) * matrix[(5, 4)]],
        };
        Columns {
            columns: std::array::from_fn(|j| {
                f64x4::from(std::array::from_fn::<f64, 4, _>(|i| matrix[(i, j)]))
            }),
            rotation: [matrix[(4, 4)], matrix[(5, 4)]],
            waves: generator.waves.iter().map(wave).collect(),
        }
    }

    /// Returns the bytes on the heap.
    pub(super) fn heap_bytes(&self) -> usize {
        self.waves.heap_bytes()
    }

    pub(super) fn row(&self, i: usize) -> PairFunctional {
        let wave = |wave: &Wave| (wave.order, wave.columns.map(|column| column.to_array()[i]));
        PairFunctional {
            base: std::array::from_fn(|j| self.columns[j].to_array()[i]),
            waves: self.waves.iter().map(wave).collect(),
        }
    }

    /// Multiplies a row vector by the matrix.
    pub(super) fn left(&self, row: &PairFunctional) -> PairFunctional {
        let of_state = &row.base;
        let along = |column: &f64x4| {
            let c = column.to_array();
            (of_state[0] * c[0] + of_state[1] * c[1]) + (of_state[2] * c[2] + of_state[3] * c[3])
        };
        let mut product: [f64; 7] = std::array::from_fn(|j| along(&self.columns[j]));
        let turned = |[cos, sin]: [f64; 2], [c, s]: Phasor| [cos * c + sin * s, sin * c - cos * s];
        let first = turned([of_state[4], of_state[5]], self.rotation);
        product[4] += first[0];
        product[5] += first[1];
        let wave = |(wave, &(order, factors)): (&Wave, &(u32, [f64; 2]))| {
            let turned = turned(factors, wave.rotation);
            (order, [0, 1].map(|i| along(&wave.columns[i]) + turned[i]))
        };
        PairFunctional { base: product, waves: self.waves.iter().zip(row.waves.iter()).map(wave).collect() }
    }

    /// Returns the product of two matrices whose row of the constant is zero.
    pub(super) fn times(&self, other: &Columns) -> Columns {
        let b = &other.columns;
        let [c, s] = other.rotation;
        let inner = |j: usize| self.homogeneous(&b[j].to_array());
        let wave = |(first, second): (&Wave, &Wave)| {
            let [c, s] = second.rotation;
            let column = |i: usize, turned: Phasor| {
                self.homogeneous(&second.columns[i].to_array()) + first.forcing(turned)
            };
            Wave {
                order: first.order,
                columns: [column(0, [c, s]), column(1, [-s, c])],
                rotation: rotated(first.rotation, &second.rotation),
            }
        };
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
            waves: self.waves.iter().zip(other.waves.iter()).map(wave).collect(),
        }
    }

    /// Returns `(1 + A) (1 + B) - 1`, the composition of two propagators that are stored minus the identity.
    pub(super) fn after(&self, first: &Columns) -> Columns {
        let product = self.times(first);
        let waves = self.waves.iter().zip(first.waves.iter());
        let sums = waves.map(|(a, b)| a.with(b, |a, b| a + b, |a, b| a + b));
        Columns {
            columns: std::array::from_fn(|j| product.columns[j] + (self.columns[j] + first.columns[j])),
            rotation: [0, 1].map(|i| product.rotation[i] + (self.rotation[i] + first.rotation[i])),
            waves: product
                .waves
                .iter()
                .zip(sums)
                .map(|(a, b)| a.with(&b, |a, b| a + b, |a, b| a + b))
                .collect(),
        }
    }

    pub(super) fn scaled(&self, factor: f64) -> Columns {
        Columns {
            columns: self.columns.map(|column| column * f64x4::splat(factor)),
            rotation: self.rotation.map(|x| x * factor),
            waves: self
                .waves
                .iter()
                .map(|w| w.with(w, |a, _| a * f64x4::splat(factor), |a, _| a * factor))
                .collect(),
        }
    }

    /// Multiplies the matrix by `weight` from the left. The rotations are dropped.
    pub(super) fn weighted(&self, weight: &Matrix4<f64>) -> Columns {
        let mut weights = Columns::ZERO;
        for (j, column) in weights.columns.iter_mut().take(4).enumerate() {
            *column = f64x4::from(std::array::from_fn::<f64, 4, _>(|i| weight[(i, j)]));
        }
        let product = |c: f64x4| weights.homogeneous(&c.to_array());
        Columns {
            columns: self.columns.map(product),
            rotation: [0.0; 2],
            waves: self.waves.iter().map(|w| w.with(w, |c, _| product(c), |_, _| 0.0)).collect(),
        }
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
        let mut sum = terms[terms.len() - 1].clone();
        for term in terms[..terms.len() - 1].iter().rev() {
            for j in 0..7 {
                sum.columns[j] = sum.columns[j].mul_add(wide, term.columns[j]);
            }
            sum.rotation = [sum.rotation[0] * u + term.rotation[0], sum.rotation[1] * u + term.rotation[1]];
            for (sum, term) in sum.waves.iter_mut().zip(term.waves.iter()) {
                *sum = sum.with(term, |a, b| a.mul_add(wide, b), |a, b| a * u + b);
            }
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
        let first = self.homogeneous(q) + self.forcing(phasor, self.columns[6]);
        if self.waves.is_empty() { first } else { first + self.waved(phasor[0], phasor[1]) }
    }

    /// Returns the products with the phasors of higher harmonics. The phasor is passed by value, so that callers keep theirs in
    /// registers.
    #[cold]
    #[inline(never)]
    pub(super) fn waved(&self, cos: f64, sin: f64) -> f64x4 {
        let terms = self.waves.iter().map(|wave| wave.forcing(power(&[cos, sin], wave.order)));
        terms.fold(f64x4::ZERO, |sum, term| sum + term)
    }

    /// Whether the force has higher harmonics.
    #[inline(always)]
    pub(super) fn has_waves(&self) -> bool {
        !self.waves.is_empty()
    }

    /// Returns `sum_j column_j a_j` with the fewest products, for many matrices in parallel. Higher harmonics are left out.
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
        rotated(self.rotation, p)
    }

    /// Applies the propagator, stored minus the identity, to a phasor.
    #[inline(always)]
    pub(crate) fn carry_phasor(&self, p: &Phasor) -> Phasor {
        let [c, s] = self.rotate(p);
        [p[0] + c, p[1] + s]
    }
}
