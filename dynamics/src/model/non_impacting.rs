//! Steady motion that never touches a wall.
//!
//! Free motion is the sum of a steady response `x_s` and a transient `q = x - x_s`, which obeys the free equations
//! without force or load. Without negative damping, the transient's energy `2 E = q' M q' + q K q` never grows, so the gap stays within
//!
//! ```text
//! |z - z_0| <= sum |g . X_n| + sqrt(2 E g K^-1 g),   z_0 = g . K^-1 load
//! ```
//!
//! for all time, with `X_n` the complex amplitudes of the steady response to each harmonic (Cauchy-Schwarz in the inner product of K). If
//! that interval lies between the walls, the motion has no further event.

use nalgebra::{Complex, Matrix2, Matrix4, Vector2};

use super::{Harmonic, Oscillator, State, is_semidefinite, state};

/// Margin for rounding: of the distance to a wall, relative to twice the scale of length, and of the decay rate,
/// relative to the excitation frequency.
const MARGIN: f64 = 1e-9;

/// The stable contact-free motion of an oscillator.
#[derive(Clone, Debug)]
pub struct NonImpacting {
    steady: State,
    mass: [[f64; 2]; 2],
    stiffness: Matrix2<f64>,
    /// Largest `sqrt(2 E)` of a transient that touches no wall.
    reach: f64,
    /// Eigenvalue of free motion with the largest real part.
    slowest: Complex<f64>,
    resting: Option<usize>,
}

impl NonImpacting {
    /// Computes the contact-free steady motion. Returns none if it touches a wall or is not stable, or if the oscillator has
    /// stages.
    pub fn new(oscillator: &Oscillator) -> Option<NonImpacting> {
        if oscillator.degrees == 1 {
            return NonImpacting::of_two_degrees(&with_copy(oscillator, 1));
        }
        NonImpacting::of_two_degrees(oscillator)
    }

