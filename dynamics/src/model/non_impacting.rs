//! Steady motion that never touches a wall.
//!
//! Free motion is the sum of a steady response `x_s` and a transient `q = x - x_s`, which obeys the free equations
//! without force or load. Without negative damping, the transient's energy `2 E = q' M q' + q K q` never grows, so the gap stays within
//!
//! ```text
//! |z - z_0| <= sum |g . X_n| + sqrt(2 E g K^-1 g),   z_0 = g . K^-1 load
//! ```
//!
//! for all time, where `X_n` are the complex amplitudes of the steady response to each harmonic (Cauchy-Schwarz in the inner product of K).
//! The bound holds for each gap of a machine. If that interval lies between the walls, the motion has no further event.

use nalgebra::{Complex, DMatrix, DVector, Matrix2, Matrix4, Vector2};

use super::{Drive, DryFriction, Harmonic, Oscillator, Pair, REST, Side, State, is_semidefinite, state};

/// Margin for rounding: of the distance to a wall, relative to twice the scale of length, and of the decay rate,
/// relative to the excitation frequency.
const MARGIN: f64 = 1e-9;

/// The stable contact-free motion of an oscillator.
#[derive(Clone, Debug)]
pub struct NonImpacting {
    steady: State,
    /// Coordinates that move, and their mass and stiffness matrices.
    moving: Vec<usize>,
    mass: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    /// Largest `sqrt(2 E)` of a transient that touches no wall.
    reach: f64,
    /// Eigenvalue of free motion with the largest real part.
    slowest: Complex<f64>,
    /// Coordinates that must be at rest, and the largest displacement and rate that count as rest.
    resting: Vec<usize>,
    rest: [f64; 2],
}

impl NonImpacting {
    /// Computes the contact-free steady motion. Returns none if it touches a wall or is not stable, or if the oscillator has
    /// stages.
    pub fn new(oscillator: &Pair) -> Option<NonImpacting> {
        if oscillator.degrees == 1 {
            return NonImpacting::of_two_degrees(&with_copy(oscillator, 1));
        }
        NonImpacting::of_two_degrees(oscillator)
    }

    fn of_two_degrees(oscillator: &Pair) -> Option<NonImpacting> {
        if !oscillator.schedule.is_empty() {
            return None;
        }
        // Otherwise the energy of a transient can grow, even if the transient decays in the end.
        if !is_semidefinite(oscillator.free.dissipation()) {
            return None;
        }
        let Pair { omega, walls, mass, .. } = *oscillator;
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
        let generator = || generator(&(inverse_mass * stiffness), &(inverse_mass * damping));
        let slowest = || slowest(generator().complex_eigenvalues().as_slice());
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
        let [mass, stiffness] = [matrix(mass), stiffness].map(|m| DMatrix::from_fn(2, 2, |i, j| m[(i, j)]));
        let (moving, resting, rest) = (vec![0, 1], Vec::new(), [0.0; 2]);
        Some(NonImpacting { steady: state(&steady), moving, mass, stiffness, reach, slowest, resting, rest })
    }

    /// Computes the contact-free steady motion of a machine. Returns none if it touches a wall or is not stable, or if the machine has
    /// stages, dry friction or nonlinear springs. Coordinates on which no force acts between the walls must be at rest.
    pub fn of_machine(machine: &Oscillator) -> Option<NonImpacting> {
        if !machine.schedule.is_empty()
            || machine.friction.iter().any(DryFriction::acts)
            || !machine.springs.is_empty()
        {
            return None;
        }
        let n = machine.degrees();
        let resting: Vec<usize> = (0..n).filter(|&i| is_left_alone(machine, i)).collect();
        let all = NonImpacting::of_coordinates(machine, &(0..n).collect::<Vec<_>>());
        if all.is_some() || resting.is_empty() || resting.len() == n {
            return all;
        }
        let moving: Vec<usize> = (0..n).filter(|i| !resting.contains(i)).collect();
        let motion = NonImpacting::of_coordinates(machine, &moving)?;
        let forces = &machine.stages[0];
        let rates = resting.iter().map(|&i| {
            let [m, c, k] = [&machine.mass, &forces.damping, &forces.stiffness].map(|matrix| matrix[(i, i)]);
            (Complex::from(c * c - 4.0 * m * k).sqrt() - c) / (2.0 * m)
        });
        let slowest =
            rates.fold(motion.slowest, |slowest, own| if own.re > slowest.re { own } else { slowest });
        // Coordinates count as being at rest if they move less than the margin of the distance to a wall.
        let rest = [1.0, machine.omega].map(|unit| 1e-3 * MARGIN * machine.length_scale() * unit);
        (slowest.re <= 0.0).then_some(NonImpacting { resting, rest, slowest, ..motion })
    }

