//! The exact flow against closed forms and against the matrix exponential of nalgebra.

use crate::common::pairs::OfPair;
use crate::common::{REST, departure, flow_of, max_or_nan, paper};
use nalgebra::{SMatrix, SVector};
use rattlemap_dynamics::model::{GearPair, Side, State, state};
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::pair::DomainKind;

/// Rounding error of a matrix exponential per radian of the fastest rate. Every doubling of the time doubles the error and adds the error
/// of a product.
const PER_RADIAN: f64 = 32.0 * f64::EPSILON;

const DOMAINS: [DomainKind; 3] =
    [DomainKind::Free, DomainKind::Meshing(Side::Right), DomainKind::Meshing(Side::Left)];

/// `m x'' + r x' + k x = F cos(omega t + phase)`.
#[derive(Clone, Copy, Debug)]
struct Support {
    m: f64,
    r: f64,
    k: f64,
    force: f64,
    omega: f64,
    phase: f64,
}

impl Support {
    /// Returns `(x, v)` of a particular solution: the steady state, or linear growth at undamped resonance.
    fn particular(&self, t: f64) -> [f64; 2] {
        let Support { m, r, k, force, omega, phase } = *self;
        let (sin, cos) = (omega * t + phase).sin_cos();
        let (real, imaginary) = (k - m * omega * omega, r * omega);
        if real == 0.0 && imaginary == 0.0 {
            let growth = force / (2.0 * m * omega);
            return [growth * t * sin, growth * (sin + omega * t * cos)];
        }
        let scale = force / (real * real + imaginary * imaginary);
        let (in_phase, behind) = (scale * real, scale * imaginary);
        [in_phase * cos + behind * sin, omega * (behind * cos - in_phase * sin)]
    }

    /// Returns `(x, v)` of the free motion that starts at `(x, v)`.
    fn free(&self, [x, v]: [f64; 2], t: f64) -> [f64; 2] {
        let g = self.r / (2.0 * self.m);
        let square = self.k / self.m - g * g;
        if square > 0.0 {
            let w = square.sqrt();
            let (sin, cos) = (w * t).sin_cos();
            let decay = (-g * t).exp();
            return [
                decay * (x * cos + (v + g * x) * sin / w),
                decay * (v * cos - (g * v + self.k / self.m * x) * sin / w),
            ];
        }
        if square == 0.0 {
            let (decay, slope) = ((-g * t).exp(), v + g * x);
            return [decay * (x + slope * t), decay * (v - g * slope * t)];
        }
        let w = (-square).sqrt();
        if w * t < 1.0 {
            let (sinh, cosh, decay) = ((w * t).sinh(), (w * t).cosh(), (-g * t).exp());
            return [
                decay * (x * cosh + (v + g * x) * sinh / w),
                decay * (v * cosh - (g * v + self.k / self.m * x) * sinh / w),
            ];
        }
        // Two real rates; the slow one by Vieta's formula, which loses no digits.
        let fast = -g - w;
        let slow = self.k / self.m / fast;
        let (b, a) = ((v - slow * x) / (fast - slow), (v - fast * x) / (slow - fast));
        let (ea, eb) = (a * (slow * t).exp(), b * (fast * t).exp());
        [ea + eb, slow * ea + fast * eb]
    }

    fn solve(&self, [x, v]: [f64; 2], t: f64) -> [f64; 2] {
        let ([px, pv], [qx, qv]) = (self.particular(0.0), self.particular(t));
        let [fx, fv] = self.free([x - px, v - pv], t);
        [fx + qx, fv + qv]
    }
}

/// Returns the free motion of both gears in closed form.
fn closed_form(pair: &GearPair, [x1, v1, x2, v2, ..]: State, phase: f64, t: f64) -> State {
    let GearPair { m1: m, r1: r, k1: k, force, omega, .. } = *pair;
    let first = Support { m, r, k, force, omega, phase };
    let second = Support { m: pair.m2, r: pair.r2, k: pair.k2, force: 0.0, ..first };
    let ([x1, v1], [x2, v2]) = (first.solve([x1, v1], t), second.solve([x2, v2], t));
    state(&[x1, v1, x2, v2])
}

fn table() -> GearPair {
    GearPair::paper(0.5)
}

/// Returns the amplitudes of the particular solution.
fn response(pair: &GearPair) -> State {
    let (real, imaginary) = (pair.k1 - pair.m1 * pair.omega.powi(2), pair.r1 * pair.omega);
    let size = real.hypot(imaginary);
    if size == 0.0 { REST } else { state(&[pair.force / size, pair.omega * pair.force / size]) }
}