    fn of_two_degrees(oscillator: &Oscillator) -> Option<NonImpacting> {
        if !oscillator.schedule.is_empty() {
            return None;
        }
        // Otherwise the energy of a transient can grow, even if the transient decays in the end.
        if !is_semidefinite(oscillator.free.dissipation()) {
            return None;
        }
        let Oscillator { omega, walls, mass, .. } = *oscillator;
        let matrix = |m: [[f64; 2]; 2]| Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]);
        let (stiffness, damping) = (matrix(oscillator.free.stiffness), matrix(oscillator.free.damping));
        let gap = Vector2::from(oscillator.gap);
        let compliance = stiffness.cholesky()?.inverse();
        let inertia = matrix(mass) * (omega * omega);
        let response = |harmonic: Harmonic| {
            let (omega, inertia) = match harmonic.order {
                1 => (omega, inertia),
                n => (omega * f64::from(n), inertia * f64::from(n * n)),
            };
            let dynamic =
                (stiffness - inertia).map(Complex::from) + damping.map(|c| Complex::new(0.0, omega * c));
            // A zero sine must not change the sign of a zero: 0 - 0 is 0.
            let force = [0, 1].map(|i| Complex::new(harmonic.cos[i], 0.0 - harmonic.sin[i]));
            Some((omega, dynamic.try_inverse()? * Vector2::from(force)))
        };
        let responses = oscillator.all_harmonics().map(response).collect::<Option<Vec<_>>>()?;
        let middle = compliance * Vector2::from(oscillator.free.load);
        let swing: f64 = responses.iter().map(|(_, x)| gap.map(Complex::from).dot(x).norm()).sum();
        let room = (walls[0] - gap.dot(&middle)).min(gap.dot(&middle) - walls[1]) - swing;
        let reach = (room - MARGIN * 2.0 * oscillator.length_scale()) / gap.dot(&(compliance * gap)).sqrt();
        let inverse_mass = matrix(oscillator.inverse_mass());
        let slowest = || slowest(&(inverse_mass * stiffness), &(inverse_mass * damping));
        // Eigenvalues take longest: they come last.
        let slowest = (reach > 0.0).then(slowest).filter(|slowest| slowest.re < -MARGIN * omega)?;
        // Added to -0, a zero keeps its sign.
        let mut steady = [-0.0; 4];
        for (omega, amplitude) in &responses {
            for i in 0..2 {
                steady[2 * i] += amplitude[i].re;
                steady[2 * i + 1] -= omega * amplitude[i].im;
            }
        }
        (0..2).for_each(|i| steady[2 * i] += middle[i]);
        Some(NonImpacting { steady: state(&steady), mass, stiffness, reach, slowest, resting: None })
    }

    /// Computes the contact-free steady motion of one degree of freedom while the other, which nothing moves between
    /// the walls, stays at rest. The one at rest may be undamped; then the motion is neutral.
    pub fn with_one_at_rest(oscillator: &Oscillator) -> Option<NonImpacting> {
        (0..2).find_map(|resting| {
            let Oscillator { gap, free, mass, .. } = *oscillator;
            let moving = 1 - resting;
            let is_coupled =
                [free.stiffness, free.damping, mass].iter().any(|m| m[0][1] != 0.0 || m[1][0] != 0.0);
            let stays = !is_coupled
                && free.load[resting] == 0.0
                && oscillator
                    .all_harmonics()
                    .all(|harmonic| [harmonic.cos, harmonic.sin].iter().all(|pushes| pushes[resting] == 0.0));
            if !stays || gap[moving] == 0.0 {
                return None;
            }
            let motion = NonImpacting::of_two_degrees(&with_copy(oscillator, resting))?;
            let [m, c, k] = [mass, free.damping, free.stiffness].map(|matrix| matrix[resting][resting]);
            let root = Complex::from(c * c - 4.0 * m * k).sqrt();
            let own = (root - c) / (2.0 * m);
            let slowest = if own.re > motion.slowest.re { own } else { motion.slowest };
            // Rest that any perturbation leaves is not stable.
            (slowest.re <= 0.0).then_some(NonImpacting { resting: Some(resting), slowest, ..motion })
        })
    }

    /// Returns the index of the degree of freedom that must be at rest, if one must.
    pub fn resting(&self) -> Option<usize> {
        self.resting
    }

    /// Whether free motion from `y` at phase 0 certainly has no further event.
    pub fn is_certain(&self, y: State) -> bool {
        if self.resting.is_some_and(|i| [y[2 * i], y[2 * i + 1]] != [0.0; 2]) {
            return false;
        }
        let q: [f64; 4] = std::array::from_fn(|i| y[i] - self.steady[i]);
        let x = Vector2::new(q[0], q[2]);
        let [[m1, m], [_, m2]] = self.mass;
        let kinetic = m1 * q[1] * q[1] + m2 * q[3] * q[3] + 2.0 * m * q[1] * q[3];
        let twice_energy = kinetic + x.dot(&(self.stiffness * x));
        twice_energy < self.reach * self.reach
    }

    /// Whether perturbations of the degree of freedom at rest neither decay nor grow.
    pub fn is_neutral(&self) -> bool {
        self.slowest.re == 0.0
    }

    /// Returns the steady state at phase 0.
    pub fn steady(&self) -> State {
        self.steady
    }

    /// Returns the energy `2 E` of a transient below which there is no further event.
    pub fn reach(&self) -> f64 {
        self.reach * self.reach
    }

    /// Returns the Lyapunov exponent per unit time: the slowest decay rate of free motion.
    pub fn exponent(&self) -> f64 {
        self.slowest.re
    }

    /// Returns the largest Floquet multiplier of a forcing period, `(re, im)`.
    pub fn multiplier(&self, period: f64) -> [f64; 2] {
        let multiplier = (self.slowest * period).exp();
        [multiplier.re, multiplier.im]
    }
}

/// Replaces the degree of freedom `resting` by a copy of the other that does not enter the gap.
fn with_copy(oscillator: &Oscillator, resting: usize) -> Oscillator {
    let (mut copied, moving) = (oscillator.clone(), 1 - resting);
    let share = copied.mass[resting][resting] / copied.mass[moving][moving];
    let free = &mut copied.free;
    free.stiffness[resting][resting] = share * free.stiffness[moving][moving];
    free.damping[resting][resting] = share * free.damping[moving][moving];
    copied.gap[resting] = 0.0;
    copied
}

