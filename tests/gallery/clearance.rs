//! Masses with a clearance between two walls.
//!
//! - Two masses coupled by a spring: the linear case (eta = 0) of the impact Duffing oscillator of PWSDDE-cont (Nonlinear
//!   Dynamics 2024, doi 10.1007/s11071-024-10188-8), with the other numbers of its demo.
//! - A structure with a free mass: the impact damper (Masri and Caughey, J. Appl. Mech. 33 (1966) 586) and the energy sink.
//! - A free ball between the walls of a shaken container.
//!
//! A symmetric orbit has impacts on both sides half a period apart. With the impact law R, the propagator E of half a
//! period and the steady state s at the impact, `E (R y - s) = -y + s`. So the state before the impact is `y = (E R +
//! 1)^-1 (E + 1) s`, which is linear in the cosine and sine of the phase of the impact. The phase follows from `g . y =
//! delta`.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, Matrix2, Matrix4, Vector2, Vector4};

use crate::common::apart;
use crate::common::closed_form::{Linear, Wall, Walled};
use crate::common::linear::unforced;
use crate::gallery::cycle::{followed, multipliers, off_the_judge};
use rattlemap_dynamics::model::{Domain, Law, Pair, State, state};
use rattlemap_dynamics::motion::EventKind;

const MU: f64 = 0.05;
const ZETA: f64 = 0.02;
const XI: f64 = 0.127;
const PHI: f64 = 0.952;
const DELTA: f64 = 1.0;
const E: f64 = 0.9;

pub(crate) fn pair(omega: f64) -> (Pair, Law) {
    let (c, k) = (2.0 * XI * MU, PHI * PHI * MU);
    let domain = Domain {
        damping: [[2.0 * ZETA + c, -c], [-c, c]],
        stiffness: [[1.0 + k, -k], [-k, k]],
        load: [0.0; 2],
    };
    let oscillator = Pair {
        mass: [[1.0, 0.0], [0.0, MU]],
        gap: [1.0, -1.0],
        walls: [DELTA, -DELTA],
        omega,
        force: [1.0, 0.0],
        ..unforced(2, domain)
    };
    (oscillator, Law::both(E, 0.0))
}

/// A structure of mass `mass` with spring, damper and force, and a free mass that can move by `clearance` on it.
#[derive(Clone, Copy)]
pub(crate) struct Damper {
    pub(crate) mass: f64,
    pub(crate) damping: f64,
    pub(crate) stiffness: f64,
    pub(crate) force: f64,
    pub(crate) omega: f64,
    pub(crate) free_mass: f64,
    pub(crate) clearance: f64,
    pub(crate) e: f64,
}

/// The impact damper of the gallery.
pub(crate) const DAMPER: Damper = Damper {
    mass: 10.0,
    damping: 25.0,
    stiffness: 4e4,
    force: 100.0,
    omega: 2.0 * PI * 10.0,
    free_mass: 1.0,
    clearance: 0.05,
    e: 0.5,
};

/// The energy sink of the gallery.
pub(crate) const SINK: Damper = Damper {
    mass: 1.0,
    damping: 0.002,
    stiffness: 1.0,
    force: 0.002,
    omega: 1.0,
    free_mass: 0.02,
    clearance: 0.2,
    e: 0.8,
};

impl Damper {
    pub(crate) fn pair(&self) -> (Pair, Law) {
        let first = |value: f64| [[value, 0.0], [0.0; 2]];
        let domain =
            Domain { damping: first(self.damping), stiffness: first(self.stiffness), load: [0.0; 2] };
        let oscillator = Pair {
            mass: [[self.mass, 0.0], [0.0, self.free_mass]],
            gap: [1.0, -1.0],
            walls: [0.5 * self.clearance, -0.5 * self.clearance],
            omega: self.omega,
            force: [self.force, 0.0],
            ..unforced(2, domain)
        };
        (oscillator, Law::both(self.e, 0.0))
    }
}

/// A ball that moves by up to `d` from the middle of a container at `cos(t)`.
pub(crate) fn container(d: f64, e: f64) -> (Pair, Law) {
    let free = Linear { m: 1.0, c: 0.0, k: 0.0, force: 1.0, omega: 1.0, load: 0.0 };
    Walled { free, walls: [Some(Wall::Rigid { at: d, e }), Some(Wall::Rigid { at: -d, e })] }.oscillator()
}

/// A symmetric orbit of two impacts.
pub(crate) struct Symmetric {
    /// Phase of the impact on the right.
    phase: f64,
    /// State before that impact.
    before: Vector4<f64>,
    /// The state at phase 0.
    pub(crate) strobe: State,
    /// Monodromy matrix of half a period with the mirror image.
    pub(crate) half: Matrix4<f64>,
    /// Whether the orbit stays between the walls between its impacts.
    pub(crate) is_free_between: bool,
}

