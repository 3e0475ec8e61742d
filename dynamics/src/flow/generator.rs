//! The linear system `a' = G a` of a domain, from its equations of motion.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::displacement_matrix;
use crate::model::{Domain, Oscillator};

/// A generator or propagator of `a = (z, w, x, v, cos, sin, 1)`.
pub(super) type Generator = SMatrix<f64, 7, 7>;

/// Returns the matrix `G` of `a' = G a`, from the equations of motion.
pub(super) fn generator(oscillator: &Oscillator, domain: &Domain) -> Generator {
    let d = displacement_matrix(oscillator);
    let d_inverse = d.try_inverse().expect("the gap row is not zero");
    let by_mass = Matrix2::from(oscillator.inverse_mass());
    let matrix =
        |m: [[f64; 2]; 2]| d * by_mass * Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]) * d_inverse;
    let (damping, stiffness) = (matrix(domain.damping), matrix(domain.stiffness));
    let along = |f: [f64; 2]| d * by_mass * Vector2::from(f);
    let (cos, sin, load) = (along(oscillator.force), along(oscillator.force_sin), along(domain.load));
    let mut g = Generator::zeros();
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
    g
}

/// Returns a bound on all rates of the domain: of the forcing, and of the mass-scaled system by its norm.
pub(super) fn rate(oscillator: &Oscillator, domain: &Domain) -> f64 {
    let norm = |m: [[f64; 2]; 2]| oscillator.mass_scaled(m).symmetric_eigenvalues().abs().max();
    let damping = norm(domain.dissipation()) + gyroscopic_rate(oscillator, domain);
    (damping + norm(domain.stiffness).sqrt()).max(oscillator.omega)
}

/// Returns the norm of the mass-scaled skew-symmetric part of damping.
fn gyroscopic_rate(oscillator: &Oscillator, domain: &Domain) -> f64 {
    let ([[_, b], [c, _]], [[first, _], [_, second]]) = (domain.damping, oscillator.mass_root());
    (0.5 * (b - c)).abs() / (first * second)
}