/// Returns pairs with every kind of support.
fn supports() -> Vec<(&'static str, GearPair)> {
    let p = table();
    vec![
        ("underdamped", p),
        ("critically damped", GearPair { m1: 1.0, r1: 4.0, k1: 4.0, m2: 2.0, r2: 8.0, k2: 8.0, ..p }),
        (
            "nearly critically damped",
            GearPair { m1: 1.0, r1: 4.0, k1: 4.0 + 1e-9, r2: 4.0, k2: 4.0 - 1e-9, ..p },
        ),
        ("overdamped", GearPair { r1: 40.0, r2: 30.0, ..p }),
        ("strongly overdamped", GearPair { r1: 1e3, r2: 1e4, k1: 1.0, ..p }),
        ("undamped", GearPair { r1: 0.0, r2: 0.0, ..p }),
        ("undamped at resonance", GearPair { m1: 2.0, k1: 32.0, r1: 0.0, r2: 0.0, omega: 4.0, ..p }),
        ("damped at resonance", GearPair { m1: 2.0, k1: 32.0, omega: 4.0, ..p }),
        ("nearly resonant", GearPair { m1: 2.0, k1: 32.0, r1: 0.0, omega: 4.0 + 1e-6, ..p }),
        ("rigid body, damped", GearPair { k1: 0.0, k2: 0.0, ..p }),
        ("rigid body, free", GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, ..p }),
        ("stiff", GearPair { k1: 1e6, ..p }),
        ("light and heavy", GearPair { m1: 1e-3, m2: 1e3, ..p }),
        ("heavy and light", GearPair { m1: 1e3, m2: 1e-3, ..p }),
        ("slow forcing", GearPair { omega: 1e-3, ..p }),
        ("fast forcing", GearPair { omega: 1e3, ..p }),
        ("strong force", GearPair { force: 1e6, ..p }),
    ]
}

const STARTS: [State; 3] = [REST, state(&[0.3, -1.0, 0.2, 2.0]), state(&[-40.0, 3.0, 17.0, -250.0])];
const TIMES: [f64; 9] = [0.0, 1e-12, 1e-6, 1e-3, 0.03, 0.3, 1.1, 7.0, 100.0];

/// Returns a bound on the rates of a pair. Rounding errors of a propagator are proportional to it.
fn rate(pair: &GearPair) -> f64 {
    let m = pair.m1.min(pair.m2);
    let (k, r) = (pair.k1.max(pair.k2) + 2.0 * pair.k, pair.r1.max(pair.r2) + 2.0 * pair.r);
    r / m + (k / m).sqrt() + pair.omega
}

fn free_rate(pair: &GearPair) -> f64 {
    rate(&GearPair { k: 0.0, r: 0.0, ..*pair })
}

/// Returns the largest difference of two states, relative to the size of `states`. Displacements and velocities are
/// made comparable by `rate`.
fn relative(got: State, want: State, states: &[State], rate: f64) -> f64 {
    let largest = |i: usize| states.iter().fold(0.0f64, |m, y| m.max(y[i].abs()).max(y[i + 2].abs()));
    let (x, v) = (largest(0).max(1.0), largest(1).max(1.0));
    let (x, v) = (x.max(v / rate), v.max(x * rate));
    (0..4).map(|i| (got[i] - want[i]).abs() / if i % 2 == 0 { x } else { v }).fold(0.0, max_or_nan)
}

#[test]
fn free_flow_agrees_with_the_closed_form() {
    for (what, pair) in supports() {
        let flow = flow_of(&pair);
        let mut worst = (0.0f64, 0.0);
        for y in STARTS {
            for phase in [0.0, 2.5] {
                for t in TIMES {
                    let (got, want) =
                        (flow.propagate(DomainKind::Free, y, phase, t), closed_form(&pair, y, phase, t));
                    // The closed form adds and subtracts the steady state, which may be large.
                    let steady = response(&pair);
                    let off = relative(got, want, &[y, want, steady], free_rate(&pair));
                    if off > worst.0 || off.is_nan() {
                        worst = (off, t);
                    }
                    let allowed = 16.0 * f64::EPSILON * (1.0 + free_rate(&pair) * t);
                    assert!(
                        off <= allowed,
                        "{what}: {got:?}, not {want:?}: off by {off:.1e} > {allowed:.1e} after {t} from {y:?}"
                    );
                }
            }
        }
        println!("{what}: worst {:.1e} after {}", worst.0, worst.1);
    }
}