/// Returns the eigenvalue of free motion with the largest real part, in the upper half plane.
fn slowest(stiffness: &Matrix2<f64>, damping: &Matrix2<f64>) -> Complex<f64> {
    let mut generator = Matrix4::zeros();
    generator.fixed_view_mut::<2, 2>(0, 2).fill_with_identity();
    generator.fixed_view_mut::<2, 2>(2, 0).copy_from(&-stiffness);
    generator.fixed_view_mut::<2, 2>(2, 2).copy_from(&-damping);
    let eigenvalues = generator.complex_eigenvalues();
    let slowest =
        eigenvalues.iter().copied().max_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    slowest.expect("there are four")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::Flow;
    use crate::model::{GearPair, sum};
    use crate::reference::Trajectory;

    fn pair(omega: f64) -> GearPair {
        GearPair { omega, ..GearPair::paper(0.8) }
    }

    #[test]
    fn the_gear_pair_has_non_impacting_motion_above_a_frequency() {
        // The supports are not coupled, and the force acts on gear 1 alone. The decay rates r / (2 m) are 0.15 for
        // gear 1 and 0.3 for gear 2.
        let motion = NonImpacting::new(&pair(11.0).oscillator().unwrap()).unwrap();
        assert!((motion.exponent() + 0.15).abs() < 1e-12);
        let p = Complex::from(50.0) / Complex::new(30.0 - 2.0 * 121.0, 0.6 * 11.0);
        for (ours, theirs) in motion.steady().into_iter().zip([p.re, -11.0 * p.im, 0.0, 0.0]) {
            assert!((ours - theirs).abs() < 1e-14);
        }
        let swings = |omega: f64| 50.0 / (30.0 - 2.0 * omega * omega).hypot(0.6 * omega);
        for omega in [8.0, 8.05, 8.07, 9.0] {
            let there = NonImpacting::new(&pair(omega).oscillator().unwrap()).is_some();
            assert_eq!(there, swings(omega) < 0.5, "omega = {omega}");
        }
        let rigid = GearPair { k2: 0.0, ..pair(11.0) };
        assert!(NonImpacting::new(&rigid.oscillator().unwrap()).is_none());
        let undamped = GearPair { r1: 0.0, ..pair(11.0) };
        assert!(NonImpacting::new(&undamped.oscillator().unwrap()).is_none());
        assert!(
            NonImpacting::with_one_at_rest(&undamped.oscillator().unwrap()).is_none(),
            "the force moves gear 1"
        );
    }

    /// No force acts on gear 2 between the walls, so it stays at rest with or without damping and support.
    #[test]
    fn the_gear_at_rest_may_be_undamped() {
        let whole = NonImpacting::new(&pair(11.0).oscillator().unwrap()).unwrap();
        for (r2, k2) in [(0.0, 20.0), (0.6, 0.0), (0.0, 0.0)] {
            let oscillator = GearPair { r2, k2, ..pair(11.0) }.oscillator().unwrap();
            assert!(NonImpacting::new(&oscillator).is_none());
            let motion = NonImpacting::with_one_at_rest(&oscillator).unwrap();
            let off = std::array::from_fn::<_, 4, _>(|i| (motion.steady()[i] - whole.steady()[i]).abs());
            assert!(motion.resting() == Some(1) && off.iter().all(|&x| x < 1e-15), "{off:?}");
            assert!(motion.is_neutral() && motion.exponent() == 0.0, "{}", motion.exponent());
            assert!(motion.is_certain(motion.steady()));
            let [x1, v1, ..] = motion.steady();
            assert!(
                !motion.is_certain(state(&[x1, v1, 1e-12]))
                    && !motion.is_certain(state(&[x1, v1, 0.0, 1e-12]))
            );
        }
    }

    #[test]
    fn motion_that_is_certain_to_be_non_impacting_has_no_event() {
        let mut certain = 0;
        for step in 0..200u32 {
            let pair = pair(8.1 + 0.02 * f64::from(step));
            let oscillator = pair.oscillator().unwrap();
            let motion = NonImpacting::new(&oscillator).unwrap();
            let flow = Flow::new(&oscillator);
            let angle = f64::from(step);
            let size = 0.03 * f64::from(step % 17);
            let offset = [size * angle.cos(), 3.0 * size * angle.sin(), size * (2.0 * angle).sin(), 0.0];
            let start = sum(&motion.steady(), &state(&offset), 1.0);
            let mut trajectory = Trajectory::new(&flow, pair.law(), start);
            let was = motion.is_certain(start);
            for _ in 0..40 {
                trajectory.advance_period(&mut ()).unwrap();
            }
            if was {
                certain += 1;
                assert_eq!(trajectory.work().events, 0, "{pair:?} from {start:?}");
                assert!(motion.is_certain(trajectory.state()), "{pair:?} from {start:?}");
            }
        }
        assert!((20..190).contains(&certain), "{certain} of 200");
    }
}