    /// Computes the contact-free steady motion of some coordinates of a machine while the others stay at 0.
    fn of_coordinates(machine: &Oscillator, moving: &[usize]) -> Option<NonImpacting> {
        let (n, forces) = (moving.len(), &machine.stages[0]);
        let matrix = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| m[(moving[i], moving[j])]);
        let vector = |v: &DVector<f64>| DVector::from_fn(n, |i, _| v[moving[i]]);
        let [mass, stiffness, damping] = [&machine.mass, &forces.stiffness, &forces.damping].map(matrix);
        let dissipation = (0.5 * (&damping + damping.transpose())).symmetric_eigenvalues();
        if dissipation.min() < -MARGIN * dissipation.amax() {
            return None;
        }
        let compliance = stiffness.clone().cholesky()?.inverse();
        let response = |drive: &Drive| {
            let omega = f64::from(drive.order) * machine.omega;
            let dynamic = (&stiffness - &mass * (omega * omega)).map(Complex::from)
                + damping.map(|c| Complex::new(0.0, omega * c));
            let force = DVector::from_fn(n, |i, _| Complex::new(drive.cos[moving[i]], -drive.sin[moving[i]]));
            Some((omega, dynamic.try_inverse()? * force))
        };
        let responses = machine.drives.iter().map(response).collect::<Option<Vec<_>>>()?;
        let middle = &compliance * vector(&forces.load);
        let mut reach = f64::INFINITY;
        for gap in &machine.gaps {
            let row = vector(&gap.row);
            let (mean, complex) = (row.dot(&middle), row.map(Complex::from));
            let swing: f64 = responses.iter().map(|(_, x)| complex.dot(x).norm()).sum();
            let room = |side: Side| {
                let nearest =
                    gap.walls[side.index()].first().map_or(f64::INFINITY, |wall| side.sign() * wall.at);
                nearest - side.sign() * mean
            };
            let room =
                room(Side::Right).min(room(Side::Left)) - swing - MARGIN * 2.0 * machine.length_scale();
            // A gap between bodies at rest has no compliance. Then only its distance from the walls matters.
            let share = room / row.dot(&(&compliance * &row)).sqrt();
            reach = reach.min(if room > 0.0 { share } else { room });
        }
        let inverse = mass.clone().cholesky()?.inverse();
        let mut generator = DMatrix::zeros(2 * n, 2 * n);
        generator.view_mut((0, n), (n, n)).fill_with_identity();
        generator.view_mut((n, 0), (n, n)).copy_from(&-(&inverse * &stiffness));
        generator.view_mut((n, n), (n, n)).copy_from(&-(&inverse * &damping));
        let slowest = || slowest(generator.complex_eigenvalues().as_slice());
        let slowest = (reach > 0.0).then(slowest).filter(|slowest| slowest.re < -MARGIN * machine.omega)?;
        let mut steady = REST;
        for (i, &place) in moving.iter().enumerate() {
            steady[2 * place] = middle[i] + responses.iter().map(|(_, x)| x[i].re).sum::<f64>();
            steady[2 * place + 1] = responses.iter().map(|(omega, x)| -omega * x[i].im).sum();
        }
        let (moving, resting, rest) = (moving.to_vec(), Vec::new(), [0.0; 2]);
        Some(NonImpacting { steady, moving, mass, stiffness, reach, slowest, resting, rest })
    }

    /// Computes the contact-free steady motion of one degree of freedom while the other stays at rest, because no force acts on it between
    /// the walls. If the one at rest is undamped, the motion is neutral.
    pub fn with_one_at_rest(oscillator: &Pair) -> Option<NonImpacting> {
        (0..2).find_map(|resting| {
            let Pair { gap, free, mass, .. } = *oscillator;
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
            // Rest is not stable if perturbations of it grow.
            (slowest.re <= 0.0).then_some(NonImpacting { resting: vec![resting], slowest, ..motion })
        })
    }

    /// Returns the index of the degree of freedom that must be at rest, if one must.
    pub fn resting(&self) -> Option<usize> {
        self.resting.first().copied()
    }

    /// Whether free motion from `y` at phase 0 certainly has no further event.
    pub fn is_certain(&self, y: State) -> bool {
        let [displacement, rate] = self.rest;
        if self.resting.iter().any(|&i| y[2 * i].abs() > displacement || y[2 * i + 1].abs() > rate) {
            return false;
        }
        let n = self.moving.len();
        let off = |i: usize| y[i] - self.steady[i];
        let mut q = REST;
        for (i, &place) in self.moving.iter().enumerate() {
            (q[2 * i], q[2 * i + 1]) = (off(2 * place), off(2 * place + 1));
        }
        let mut kinetic: f64 = (0..n).map(|i| self.mass[(i, i)] * q[2 * i + 1] * q[2 * i + 1]).sum();
        for i in 0..n {
            kinetic += (0..i).map(|j| 2.0 * self.mass[(i, j)] * q[2 * j + 1] * q[2 * i + 1]).sum::<f64>();
        }
        let force = |i: usize| (0..n).map(|j| self.stiffness[(i, j)] * q[2 * j]).sum::<f64>();
        let twice_energy = kinetic + (0..n).map(|i| q[2 * i] * force(i)).sum::<f64>();
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
fn with_copy(oscillator: &Pair, resting: usize) -> Pair {
    let (mut copied, moving) = (oscillator.clone(), 1 - resting);
    let share = copied.mass[resting][resting] / copied.mass[moving][moving];
    let free = &mut copied.free;
    free.stiffness[resting][resting] = share * free.stiffness[moving][moving];
    free.damping[resting][resting] = share * free.damping[moving][moving];
    copied.gap[resting] = 0.0;
    copied
}

/// Whether no force acts on a coordinate at rest between the walls.
fn is_left_alone(machine: &Oscillator, i: usize) -> bool {
    let forces = &machine.stages[0];
    let matrices = [&machine.mass, &forces.damping, &forces.stiffness];
    let is_alone = |j: usize| i == j || matrices.iter().all(|m| m[(i, j)] == 0.0 && m[(j, i)] == 0.0);
    (0..machine.degrees()).all(is_alone)
        && forces.load[i] == 0.0
        && machine.drives.iter().all(|drive| drive.cos[i] == 0.0 && drive.sin[i] == 0.0)
}

/// Returns the generator of free motion of two coordinates, given the products of the inverse mass matrix with stiffness and damping.
fn generator(stiffness: &Matrix2<f64>, damping: &Matrix2<f64>) -> Matrix4<f64> {
    let mut generator = Matrix4::zeros();
    generator.fixed_view_mut::<2, 2>(0, 2).fill_with_identity();
    generator.fixed_view_mut::<2, 2>(2, 0).copy_from(&-stiffness);
    generator.fixed_view_mut::<2, 2>(2, 2).copy_from(&-damping);
    generator
}

/// Returns the eigenvalue with the largest real part, in the upper half plane.
fn slowest(eigenvalues: &[Complex<f64>]) -> Complex<f64> {
    let slowest =
        eigenvalues.iter().copied().max_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    slowest.expect("there is a coordinate")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Form, GearPair, sum};
    use crate::motion::Flow;
    use crate::motion::Trajectory;

    fn pair(omega: f64) -> GearPair {
        GearPair { omega, ..GearPair::paper(0.8) }
    }

    #[test]
    fn the_gear_pair_has_non_impacting_motion_above_a_frequency() {
        // The supports are not coupled, and the force acts on gear 1 alone. The decay rates r / (2 m) are 0.15 for
        // gear 1 and 0.3 for gear 2.
        let motion = NonImpacting::new(&pair(11.0).pair()).unwrap();
        assert!((motion.exponent() + 0.15).abs() < 1e-12);
        let p = Complex::from(50.0) / Complex::new(30.0 - 2.0 * 121.0, 0.6 * 11.0);
        for (ours, theirs) in motion.steady().into_iter().zip([p.re, -11.0 * p.im, 0.0, 0.0]) {
            assert!((ours - theirs).abs() < 1e-14);
        }
        let swings = |omega: f64| 50.0 / (30.0 - 2.0 * omega * omega).hypot(0.6 * omega);
        for omega in [8.0, 8.05, 8.07, 9.0] {
            let there = NonImpacting::new(&pair(omega).pair()).is_some();
            assert_eq!(there, swings(omega) < 0.5, "omega = {omega}");
        }
        let rigid = GearPair { k2: 0.0, ..pair(11.0) };
        assert!(NonImpacting::new(&rigid.pair()).is_none());
        let undamped = GearPair { r1: 0.0, ..pair(11.0) };
        assert!(NonImpacting::new(&undamped.pair()).is_none());
        assert!(NonImpacting::with_one_at_rest(&undamped.pair()).is_none(), "the force moves gear 1");
    }

    /// No force acts on gear 2 between the walls, so it stays at rest with or without damping and support.
    #[test]
    fn the_gear_at_rest_may_be_undamped() {
        let whole = NonImpacting::new(&pair(11.0).pair()).unwrap();
        for (r2, k2) in [(0.0, 20.0), (0.6, 0.0), (0.0, 0.0)] {
            let oscillator = GearPair { r2, k2, ..pair(11.0) }.pair();
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
            let oscillator = pair.pair();
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

    #[test]
    fn a_machine_has_the_contact_free_motion_of_its_oscillator() {
        for omega in [8.1, 9.0, 11.0] {
            let pair = pair(omega);
            let oscillator = pair.pair();
            let one = NonImpacting::new(&oscillator).unwrap();
            let other = NonImpacting::of_machine(&pair.oscillator().unwrap()).unwrap();
            let off = (0..4).map(|i| (one.steady[i] - other.steady[i]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-13 && (one.reach / other.reach - 1.0).abs() < 1e-12, "{omega}: {off:e}");
            assert!((one.exponent() / other.exponent() - 1.0).abs() < 1e-12);
            for size in [0.5, 0.99, 1.01] {
                let start = sum(&one.steady, &state(&[size * one.reach / one.stiffness[(0, 0)].sqrt()]), 1.0);
                assert_eq!(other.is_certain(start), size < 1.0, "{omega}, {size}");
                assert_eq!(one.is_certain(start), other.is_certain(start));
            }
        }
        assert!(NonImpacting::of_machine(&pair(7.0).oscillator().unwrap()).is_none());
    }

    /// A ball in the slot of an oscillator: nothing moves the ball until the slot hits it.
    #[test]
    fn a_body_that_nothing_moves_must_be_at_rest() {
        let mut machine = pair(11.0).oscillator().unwrap();
        let forces = &mut machine.stages[0];
        (forces.stiffness[(1, 1)], forces.damping[(1, 1)]) = (0.0, 0.0);
        let motion = NonImpacting::of_machine(&machine).unwrap();
        assert!(motion.is_neutral() && motion.resting() == Some(1));
        let [x1, v1, ..] = motion.steady();
        assert!(motion.is_certain(motion.steady()) && motion.is_certain(state(&[x1, v1, 1e-14])));
        assert!(!motion.is_certain(state(&[x1, v1, 0.0, 1e-9])));
        let flow = Flow::new(Form::Machine(machine));
        let mut trajectory = Trajectory::<0>::new(&flow, pair(11.0).law(), motion.steady());
        for _ in 0..200 {
            trajectory.advance_period(&mut ()).unwrap();
            assert!(motion.is_certain(trajectory.state()), "{:?}", trajectory.state());
        }
    }
}