/// Returns the generator of `(x1, v1, x2, v2, cos, sin, 1)` from (11) to (13).
fn generator(pair: &GearPair, domain: DomainKind) -> SMatrix<f64, 7, 7> {
    let p = pair;
    let (r, k, s) = match domain {
        DomainKind::Free => (0.0, 0.0, 0.0),
        DomainKind::Meshing(side) => (p.r, p.k, crate::common::sign(side)),
    };
    let mut g = SMatrix::<f64, 7, 7>::zeros();
    g[(0, 1)] = 1.0;
    g[(2, 3)] = 1.0;
    let first = [-(p.k1 + k), -(p.r1 + r), k, r, p.force, 0.0, s * k * p.b];
    let second = [k, r, -(p.k2 + k), -(p.r2 + r), 0.0, 0.0, -s * k * p.b];
    for j in 0..7 {
        g[(1, j)] = first[j] / p.m1;
        g[(3, j)] = second[j] / p.m2;
    }
    (g[(4, 5)], g[(5, 4)]) = (-p.omega, p.omega);
    g
}

/// Returns pairs with every kind of support and mesh.
fn pairs() -> Vec<(&'static str, GearPair)> {
    let p = table();
    let mut pairs = supports();
    pairs.extend([
        ("no meshing damping", GearPair { r: 0.0, ..p }),
        ("undamped everywhere", GearPair { r: 0.0, r1: 0.0, r2: 0.0, ..p }),
        ("stiff mesh", GearPair { k: 1e6, ..p }),
        ("no mesh", GearPair { k: 0.0, r: 0.0, ..p }),
        ("overdamped mesh", GearPair { r: 1e3, ..p }),
        ("equal masses", GearPair { m1: 1.0, m2: 1.0, k1: 20.0, ..p }),
        ("stiff mesh, unequal masses", GearPair { k: 1e6, m1: 1e-3, m2: 1e3, ..p }),
    ]);
    pairs
}

#[test]
fn every_domain_agrees_with_another_matrix_exponential() {
    for (what, pair) in pairs() {
        let flow = flow_of(&pair);
        let mut worst = 0.0f64;
        for domain in DOMAINS {
            for y in STARTS {
                // nalgebra's exponential loses digits for large |G| t, so the times are short.
                for t in [0.0, 1e-9, 1e-4, 0.01, 0.2] {
                    let phase = 0.7f64;
                    let (sin, cos) = phase.sin_cos();
                    let start = SVector::<f64, 7>::from([y[0], y[1], y[2], y[3], cos, sin, 1.0]);
                    let end = (generator(&pair, domain) * t).exp() * start;
                    let want = state(&end.as_slice()[..4]);
                    let got = flow.propagate(domain, y, phase, t);
                    let off = relative(got, want, &[y, want], rate(&pair));
                    worst = worst.max(off);
                    let allowed = 2.0 * PER_RADIAN * (1.0 + rate(&pair) * t);
                    assert!(off <= allowed, "{what}, {domain:?}: off by {off:.1e} > {allowed:.1e} after {t}");
                }
            }
        }
        println!("{what}: worst {worst:.1e}");
    }
}

#[test]
fn flows_compose() {
    for (what, pair) in pairs() {
        let flow = flow_of(&pair);
        for domain in DOMAINS {
            for y in STARTS {
                for (first, second) in [(1e-7, 0.3), (0.3, 1e-7), (0.05, 0.01), (0.4, 0.9), (3.0, 5.0)] {
                    let (phase, omega) = (1.2, pair.omega);
                    let middle = flow.propagate(domain, y, phase, first);
                    let end = flow.propagate(domain, middle, phase + omega * first, second);
                    let whole = flow.propagate(domain, y, phase, first + second);
                    let off = relative(end, whole, &[y, middle, end], rate(&pair));
                    // The energy norm does not grow, but it weights the gears by their masses.
                    let weights = (pair.m1.max(pair.m2) / pair.m1.min(pair.m2)).sqrt();
                    let allowed = 32.0 * f64::EPSILON * (1.0 + weights * rate(&pair) * (first + second));
                    assert!(
                        off <= allowed,
                        "{what}, {domain:?}: {off:.1e} > {allowed:.1e} at {first} + {second}"
                    );
                }
            }
        }
    }
}

/// Liouville's formula: the determinant of the fundamental matrix is `exp(trace tau)`.
#[test]
fn phase_volume_shrinks_at_the_rate_of_the_trace() {
    for (what, pair) in pairs() {
        let flow = flow_of(&pair);
        for domain in DOMAINS {
            let linear = flow.domain(domain);
            let mesh = if domain == DomainKind::Free { 0.0 } else { pair.r };
            let trace = -(pair.r1 + mesh) / pair.m1 - (pair.r2 + mesh) / pair.m2;
            assert!((linear.trace() - trace).abs() <= 1e-14 * trace.abs(), "{what}: trace");
            for t in [0.0, 1e-6, 0.01, 0.1, 1.0] {
                // The determinant of a nearly singular matrix is rounding error.
                if trace * t < -10.0 {
                    continue;
                }
                let fundamental = linear.fundamental(t);
                let (got, want) = (fundamental.determinant(), (trace * t).exp());
                // The error of the determinant is the error of the entries times the cofactors.
                let size = fundamental.norm() * fundamental.map(f64::abs).max();
                let allowed = 64.0 * f64::EPSILON * (1.0 + rate(&pair) * t) * size.max(1.0) * size.max(1.0);
                assert!((got - want).abs() <= allowed, "{what}, {domain:?}: {got} is not {want} after {t}");
            }
        }
    }
}