/// Matrices for `(x1, v1, x2, v2)`, and the cosine and sine parts of the steady state.
struct Motion {
    gap: Vector4<f64>,
    generator: Matrix4<f64>,
    impact: Matrix4<f64>,
    steady: [Vector4<f64>; 2],
}

fn motion(o: &Pair, e: f64) -> Motion {
    let matrix = |m: [[f64; 2]; 2]| Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]);
    let mass = matrix(o.mass);
    let inverse = mass.try_inverse().unwrap();
    let (k, c) = (-inverse * matrix(o.free.stiffness), -inverse * matrix(o.free.damping));
    let mut generator = Matrix4::zeros();
    for i in 0..2 {
        generator[(2 * i, 2 * i + 1)] = 1.0;
        for j in 0..2 {
            generator[(2 * i + 1, 2 * j)] = k[(i, j)];
            generator[(2 * i + 1, 2 * j + 1)] = c[(i, j)];
        }
    }
    let g = Vector2::from(o.gap);
    let along = inverse * g;
    let jump = Matrix2::identity() - along * g.transpose() * ((1.0 + e) / g.dot(&along));
    let mut impact = Matrix4::identity();
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        impact[(2 * i + 1, 2 * j + 1)] = jump[(i, j)];
    }
    let dynamic = (matrix(o.free.stiffness) - mass * (o.omega * o.omega)).map(Complex::from)
        + matrix(o.free.damping).map(|c| Complex::new(0.0, o.omega * c));
    let x = dynamic.try_inverse().unwrap() * Vector2::from(o.force).map(Complex::from);
    // x(t) = Re x cos - Im x sin, and its rate.
    let part = |re: fn(Complex<f64>) -> f64, rate: fn(Complex<f64>) -> f64| {
        Vector4::new(re(x[0]), o.omega * rate(x[0]), re(x[1]), o.omega * rate(x[1]))
    };
    let gap = Vector4::new(o.gap[0], 0.0, o.gap[1], 0.0);
    Motion { gap, generator, impact, steady: [part(|x| x.re, |x| -x.im), part(|x| -x.im, |x| -x.re)] }
}

/// Returns the symmetric orbits that approach the right wall at the impact.
pub(crate) fn symmetric((oscillator, law): &(Pair, Law)) -> Vec<Symmetric> {
    let Motion { gap, generator, impact, steady } = motion(oscillator, law.restitution[0]);
    let (omega, delta) = (oscillator.omega, oscillator.walls[0]);
    let half = PI / omega;
    let e = (generator * half).exp();
    let one = Matrix4::identity();
    let to_before = (e * impact + one).try_inverse().unwrap() * (e + one);
    let [cos, sin] = steady.map(|part| gap.dot(&(to_before * part)));
    // cos(phase - lag) = delta / size
    let (size, lag) = (cos.hypot(sin), sin.atan2(cos));
    if delta > size {
        return Vec::new();
    }
    let orbit = |phase: f64| {
        let s = steady[0] * phase.cos() + steady[1] * phase.sin();
        let before = to_before * s;
        // Half a period after a state follows its mirror image, so the motion is continued to phase pi or 2 pi.
        let (until, sign) = match phase < PI {
            true => (PI, -1.0),
            false => (TAU, 1.0),
        };
        let after = (generator * ((until - phase) / omega)).exp() * (impact * before - s);
        let strobe = steady[0] + after * sign;
        // Saltation matrix: S = R + (f+ - R f-) n^T / (n . f-), with the vector field f.
        let field = |y: Vector4<f64>| {
            generator * (y - s) + (steady[1] * phase.cos() - steady[0] * phase.sin()) * omega
        };
        let (minus, plus) = (field(before), field(impact * before));
        let salt = impact + (plus - impact * minus) * gap.transpose() / gap.dot(&minus);
        let between = |i: u32| {
            let tau = half * f64::from(i) / 200.0;
            let (sin, cos) = (phase + omega * tau).sin_cos();
            let y = steady[0] * cos + steady[1] * sin + (generator * tau).exp() * (impact * before - s);
            gap.dot(&y).abs() < delta
        };
        let is_free_between = (1..200).all(between);
        let mut half = -(e * salt);
        if oscillator.degrees == 1 {
            // The second coordinate does not exist.
            half.view_mut((2, 2), (2, 2)).fill(0.0);
        }
        Symmetric { phase, before, strobe: state(strobe.as_slice()), half, is_free_between }
    };
    let turn = (delta / size).acos();
    [lag + turn, lag - turn]
        .map(|phase| orbit(phase.rem_euclid(TAU)))
        .into_iter()
        .filter(|orbit| closing(oscillator, &orbit.before) > 0.0)
        .collect()
}

