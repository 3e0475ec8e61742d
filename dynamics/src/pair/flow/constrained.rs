//! Motion at rest on a rigid wall.
//!
//! The wall cancels the free acceleration `p` of the gap, which is linear in the state, by a force along the gap row:
//! `z' = w' = 0`, and the other displacement `x` obeys `v' = v'_free + kick p`. That is motion along the direction
//! `t` with `g . t = 0` and the component 1 for `x`:
//!
//! ```text
//! m x'' + c x' + k x = f_cos cos(omega t) + f_sin sin(omega t) + load
//! p = a_x x + a_v v + a_cos cos(omega t) + a_sin sin(omega t) + constant
//! m = t M t, c = t C t, k = t K t, f_cos = t . force, f_sin = t . force_sin
//! ```
//!
//! A skew-symmetric part of `C` does not enter `c`. The energy `2 E_5 = m x^(6)^2 + |k| x^(5)^2` grows as in [`crate::pair::flow`]. With `x^(7)` from the equation of motion,
//! the energy bounds the derivative that the certificate needs:
//!
//! ```text
//! |p^(6)| <= reach sqrt(2 E_5) + |a| omega^6 + |a_v f / m| omega^5
//! f        = |(f_cos, f_sin)|, a = (a_cos, a_sin)
//! reach    = |a_x - a_v c / m| / sqrt(m) + |a_v| sqrt(|k|) / m
//! ```
//!
//! In one degree of freedom `p` is the sum of the forcing and a constant.

use nalgebra::Matrix4;

use super::columns::Columns;
use super::energy::EnergyBound;
use super::functional::PairFunctional;
use super::generator::{Generator, generator};
use crate::model::{Pair, is_semidefinite};

/// The motion of an oscillator whose gap rests on a rigid wall.
pub(super) struct ConstrainedMotion {
    pub(super) generator: Generator,
    /// Bound on all rates.
    pub(super) rate: f64,
    /// The row of `p`.
    pub(super) pressing: PairFunctional,
    mass: f64,
    /// Modulus of `k`.
    stiffness: f64,
    /// Bound on the rate at which the root of the energy grows without a force.
    growth_rate: f64,
    /// Sum of `(n omega)^5 f_n` over the harmonics.
    fifth_of_force: f64,
    reach: f64,
    /// Bound on the part of `p^(6)` that the forcing contributes directly.
    forced: f64,
}

impl ConstrainedMotion {
    /// Derives the motion; `kick` is the change of `v` per unit of approach speed that the wall removes.
    pub(super) fn new(oscillator: &Pair, kick: f64) -> ConstrainedMotion {
        let free = generator(oscillator, &oscillator.free);
        let pressing = free.row(1);
        let mut generator = free.clone();
        for j in 0..7 {
            generator.matrix[(0, j)] = 0.0;
            generator.matrix[(1, j)] = 0.0;
            generator.matrix[(3, j)] += kick * free.matrix[(1, j)];
        }
        for wave in &mut generator.waves {
            wave.other = [0, 1].map(|i| wave.other[i] + kick * wave.gap[i]);
            wave.gap = [0.0; 2];
        }
        let (omega, other) = (oscillator.omega, oscillator.other());
        let mut along = [1.0; 2];
        along[1 - other] = -oscillator.gap[other] / oscillator.gap[1 - other];
        let square = |m: [[f64; 2]; 2]| {
            let row = |i: usize| along[0] * m[0][i] + along[1] * m[1][i];
            row(0) * along[0] + row(1) * along[1]
        };
        let mass = square(oscillator.mass);
        // Rounding could make them negative.
        let [damping, stiffness] = [oscillator.free.dissipation(), oscillator.free.stiffness].map(|m| {
            let value = square(m);
            if is_semidefinite(m) { value.max(0.0) } else { value }
        });
        let [a_x, a_v, a_cos, a_sin] = [2, 3, 4, 5].map(|j| free.matrix[(1, j)]);
        let force = |cos: [f64; 2], sin: [f64; 2]| {
            let [cos, sin] = [cos, sin].map(|f| along[0] * f[0] + along[1] * f[1]);
            cos.hypot(sin)
        };
        let first = force(oscillator.force, oscillator.force_sin);
        let mut fifth_of_force = omega.powi(5) * first;
        let mut forced = a_cos.hypot(a_sin) * omega.powi(6) + (a_v * first / mass).abs() * omega.powi(5);
        for (wave, harmonic) in free.waves.iter().zip(&oscillator.harmonics) {
            let rate = omega * f64::from(wave.order);
            let fifth = rate.powi(5) * force(harmonic.cos, harmonic.sin);
            fifth_of_force += fifth;
            forced += wave.gap[0].hypot(wave.gap[1]) * rate.powi(6) + (a_v / mass).abs() * fifth;
        }
        ConstrainedMotion {
            generator,
            rate: ((damping / mass).abs() + (stiffness / mass).abs().sqrt())
                .max(omega * f64::from(oscillator.highest_order())),
            pressing,
            mass,
            stiffness: stiffness.abs(),
            growth_rate: (-damping / mass).max(0.0) + (-stiffness / mass).max(0.0).sqrt(),
            fifth_of_force,
            reach: (a_x - a_v * damping / mass).abs() / mass.sqrt()
                + a_v.abs() * stiffness.abs().sqrt() / mass,
            forced,
        }
    }