/// Undamped meshing of equal gears on equal supports: the modes `x1 + x2` and `x1 - x2`.
#[test]
fn meshing_of_equal_gears_splits_into_two_modes() {
    let (m, k1, omega) = (1.5, 20.0, 3.0);
    for k in [1.0, 1e3, 1e6] {
        for r in [0.0, 0.4, 2e3] {
            let pair = GearPair { m1: m, m2: m, k1, k2: k1, r1: 0.1, r2: 0.1, r, k, omega, ..table() };
            let flow = flow_of(&pair);
            let y = state(&[0.9, -0.2, 0.3, 0.4]);
            let phase = 0.4;
            let sum = Support { m, r: 0.1, k: k1, force: pair.force, omega, phase };
            let difference = Support { r: 0.1 + 2.0 * r, k: k1 + 2.0 * k, ..sum };
            // In equilibrium the force 2 k b of the wall balances the springs.
            let rest = 2.0 * k * pair.b / (k1 + 2.0 * k);
            for t in [1e-3, 0.1, 1.0, 20.0] {
                let [p, pv] = sum.solve([y[0] + y[2], y[1] + y[3]], t);
                let [d, dv] = difference.solve([y[0] - y[2] - rest, y[1] - y[3]], t);
                let d = d + rest;
                let want = state(&[(p + d) / 2.0, (pv + dv) / 2.0, (p - d) / 2.0, (pv - dv) / 2.0]);
                let got = flow.propagate(DomainKind::Meshing(Side::Right), y, phase, t);
                let off = relative(got, want, &[y, want], rate(&pair));
                let allowed = PER_RADIAN * (1.0 + rate(&pair) * t);
                assert!(off <= allowed, "k = {k}, r = {r}: off by {off:.1e} > {allowed:.1e} after {t}");
            }
        }
    }
}

#[test]
fn gap_coordinates_momentum_and_energy_of_a_state() {
    let flow = flow_of(&table());
    let y = state(&[0.75, -2.0, 0.5, 3.0]);
    assert_eq!(flow.to_gap(y), [0.25, -5.0, 0.5, 3.0]);
    assert_eq!(flow.to_state(flow.to_gap(y)), y);
    assert_eq!(flow.momentum(y), -1.0);
    assert_eq!(flow.kinetic_energy(y), 8.5);
    assert_eq!([flow.wall(Side::Right), flow.wall(Side::Left)], [0.5, -0.5]);
    assert_eq!(flow.period, std::f64::consts::TAU / 5.6);
}

/// Without contact the exponent is the decay rate of the first support, `-r1 / (2 m1)`, and the motion becomes the
/// particular solution.
#[test]
fn contact_free_motion_contracts_at_the_rate_of_its_support() {
    let pair = paper(0.5, 11.0);
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::with_tangents(&flow, pair.law(), REST, [state(&[0.6, -0.8, 0.5, 0.5])]);
    let advance = |trajectory: &mut Trajectory<'_, 1>, periods: u32| {
        (0..periods).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
    };
    advance(&mut trajectory, 500);
    trajectory.set_tangents([state(&[0.6, -0.8, 0.5, 0.5])]);
    let (decay, square) = (pair.r1 / (2.0 * pair.m1), pair.k1 / pair.m1);
    // Decaying amplitude of the first support's free motion, without its oscillation.
    let amplitude = |[x, v, ..]: State| ((square - decay * decay) * x * x + (v + decay * x).powi(2)).sqrt();
    let before = (amplitude(trajectory.tangents()[0]), trajectory.work().impacts);
    advance(&mut trajectory, 100);
    assert_eq!(trajectory.work().impacts, before.1, "the motion is not contact-free");
    let exponent = (amplitude(trajectory.tangents()[0]) / before.0).ln() / (100.0 * flow.period);
    assert!((exponent + 0.15).abs() < 1e-14, "exponent {exponent}, not -0.15");
    assert!(departure(trajectory.state(), closed_form_steady(&pair)) < 1e-12);
}

/// Returns the state of the particular solution at phase 0.
fn closed_form_steady(pair: &GearPair) -> State {
    let (real, imaginary) = (pair.k1 - pair.m1 * pair.omega.powi(2), pair.r1 * pair.omega);
    let scale = pair.force / (real * real + imaginary * imaginary);
    state(&[scale * real, scale * imaginary * pair.omega])
}
