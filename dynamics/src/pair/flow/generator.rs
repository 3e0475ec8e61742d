//! The linear system `a' = G a` of a domain, from its equations of motion.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::displacement_matrix;
use super::functional::PairFunctional;
use crate::model::{Domain, Harmonic, Pair};

/// A generator of `a = (z, w, x, v, cos, sin, 1)` and of the phasors of higher harmonics.
#[derive(Clone, Debug)]
pub(super) struct Generator {
    pub(super) matrix: SMatrix<f64, 7, 7>,
    /// Factors of the higher harmonics in the accelerations of the gap and of the other displacement.
    pub(super) waves: Vec<ForceWave>,
}

/// A harmonic of the force: its order, and the factors of `cos` and `sin` in the accelerations of the gap and of the other
/// displacement.
#[derive(Clone, Copy, Debug)]
pub(super) struct ForceWave {
    pub(super) order: u32,
    pub(super) gap: [f64; 2],
    pub(super) other: [f64; 2],
}

impl Generator {
    /// Returns a row of the matrix.
    pub(super) fn row(&self, i: usize) -> PairFunctional {
        let factors = |wave: &ForceWave| match i {
            1 => wave.gap,
            3 => wave.other,
            _ => [0.0; 2],
        };
        PairFunctional {
            base: std::array::from_fn(|j| self.matrix[(i, j)]),
            waves: self.waves.iter().map(|wave| (wave.order, factors(wave))).collect(),
        }
    }

    /// Multiplies a row by the matrix, from the left: the derivative of the row's product with `a`.
    pub(super) fn derivative(&self, row: &PairFunctional) -> PairFunctional {
        let omega = self.matrix[(5, 4)];
        let base = SMatrix::<f64, 1, 7>::from(row.base) * self.matrix;
        let wave = |(&(order, [cos, sin]), wave): (&(u32, [f64; 2]), &ForceWave)| {
            let rate = f64::from(order) * omega;
            let forced = |part: usize| row.base[1] * wave.gap[part] + row.base[3] * wave.other[part];
            (order, [forced(0) + rate * sin, forced(1) - rate * cos])
        };
        PairFunctional {
            base: std::array::from_fn(|j| base[j]),
            waves: row.waves.iter().zip(self.waves.iter()).map(wave).collect(),
        }
    }
}

/// Returns the matrix `G` of `a' = G a`, from the equations of motion.
pub(super) fn generator(oscillator: &Pair, domain: &Domain) -> Generator {
    let d = displacement_matrix(oscillator);
    let d_inverse = d.try_inverse().expect("the gap row is not zero");
    let by_mass = Matrix2::from(oscillator.inverse_mass());
    let matrix =
        |m: [[f64; 2]; 2]| d * by_mass * Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]) * d_inverse;
    let (damping, stiffness) = (matrix(domain.damping), matrix(domain.stiffness));
    let along = |f: [f64; 2]| d * by_mass * Vector2::from(f);
    let (cos, sin, load) = (along(oscillator.force), along(oscillator.force_sin), along(domain.load));
    let mut g = SMatrix::zeros();
    for i in 0..2 {
        g[(2 * i, 2 * i + 1)] = 1.0;
        for j in 0..2 {
            g[(2 * i + 1, 2 * j)] = -stiffness[(i, j)];
            g[(2 * i + 1, 2 * j + 1)] = -damping[(i, j)];
        }
        g[(2 * i + 1, 4)] = cos[i];
        // A missing sine is +0, whatever the signs of the factors.
        g[(2 * i + 1, 5)] = sin[i] + 0.0;
        g[(2 * i + 1, 6)] = load[i];
    }
    g[(4, 5)] = -oscillator.omega;
    g[(5, 4)] = oscillator.omega;
    let wave = |harmonic: &Harmonic| {
        let (cos, sin) = (along(harmonic.cos), along(harmonic.sin));
        ForceWave { order: harmonic.order, gap: [cos[0], sin[0]], other: [cos[1], sin[1]] }
    };
    Generator { matrix: g, waves: oscillator.harmonics.iter().map(wave).collect() }
}

/// Returns a bound on the rates of the forcing and of the domain. Norms of the mass-scaled matrices bound the rates of the domain.
pub(super) fn rate(oscillator: &Pair, domain: &Domain) -> f64 {
    let norm = |m: [[f64; 2]; 2]| oscillator.mass_scaled(m).symmetric_eigenvalues().abs().max();
    let damping = norm(domain.dissipation()) + gyroscopic_rate(oscillator, domain);
    (damping + norm(domain.stiffness).sqrt()).max(oscillator.omega * f64::from(oscillator.highest_order()))
}

/// Returns the norm of the mass-scaled skew-symmetric part of damping.
fn gyroscopic_rate(oscillator: &Pair, domain: &Domain) -> f64 {
    let ([[_, b], [c, _]], [[first, _], [_, second]]) = (domain.damping, oscillator.mass_root());
    (0.5 * (b - c)).abs() / (first * second)
}