    /// Returns the bound of `p^(6)`; `fifth` is `(G unit)^5 / 5!` and `unit` the Taylor step.
    pub(super) fn bound(&self, fifth: &Columns, unit: f64) -> EnergyBound {
        let scale = unit.powi(6) / 14400.0;
        // Both parts are put under one root by `a + b <= sqrt(2) sqrt(a^2 + b^2)`.
        let weight = 2f64.sqrt() * scale;
        let energy = weight * self.reach * 120.0 / unit.powi(5);
        let mut root = Matrix4::zeros();
        root[(0, 2)] = energy * self.stiffness.sqrt();
        root[(1, 3)] = energy * self.mass.sqrt();
        let columns = fifth.weighted(&root).plus_constant(2, weight * self.forced);
        let growth = scale * self.reach * self.fifth_of_force / self.mass.sqrt() * unit;
        EnergyBound::of(columns, growth, self.growth_rate * unit)
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{Contact, Domain, GearPair, Pair, Side};
    use crate::pair::flow::{Gap, PairFlow, Phasor};

    #[test]
    fn the_sixth_derivative_of_pressing_stays_within_its_bound() {
        let pair = Pair { contacts: [Contact::Rigid; 2], ..GearPair::paper(0.0).pair() };
        let free = Domain {
            damping: [[2.0, -0.7], [-0.7, 0.9]],
            stiffness: [[30.0, 4.0], [4.0, 11.0]],
            load: [1.0, -2.0],
        };
        let full = Pair { mass: [[2.0, 0.6], [0.6, 1.0]], gap: [0.4, -1.3], free, ..pair.clone() };
        let single = Pair { gap: [1.0, 0.0], force: [5.0, 0.0], ..pair.clone() };
        let sine = Pair { force: [0.0; 2], force_sin: [20.0, -40.0], ..full.clone() };
        let mut largest = 0.0f64;
        let mut harmonics = full.clone();
        harmonics.harmonics = crate::pair::flow::tests::two_harmonics();
        for oscillator in [pair, full, single, sine, harmonics] {
            let flow = PairFlow::new(&oscillator);
            let linear = &flow.meshing[Side::Right.index()];
            for n in 0..2000u32 {
                let t = f64::from(n);
                let size = 10f64.powf(-4.0 + 6.0 * (0.618 * t).fract());
                let q: Gap = [flow.wall(Side::Right), 0.0, size * t.sin(), 5.0 * size * (1.7 * t).cos()];
                let phasor: Phasor = [(0.9 * t).cos(), (0.9 * t).sin()];
                for u in [1.0, 0.25] {
                    let bound = linear.pressing_bound.remainder(&q, &phasor, u) * 14400.0;
                    for part in 0..=16 {
                        let tau = u * linear.unit * f64::from(part) / 16.0;
                        let sixth = linear.pressing_derivative(&q, &phasor, tau, 6) * linear.unit.powi(6);
                        let share = sixth.abs() / bound;
                        assert!(share <= 1.0 + 1e-12, "{share} of the bound: {oscillator:?}, {q:?}");
                        largest = largest.max(share);
                    }
                }
            }
        }
        assert!(largest > 0.3, "the bound is not tight: largest share {largest}");
    }
}
