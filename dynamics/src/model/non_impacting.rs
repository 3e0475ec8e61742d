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

/// Room for rounding, relative to twice the scale of length.
const ROUNDING: f64 = 1e-9;

/// The contact-free motion of an oscillator, if it has stable one.
#[derive(Clone, Debug)]
pub struct NonImpacting {
    /// The steady state at phase 0.
    steady: State,
    mass: [[f64; 2]; 2],
    stiffness: Matrix2<f64>,
    /// `sqrt(2 E)` up to which a transient keeps clear of the walls.
    reach: f64,
    exponent: f64,
    /// The degree of freedom that must be at rest for it.
    resting: Option<usize>,
}

impl NonImpacting {
    /// None if there is no contact-free steady motion, or if it does not attract.
    pub fn new(oscillator: &Oscillator) -> Option<NonImpacting> {
        if oscillator.degrees == 1 {
            return NonImpacting::of_two(&beside_copy(oscillator, 1));
        }
        NonImpacting::of_two(oscillator)
    }

    fn of_two(oscillator: &Oscillator) -> Option<NonImpacting> {
        let Oscillator { omega, walls, mass, .. } = *oscillator;
        let matrix = |m: [[f64; 2]; 2]| Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]);
        let (stiffness, damping) = (matrix(oscillator.free.stiffness), matrix(oscillator.free.damping));
        let gap = Vector2::from(oscillator.gap);
        let compliance = stiffness.cholesky()?.inverse();
        let inverse_mass = matrix(oscillator.inverse_mass());
        let exponent = exponent(&(inverse_mass * stiffness), &(inverse_mass * damping));
        let inertia = matrix(mass) * (omega * omega);
        let dynamic =
            (stiffness - inertia).map(Complex::from) + damping.map(|c| Complex::new(0.0, omega * c));
        let amplitude = dynamic.try_inverse()? * Vector2::from(oscillator.force).map(Complex::from);
        let middle = compliance * Vector2::from(oscillator.free.load);
        let swing = gap.map(Complex::from).dot(&amplitude).norm();
        let room = (walls[0] - gap.dot(&middle)).min(gap.dot(&middle) - walls[1]) - swing;
        let reach = (room - ROUNDING * 2.0 * oscillator.length_scale()) / gap.dot(&(compliance * gap)).sqrt();
        // Damping so weak that rounding decides is none.
        if !(reach > 0.0 && exponent < -ROUNDING * omega) {
            return None;
        }
        let steady = [0, 1].map(|i| [amplitude[i].re + middle[i], -omega * amplitude[i].im]);
        let steady = [steady[0][0], steady[0][1], steady[1][0], steady[1][1]];
        Some(NonImpacting { steady, mass, stiffness, reach, exponent, resting: None })
    }

    /// The same where one degree of freedom keeps at rest: nothing moves it between the walls. Whether its
    /// own motion would decay makes no difference then.
    pub fn beside_rest(oscillator: &Oscillator) -> Option<NonImpacting> {
        (0..2).find_map(|resting| {
            let Oscillator { gap, force, free, mass, .. } = *oscillator;
            let moving = 1 - resting;
            let is_coupled =
                [free.stiffness, free.damping, mass].iter().any(|m| m[0][1] != 0.0 || m[1][0] != 0.0);
            let stays = !is_coupled && force[resting] == 0.0 && free.load[resting] == 0.0;
            if !stays || gap[moving] == 0.0 {
                return None;
            }
            let quiet = NonImpacting::of_two(&beside_copy(oscillator, resting))?;
            Some(NonImpacting { resting: Some(resting), ..quiet })
        })
    }

    /// The degree of freedom that must be at rest for it, if one must.
    pub fn resting(&self) -> Option<usize> {
        self.resting
    }

    /// Whether free motion from `y` at phase 0 certainly has no event to come.
    pub fn is_certain(&self, y: State) -> bool {
        if self.resting.is_some_and(|i| [y[2 * i], y[2 * i + 1]] != [0.0; 2]) {
            return false;
        }
        let q: State = std::array::from_fn(|i| y[i] - self.steady[i]);
        let x = Vector2::new(q[0], q[2]);
        let [[m1, m], [_, m2]] = self.mass;
        let kinetic = m1 * q[1] * q[1] + m2 * q[3] * q[3] + 2.0 * m * q[1] * q[3];
        let twice_energy = kinetic + x.dot(&(self.stiffness * x));
        twice_energy < self.reach * self.reach
    }

    /// The steady state at phase 0.
    pub fn steady(&self) -> State {
        self.steady
    }

    /// Energy `2 E` of a transient, as [`NonImpacting`] measures it, up to which no event will come.
    pub fn reach(&self) -> f64 {
        self.reach * self.reach
    }

    /// Its Lyapunov exponent per unit time: the slowest decay of free motion.
    pub fn exponent(&self) -> f64 {
        self.exponent
    }
}