/// Returns the rate at which the gap closes on the right.
fn closing(oscillator: &Pair, y: &Vector4<f64>) -> f64 {
    oscillator.gap[0] * y[1] + oscillator.gap[1] * y[3]
}

/// Returns models with symmetric orbits of two impacts.
pub(crate) fn clearances() -> Vec<(String, (Pair, Law))> {
    let two_masses = [0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 1.8]
        .map(|omega| (format!("two masses, omega = {omega}"), pair(omega)));
    let dampers = [(10.0, 0.05), (10.2, 0.045), (10.5, 0.05)].map(|(hertz, clearance)| {
        let damper = Damper { omega: 2.0 * PI * hertz, clearance, ..DAMPER };
        (format!("impact damper, {hertz} Hz, {clearance} m"), damper.pair())
    });
    let sink = Damper { omega: 1.01, clearance: 0.18, ..SINK }.pair();
    let containers = [(1.7, 0.5), (1.8, 0.5), (2.0, 0.6), (4.0, 0.8)]
        .map(|(d, e)| (format!("container, d = {d}, e = {e}"), container(d, e)));
    [
        two_masses.to_vec(),
        dampers.to_vec(),
        vec![("energy sink, omega = 1.01".to_owned(), sink)],
        containers.to_vec(),
    ]
    .concat()
}

#[test]
fn symmetric_orbits_agree_with_the_closed_form() {
    let mut stable: BTreeMap<String, usize> = BTreeMap::new();
    let default = ("energy sink, as in the gallery".to_owned(), SINK.pair());
    for (what, (oscillator, law)) in clearances().into_iter().chain([default]) {
        for orbit in symmetric(&(oscillator.clone(), law)).iter().filter(|orbit| orbit.is_free_between) {
            let found = followed(&oscillator, law, orbit.strobe, 1);
            assert_eq!(found.events.len(), 2);
            let monodromy = orbit.half * orbit.half;
            let off = apart(found.end, orbit.strobe);
            let at = found.events.iter().find(|event| event.side.sign() > 0.0).unwrap();
            let time = (at.t - orbit.phase / oscillator.omega).abs();
            let speed = (at.before[1] - closing(&oscillator, &orbit.before)).abs();
            let theirs = multipliers(&monodromy).unwrap();
            let ours = multipliers(&found.monodromy).unwrap();
            let scale = theirs[0][0].hypot(theirs[0][1]).max(1.0);
            let apart =
                theirs.iter().zip(&ours).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
                    / scale;
            let integrated = off_the_judge(&oscillator, law, orbit.strobe, 1);
            let largest = theirs[0][0].hypot(theirs[0][1]);
            println!(
                "{what}: |mu| = {largest:.3}, state {off:.1e}, instant {time:.1e}, multipliers {apart:.1e}, DOP853 {integrated:.1e}"
            );
            assert!(found.events.iter().all(|event| event.kind == EventKind::Impact));
            assert!(off < 1e-12 && time < 1e-12 && speed < 1e-12 && apart < 1e-12 && integrated < 1e-10);
            let kind = what.split(',').next().unwrap_or_default();
            *stable.entry(kind.to_owned()).or_default() += usize::from(largest < 1.0);
        }
    }
    assert!(stable.len() == 4 && stable.values().all(|&count| count >= 2), "{stable:?}");
}

/// Between symmetric impacts the ball has one speed. With the law of impact, this gives the phase and the speed of impact without
/// any matrix: `(pi/2) (1 + e)/(1 - e) sin(phase) - cos(phase) = d`, and `2 sin(phase)/(1 - e)`.
#[test]
fn a_ball_between_shaken_walls_has_the_phase_and_the_speed_of_the_closed_form() {
    for (d, e) in [(1.5, 0.5), (2.0, 0.6), (4.0, 0.8), (0.5, 0.0)] {
        let lever = 0.5 * PI * (1.0 + e) / (1.0 - e);
        let (size, lag) = (lever.hypot(1.0), lever.atan2(-1.0));
        let orbits = symmetric(&container(d, e));
        assert!(!orbits.is_empty(), "d = {d}, e = {e}");
        for orbit in orbits {
            let nearest = [1.0, -1.0].map(|sign| lag + sign * (d / size).acos());
            let off = nearest
                .map(|phase| (orbit.phase - phase.rem_euclid(TAU)).abs())
                .into_iter()
                .fold(1.0, f64::min);
            let speed = 2.0 * orbit.phase.sin() / (1.0 - e) - orbit.before[1];
            println!("d = {d}, e = {e}: phase {off:.1e}, speed {speed:.1e}");
            assert!(off < 1e-12 && speed.abs() < 1e-12);
        }
    }
}
