//! Two masses with a clearance between them: the linear case (eta = 0) of the impact Duffing oscillator of PWSDDE-cont
//! (Nonlinear Dynamics 2024, doi 10.1007/s11071-024-10188-8), with the other numbers of its demo.
//!
//! A symmetric orbit has impacts on both sides half a period apart. With the impact law R, the propagator E of half a
//! period and the steady state s at the impact, `E (R y - s) = -y + s`. So the state before the impact is `y = (E R +
//! 1)^-1 (E + 1) s`, which is linear in the cosine and sine of the phase of the impact. The phase follows from `g . y =
//! delta`.

use nalgebra::{Complex, Matrix2, Matrix4, Vector2, Vector4};

use crate::common::apart;
use crate::cycle::{followed, off_the_integrator};
use rattlemap_dynamics::model::{Contact, Domain, Law, Oscillator, State};
use rattlemap_dynamics::reference::EventKind;
use rattlemap_dynamics::stability::multipliers;

const MU: f64 = 0.05;
const ZETA: f64 = 0.02;
const XI: f64 = 0.127;
const PHI: f64 = 0.952;
const DELTA: f64 = 1.0;
const E: f64 = 0.9;

pub(crate) fn pair(omega: f64) -> (Oscillator, Law) {
    let (c, k) = (2.0 * XI * MU, PHI * PHI * MU);
    let domain = Domain {
        damping: [[2.0 * ZETA + c, -c], [-c, c]],
        stiffness: [[1.0 + k, -k], [-k, k]],
        load: [0.0; 2],
    };
    let oscillator = Oscillator {
        degrees: 2,
        mass: [[1.0, 0.0], [0.0, MU]],
        gap: [1.0, -1.0],
        walls: [DELTA, -DELTA],
        contacts: [Contact::Rigid; 2],
        omega,
        force: [1.0, 0.0],
        force_sin: [0.0; 2],
        free: domain,
        meshing: [domain; 2],
    };
    oscillator.validate().unwrap();
    (oscillator, Law::both(E, 0.0))
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
struct Linear {
    generator: Matrix4<f64>,
    impact: Matrix4<f64>,
    steady: [Vector4<f64>; 2],
}

fn linear(omega: f64) -> Linear {
    let (o, _) = pair(omega);
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
    let jump = Matrix2::identity() - along * g.transpose() * ((1.0 + E) / g.dot(&along));
    let mut impact = Matrix4::identity();
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        impact[(2 * i + 1, 2 * j + 1)] = jump[(i, j)];
    }
    let dynamic = (matrix(o.free.stiffness) - mass * (omega * omega)).map(Complex::from)
        + matrix(o.free.damping).map(|c| Complex::new(0.0, omega * c));
    let x = dynamic.try_inverse().unwrap() * Vector2::from(o.force).map(Complex::from);
    // x(t) = Re x cos - Im x sin, and its rate.
    let part = |re: fn(Complex<f64>) -> f64, rate: fn(Complex<f64>) -> f64| {
        Vector4::new(re(x[0]), omega * rate(x[0]), re(x[1]), omega * rate(x[1]))
    };
    Linear { generator, impact, steady: [part(|x| x.re, |x| -x.im), part(|x| -x.im, |x| -x.re)] }
}

/// Returns the symmetric orbits that approach the right wall at the impact.
pub(crate) fn symmetric(omega: f64) -> Vec<Symmetric> {
    let Linear { generator, impact, steady } = linear(omega);
    let half = std::f64::consts::PI / omega;
    let e = (generator * half).exp();
    let one = Matrix4::identity();
    let to_before = (e * impact + one).try_inverse().unwrap() * (e + one);
    let gap = Vector4::new(1.0, 0.0, -1.0, 0.0);
    let [cos, sin] = steady.map(|part| gap.dot(&(to_before * part)));
    // cos(phase - lag) = delta / size
    let (size, lag) = (cos.hypot(sin), sin.atan2(cos));
    if DELTA > size {
        return Vec::new();
    }
    let orbit = |phase: f64| {
        let s = steady[0] * phase.cos() + steady[1] * phase.sin();
        let before = to_before * s;
        // Half a period after a state follows its mirror image, so the motion is continued to phase pi or 2 pi.
        let (until, sign) = match phase < std::f64::consts::PI {
            true => (std::f64::consts::PI, -1.0),
            false => (std::f64::consts::TAU, 1.0),
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
            gap.dot(&y).abs() < DELTA
        };
        let is_free_between = (1..200).all(between);
        Symmetric { phase, before, strobe: strobe.into(), half: -(e * salt), is_free_between }
    };
    let turn = (DELTA / size).acos();
    [lag + turn, lag - turn]
        .map(|phase| orbit(phase.rem_euclid(std::f64::consts::TAU)))
        .into_iter()
        .filter(|orbit| orbit.before[1] > orbit.before[3])
        .collect()
}

#[test]
fn symmetric_orbits_agree_with_the_closed_form() {
    let mut stable = 0;
    for omega in [0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 1.8] {
        for orbit in symmetric(omega) {
            let (oscillator, law) = pair(omega);
            let found = followed(&oscillator, law, orbit.strobe, 1);
            if !orbit.is_free_between {
                continue;
            }
            assert_eq!(found.events.len(), 2);
            let monodromy = orbit.half * orbit.half;
            let off = apart(found.end, orbit.strobe);
            let at = found.events.iter().find(|event| event.side.sign() > 0.0).unwrap();
            let time = (at.t - orbit.phase / omega).abs();
            let speed = (at.before[1] - (orbit.before[1] - orbit.before[3])).abs();
            let theirs = multipliers(&monodromy).unwrap();
            let ours = multipliers(&found.monodromy).unwrap();
            let scale = theirs[0][0].hypot(theirs[0][1]).max(1.0);
            let apart =
                theirs.iter().zip(&ours).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
                    / scale;
            let integrated = off_the_integrator(&oscillator, law, orbit.strobe, 1);
            let largest = theirs[0][0].hypot(theirs[0][1]);
            println!(
                "omega = {omega}: |mu| = {largest:.3}, state {off:.1e}, instant {time:.1e}, multipliers {apart:.1e}, DOP853 {integrated:.1e}"
            );
            assert!(found.events.iter().all(|event| event.kind == EventKind::Impact));
            assert!(off < 1e-12 && time < 1e-12 && speed < 1e-12 && apart < 1e-12 && integrated < 1e-10);
            stable += usize::from(largest < 1.0);
        }
    }
    assert!(stable >= 3, "{stable} stable orbits");
}
