//! Linear functionals of `a = (z, w, x, v, cos, sin, 1)` and of the phasors of higher harmonics.

use nalgebra::Complex;

use super::few::Few;
use super::{Gap, Phasor};
use crate::fused::fma;

/// A linear functional of the state and the forcing, also called a row.
#[derive(Clone, Debug)]
pub(crate) struct PairFunctional {
    /// Factors of `(z, w, x, v, cos, sin, 1)`.
    pub(crate) base: [f64; 7],
    /// Orders of the higher harmonics, and the factors of their `cos` and `sin`.
    pub(crate) waves: Few<(u32, [f64; 2])>,
}

impl PairFunctional {
    /// Returns the value at a state and phasor.
    #[inline]
    pub(crate) fn dot(&self, q: &Gap, phasor: &Phasor) -> f64 {
        let row = &self.base;
        let gap = fma(row[0], q[0], fma(row[1], q[1], row[6]));
        let other = fma(row[2], q[2], row[3] * q[3]);
        let first = gap + fma(row[4], phasor[0], fma(row[5], phasor[1], other));
        if self.waves.is_empty() { first } else { first + self.waved(phasor[0], phasor[1]) }
    }

    #[cold]
    #[inline(never)]
    fn waved(&self, cos: f64, sin: f64) -> f64 {
        let phasor = [cos, sin];
        let term = |&(order, [cos, sin]): &(u32, [f64; 2])| {
            let [c, s] = power(&phasor, order);
            fma(cos, c, sin * s)
        };
        self.waves.iter().map(term).sum()
    }

    /// Returns the time derivative of the part that depends on the forcing; `omega` is the frequency.
    pub(crate) fn forcing_rate(&self, phasor: &Phasor, omega: f64) -> f64 {
        let first = omega * (self.base[5] * phasor[0] - self.base[4] * phasor[1]);
        let term = |&(order, [cos, sin]): &(u32, [f64; 2])| {
            let [c, s] = power(phasor, order);
            f64::from(order) * omega * (sin * c - cos * s)
        };
        self.waves.iter().map(term).fold(first, |sum, term| sum + term)
    }

    /// Returns the sum of two rows, the second one multiplied by a factor.
    pub(crate) fn plus(&self, factor: f64, other: &PairFunctional) -> PairFunctional {
        let sum = |a: [f64; 2], b: [f64; 2]| std::array::from_fn(|i| a[i] + factor * b[i]);
        let both = self.waves.iter().zip(other.waves.iter());
        PairFunctional {
            base: std::array::from_fn(|j| self.base[j] + factor * other.base[j]),
            waves: both.map(|(&(order, a), &(_, b))| (order, sum(a, b))).collect(),
        }
    }
}

/// Returns the phasor of a harmonic: the complex power of the first one.
pub(crate) fn power(phasor: &Phasor, order: u32) -> Phasor {
    let power = Complex::new(phasor[0], phasor[1]).powu(order);
    [power.re, power.im]
}
