//! Motion that never touches a wall again.
//!
//! Free motion is its steady response `x_s` and a transient `q = x - x_s`, which obeys the
//! free equations without force or load. Its energy `2 E = q' M q' + q K q` never grows, so
//! the gap stays within
//!
//! ```text
//! |z - z_0| <= |g . X| + sqrt(2 E g K^-1 g),   z_0 = g . K^-1 load
//! ```
//!
//! for ever, with `X` the complex amplitude of the steady response (Cauchy-Schwarz in the
//! inner product of K). Where that lies between the walls, the motion has no event to come.

use nalgebra::{Complex, Matrix2, Matrix4, Vector2};

use super::{Oscillator, State};

/// Room for rounding, relative to the walls' distance.
const ROUNDING: f64 = 1e-9;

/// The contact-free motion of an oscillator, if it has one that attracts.
#[derive(Clone, Debug)]
pub struct Quiet {
    /// The steady state at phase 0.
    steady: State,
    masses: [f64; 2],
    stiffness: Matrix2<f64>,
    /// `sqrt(2 E)` up to which a transient keeps clear of the walls.
    reach: f64,
    exponent: f64,
}

impl Quiet {
    /// None if there is no contact-free steady motion, or if it does not attract.
    pub fn new(oscillator: &Oscillator) -> Option<Quiet> {
        let Oscillator { masses, omega, walls, .. } = *oscillator;
        let matrix = |m: [[f64; 2]; 2]| Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]);
        let (stiffness, damping) = (matrix(oscillator.free.stiffness), matrix(oscillator.free.damping));
        let gap = Vector2::from(oscillator.gap);
        let compliance = stiffness.cholesky()?.inverse();
        let inverse_mass = Matrix2::from_diagonal(&Vector2::from(masses.map(f64::recip)));
        let exponent = exponent(&(inverse_mass * stiffness), &(inverse_mass * damping));
        let inertia = Matrix2::from_diagonal(&Vector2::from(masses)) * (omega * omega);
        let dynamic =
            (stiffness - inertia).map(Complex::from) + damping.map(|c| Complex::new(0.0, omega * c));
        let amplitude = dynamic.try_inverse()? * Vector2::from(oscillator.force).map(Complex::from);
        let middle = compliance * Vector2::from(oscillator.free.load);
        let swing = gap.map(Complex::from).dot(&amplitude).norm();
        let room = (walls[0] - gap.dot(&middle)).min(gap.dot(&middle) - walls[1]) - swing;
        let reach = (room - ROUNDING * (walls[0] - walls[1])) / gap.dot(&(compliance * gap)).sqrt();
        // Damping so weak that rounding decides is none.
        if !(reach > 0.0 && exponent < -ROUNDING * omega) {
            return None;
        }
        let steady = [0, 1].map(|i| [amplitude[i].re + middle[i], -omega * amplitude[i].im]);
        let steady = [steady[0][0], steady[0][1], steady[1][0], steady[1][1]];
        Some(Quiet { steady, masses, stiffness, reach, exponent })
    }

    /// Whether free motion from `y` at phase 0 certainly has no event to come.
    pub fn is_certain(&self, y: State) -> bool {
        let q: State = std::array::from_fn(|i| y[i] - self.steady[i]);
        let x = Vector2::new(q[0], q[2]);
        let twice_energy =
            self.masses[0] * q[1] * q[1] + self.masses[1] * q[3] * q[3] + x.dot(&(self.stiffness * x));
        twice_energy < self.reach * self.reach
    }

    /// The steady state at phase 0.
    pub fn steady(&self) -> State {
        self.steady
    }

    /// Energy `2 E` of a transient, as [`Quiet`] measures it, up to which no event will come.
    pub fn reach(&self) -> f64 {
        self.reach * self.reach
    }

    /// Its Lyapunov exponent per unit time: the slowest decay of free motion.
    pub fn exponent(&self) -> f64 {
        self.exponent
    }
}

/// The largest real part of the eigenvalues of free motion.
fn exponent(stiffness: &Matrix2<f64>, damping: &Matrix2<f64>) -> f64 {
    let mut generator = Matrix4::zeros();
    generator.fixed_view_mut::<2, 2>(0, 2).fill_with_identity();
    generator.fixed_view_mut::<2, 2>(2, 0).copy_from(&-stiffness);
    generator.fixed_view_mut::<2, 2>(2, 2).copy_from(&-damping);
    generator.complex_eigenvalues().iter().map(|mu| mu.re).fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::Flow;
    use crate::model::GearPair;
    use crate::reference::Trajectory;

    fn pair(omega: f64) -> GearPair {
        GearPair { omega, ..GearPair::paper(0.8) }
    }

    #[test]
    fn the_paper_has_it_above_a_frequency() {
        // Two uncoupled supports: the force moves gear 1 alone, and gear 2 is the least damped
        // with r / (2 m) = 0.15 for gear 1 and 0.3 for gear 2.
        let quiet = Quiet::new(&pair(11.0).oscillator().unwrap()).unwrap();
        assert!((quiet.exponent() + 0.15).abs() < 1e-12);
        let p = Complex::from(50.0) / Complex::new(30.0 - 2.0 * 121.0, 0.6 * 11.0);
        for (ours, theirs) in quiet.steady().into_iter().zip([p.re, -11.0 * p.im, 0.0, 0.0]) {
            assert!((ours - theirs).abs() < 1e-14);
        }
        let swings = |omega: f64| 50.0 / (30.0 - 2.0 * omega * omega).hypot(0.6 * omega);
        for omega in [8.0, 8.05, 8.07, 9.0] {
            let there = Quiet::new(&pair(omega).oscillator().unwrap()).is_some();
            assert_eq!(there, swings(omega) < 0.5, "omega = {omega}");
        }
        let rigid = GearPair { k2: 0.0, ..pair(11.0) };
        assert!(Quiet::new(&rigid.oscillator().unwrap()).is_none());
        let undamped = GearPair { r1: 0.0, ..pair(11.0) };
        assert!(Quiet::new(&undamped.oscillator().unwrap()).is_none());
    }

    /// No trajectory that is certain ever has an event, and the bound is not idle.
    #[test]
    fn certain_motion_has_no_event() {
        let mut certain = 0;
        for step in 0..200u32 {
            let pair = pair(8.1 + 0.02 * f64::from(step));
            let oscillator = pair.oscillator().unwrap();
            let quiet = Quiet::new(&oscillator).unwrap();
            let flow = Flow::new(&oscillator);
            let angle = f64::from(step);
            let size = 0.03 * f64::from(step % 17);
            let offset = [size * angle.cos(), 3.0 * size * angle.sin(), size * (2.0 * angle).sin(), 0.0];
            let start = std::array::from_fn(|i| quiet.steady()[i] + offset[i]);
            let mut trajectory = Trajectory::new(&flow, pair.law(), start);
            let was = quiet.is_certain(start);
            for _ in 0..40 {
                trajectory.advance_period(&mut ()).unwrap();
            }
            if was {
                certain += 1;
                assert_eq!(trajectory.work().events, 0, "{pair:?} from {start:?}");
                assert!(quiet.is_certain(trajectory.state()), "what is certain stays so");
            }
        }
        assert!((20..190).contains(&certain), "{certain} of 200");
    }
}