/// An oscillator with a copy of one degree of freedom in place of the other, which no wall sees.
fn beside_copy(oscillator: &Oscillator, resting: usize) -> Oscillator {
    let (mut copied, moving) = (*oscillator, 1 - resting);
    let share = copied.mass[resting][resting] / copied.mass[moving][moving];
    let free = &mut copied.free;
    free.stiffness[resting][resting] = share * free.stiffness[moving][moving];
    free.damping[resting][resting] = share * free.damping[moving][moving];
    copied.gap[resting] = 0.0;
    copied
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
            NonImpacting::beside_rest(&undamped.oscillator().unwrap()).is_none(),
            "the force moves gear 1"
        );
    }

    /// Gear 2 is not moved between the walls: it stays at rest, damped or not, held or not.
    #[test]
    fn an_undamped_gear_may_rest_beside_it() {
        let whole = NonImpacting::new(&pair(11.0).oscillator().unwrap()).unwrap();
        for (r2, k2) in [(0.0, 20.0), (0.6, 0.0), (0.0, 0.0)] {
            let oscillator = GearPair { r2, k2, ..pair(11.0) }.oscillator().unwrap();
            assert!(NonImpacting::new(&oscillator).is_none());
            let quiet = NonImpacting::beside_rest(&oscillator).unwrap();
            let off = std::array::from_fn::<_, 4, _>(|i| (quiet.steady()[i] - whole.steady()[i]).abs());
            assert!(quiet.resting() == Some(1) && off.iter().all(|&x| x < 1e-15), "{off:?}");
            assert!((quiet.exponent() + 0.15).abs() < 1e-12);
            assert!(quiet.is_certain(quiet.steady()));
            let [x1, v1, ..] = quiet.steady();
            assert!(!quiet.is_certain([x1, v1, 1e-12, 0.0]) && !quiet.is_certain([x1, v1, 0.0, 1e-12]));
        }
    }

    /// No trajectory that is certain ever has an event, and the bound is not idle.
    #[test]
    fn certain_motion_has_no_event() {
        let mut certain = 0;
        for step in 0..200u32 {
            let pair = pair(8.1 + 0.02 * f64::from(step));
            let oscillator = pair.oscillator().unwrap();
            let motion = NonImpacting::new(&oscillator).unwrap();
            let flow = Flow::new(&oscillator);
            let angle = f64::from(step);
            let size = 0.03 * f64::from(step % 17);
            let offset = [size * angle.cos(), 3.0 * size * angle.sin(), size * (2.0 * angle).sin(), 0.0];
            let start = std::array::from_fn(|i| motion.steady()[i] + offset[i]);
            let mut trajectory = Trajectory::new(&flow, pair.law(), start);
            let was = motion.is_certain(start);
            for _ in 0..40 {
                trajectory.advance_period(&mut ()).unwrap();
            }
            if was {
                certain += 1;
                assert_eq!(trajectory.work().events, 0, "{pair:?} from {start:?}");
                assert!(motion.is_certain(trajectory.state()), "what is certain stays so");
            }
        }
        assert!((20..190).contains(&certain), "{certain} of 200");
    }
}
