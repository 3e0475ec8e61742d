//! Oscillators with one wall against closed form, and every oscillator in other units.

use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Contact, Domain, GearPair, Law, Oscillator, REST, Side, State};
use rattlemap_dynamics::orbit::{
    Budget, Class, EventKind, Measurement, Orbit, Settings, Status, analyse_flow, measure,
};
use rattlemap_dynamics::reference::{GapEvent, Trajectory};

/// `x'' + 2 gamma x' + x = cos(omega t)` below a wall at `sigma`, and a body that stands apart and
/// is damped, so that no multiplier is its own 1.
#[derive(Clone, Copy, Debug)]
struct ImpactOscillator {
    gamma: f64,
    omega: f64,
    sigma: f64,
    e: f64,
}

/// Its steady motion with one impact in every period of the forcing.
struct Steady {
    /// When the impact happens, after phase 0, and how fast.
    impact: f64,
    approach: f64,
    /// Displacement and velocity at phase 0.
    strobe: [f64; 2],
}

impl ImpactOscillator {
    fn oscillator(&self) -> Oscillator {
        let (gamma, stop) = (self.gamma, 1000.0);
        let domain = |damping: f64, stiffness: f64, load: f64| Domain {
            damping: [[damping, 0.0], [0.0, 1.0]],
            stiffness: [[stiffness, 0.0], [0.0, 4.0]],
            load: [load, 0.0],
        };
        let free = domain(2.0 * gamma, 1.0, 0.0);
        Oscillator {
            degrees: 2,
            mass: [[1.0, 0.0], [0.0, 1.0]],
            gap: [1.0, 0.0],
            walls: [self.sigma, f64::NEG_INFINITY],
            contacts: [Contact::Impact; 2],
            omega: self.omega,
            force: [1.0, 0.0],
            free,
            meshing: [domain(2.0 * gamma + 1.0, 1.0 + stop, stop * self.sigma), free],
        }
    }

    fn law(&self) -> Law {
        Law::both(self.e, 0.01)
    }

    /// Between impacts `x = P cos(omega t - psi) + exp(-gamma s) (a cos Omega s + b sin Omega s)`, `s` the
    /// time since the last. That it closes after a period gives `b / a`; the impact law gives the
    /// approach and `p'` at the impact in units of `a`; and `p^2 + (p' / omega)^2 = P^2`, with
    /// `p = sigma - a` there, is a quadratic for `a`.
    fn steady(&self) -> Steady {
        let ImpactOscillator { gamma, omega, sigma, e } = *self;
        let (own, period) = ((1.0 - gamma * gamma).sqrt(), std::f64::consts::TAU / omega);
        let (real, imaginary) = (1.0 - omega * omega, 2.0 * gamma * omega);
        let (amplitude, lag) = (real.hypot(imaginary).recip(), imaginary.atan2(real));
        let decay = (-gamma * period).exp();
        let (sin, cos) = (own * period).sin_cos();
        let b = (1.0 - decay * cos) / (decay * sin);
        // Rates of the transient just after an impact and just before the next.
        let (first, last) = (own * b - gamma, own * decay * (b * cos - sin) - gamma);
        let approach = (last - first) / (1.0 + e);
        let forced = approach - last;
        let (square, half, rest) =
            (1.0 + (forced / omega).powi(2), -sigma, sigma * sigma - amplitude * amplitude);
        let root = (half * half - square * rest).sqrt();
        // The other root is unstable, or comes to the wall from behind.
        let a = if approach > 0.0 { (root - half) / square } else { (-root - half) / square };
        let turned = (-a * forced / omega).atan2(sigma - a) + lag;
        let impact = (turned / omega).rem_euclid(period);
        let s = period - impact;
        let (sin, cos) = (own * s).sin_cos();
        let (x, y) = (cos + b * sin, own * (b * cos - sin));
        let transient = [x, y - gamma * x].map(|x| a * (-gamma * s).exp() * x);
        let strobe = [amplitude * lag.cos() + transient[0], omega * amplitude * lag.sin() + transient[1]];
        Steady { impact, approach: a * approach, strobe }
    }
}

fn cases() -> impl Iterator<Item = ImpactOscillator> {
    [
        (0.0, 1.6, 0.0),
        (0.0, 1.9, 0.3),
        (0.0, 2.5, -0.3),
        (0.05, 1.4, 0.3),
        (0.05, 2.2, -0.3),
        (0.05, 2.5, 0.0),
    ]
    .into_iter()
    .map(|(gamma, omega, sigma)| ImpactOscillator { gamma, omega, sigma, e: 0.8 })
}

fn budget() -> Budget {
    Budget {
        settings: Settings::default(),
        early_stop: true,
        undecided_periods: 1024,
        exponent: true,
        shows_exponent: true,
    }
}

fn near(a: f64, b: f64, within: f64) -> bool {
    (a - b).abs() <= within
}

#[test]
fn one_wall_has_the_closed_form_orbit() {
    for case in cases() {
        let steady = case.steady();
        assert!(steady.approach > 0.3, "{case:?}");
        let flow = Flow::new(&case.oscillator());
        let [x, v] = steady.strobe;
        let start = [x - 0.01, v + 0.02, 0.3, -0.2];

        let orbit = analyse_flow(&flow, case.law(), start, &Settings::default(), 8);
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{case:?}");
        assert_eq!((orbit.symmetric, orbit.impacts_per_period), (Some(false), 1.0), "{case:?}");
        for (ours, exact) in orbit.strobe.into_iter().zip([x, v, 0.0, 0.0]) {
            assert!(near(ours, exact, 1e-11), "{case:?}: {:?}, not {:?}", orbit.strobe, steady.strobe);
        }
        let [event] = &orbit.events[..] else { panic!("{case:?}: {:?}", orbit.events) };
        assert_eq!((event.kind, event.side), (EventKind::Impact, Side::Right));
        assert!(
            near(event.t, steady.impact, 1e-11) && near(event.before[1], steady.approach, 1e-11),
            "{case:?}"
        );
        assert!(near(event.after[1], -case.e * steady.approach, 1e-11), "{case:?}");
        // A complex pair of modulus `e exp(-gamma T)`: impacts take `e^2` of areas, damping the rest.
        let exponent = case.e.ln() / flow.period - case.gamma;
        assert!(near(orbit.lyapunov, exponent, 1e-10), "{case:?}: {} not {exponent}", orbit.lyapunov);

        let cell = measure(&flow, case.law(), start, &budget());
        assert_eq!(
            (cell.period, cell.status, cell.impacts_per_period),
            (Some(1), Status::Ok, 1.0),
            "{case:?}"
        );
        assert!(near(cell.lyapunov.unwrap()[0], exponent, 1e-10), "{case:?}");
        assert!(cell.periods_run < 200, "{case:?}: {}", cell.periods_run);
    }
}

/// The mirror image of an oscillator has its wall on the left.
#[test]
fn a_left_wall_alone_mirrors_a_right_one() {
    for case in cases() {
        let right = case.oscillator();
        let mirrored = |d: &Domain| Domain { load: d.load.map(|x| -x), ..*d };
        let left = Oscillator {
            walls: [f64::INFINITY, -case.sigma],
            contacts: [Contact::Impact; 2],
            force: right.force.map(|x| -x),
            free: mirrored(&right.free),
            meshing: [mirrored(&right.meshing[1]), mirrored(&right.meshing[0])],
            ..right
        };
        assert_eq!(left.length_scale(), right.length_scale());
        let [x, v] = case.steady().strobe;
        let start = [x - 0.01, v + 0.02, 0.3, -0.2];
        let run = |oscillator: &Oscillator, start: State| {
            let flow = Flow::new(oscillator);
            analyse_flow(&flow, case.law(), start, &Settings::default(), 8)
        };
        let (a, b) = (run(&right, start), run(&left, start.map(|x| -x)));
        assert_eq!((a.class, a.status, a.lyapunov), (b.class, b.status, b.lyapunov), "{case:?}");
        assert_eq!(a.strobe, b.strobe.map(|x| -x), "{case:?}");
        assert!(b.events.iter().all(|event| event.side == Side::Left), "{case:?}");
    }
}

/// Without any wall, and before one that it does not reach, motion is the steady response.
#[test]
fn a_wall_out_of_reach_changes_nothing() {
    let case = ImpactOscillator { gamma: 0.05, omega: 1.5, sigma: 5.0, e: 0.8 };
    let near_wall = case.oscillator();
    let no_wall = Oscillator { walls: [f64::INFINITY, f64::NEG_INFINITY], ..near_wall };
    let orbits: Vec<Orbit> = [near_wall, no_wall]
        .iter()
        .map(|oscillator| {
            let flow = Flow::new(oscillator);
            assert!(flow.non_impacting().is_some());
            let cell = measure(&flow, case.law(), REST, &budget());
            assert_eq!((cell.period, cell.status, cell.impacts_per_period), (Some(1), Status::Ok, 0.0));
            analyse_flow(&flow, case.law(), REST, &Settings::default(), 8)
        })
        .collect();
    let response = (1.0 - case.omega * case.omega).hypot(2.0 * case.gamma * case.omega).recip();
    for orbit in &orbits {
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok));
        assert!(
            near(orbit.strobe[0].hypot(orbit.strobe[1] / case.omega), response, 1e-12),
            "{:?}",
            orbit.strobe
        );
        assert!(near(orbit.lyapunov, -case.gamma, 1e-12));
    }
}

/// A ball that falls onto a floor, a shaken force on it: nothing but the floor and the load has a
/// length. Where the floor lies makes no difference.
#[test]
fn a_ball_comes_to_rest_on_a_floor_at_zero() {
    let (g, v, e) = (2.0, 1.0, 0.5);
    let ball = |floor: f64| {
        let domain = |damping: f64, stiffness: f64, load: f64| Domain {
            damping: [[damping, 0.0], [0.0, 1.0]],
            stiffness: [[stiffness, 0.0], [0.0, 1.0]],
            load: [load, 0.0],
        };
        let free = domain(0.0, 0.0, g);
        Oscillator {
            degrees: 2,
            mass: [[1.0, 0.0], [0.0, 1.0]],
            gap: [1.0, 0.0],
            walls: [floor, f64::NEG_INFINITY],
            contacts: [Contact::Impact; 2],
            omega: 1.0,
            force: [0.0, 0.0],
            free,
            meshing: [domain(200.0, 1e4, g + 1e4 * floor), free],
        }
    };
    for floor in [0.0, 0.75, -3.0] {
        let oscillator = ball(floor);
        assert!(oscillator.length_scale() >= g);
        let flow = Flow::new(&oscillator);
        let law = Law::both(e, 0.0);
        let mut trajectory = Trajectory::new(&flow, law, [floor, -v, 0.0, 0.0]);
        let mut events: Vec<GapEvent> = Vec::new();
        (0..3).for_each(|_| trajectory.advance_period(&mut events).unwrap());
        let end = events.pop().unwrap();
        assert_eq!(end.kind, EventKind::MeshStart, "floor {floor}");
        // After `2 v / g` each time, `e` times as fast as before; in all `2 v / (g (1 - e))`.
        assert!(near(end.t, 2.0 * v / (g * (1.0 - e)), 1e-12), "floor {floor}: {end:?}");
        let (mut t, mut speed) = (0.0, v);
        for event in &events {
            t += 2.0 * speed / g;
            assert_eq!((event.kind, event.side), (EventKind::Impact, Side::Right));
            assert!(
                near(event.t, t, 1e-12) && near(event.before[1] / speed, 1.0, 1e-10),
                "floor {floor}: {event:?}"
            );
            speed *= e;
        }
        assert!(events.len() > 8, "floor {floor}: {}", events.len());
        // It sinks in by `g / k`, and stays.
        assert_eq!(trajectory.meshing(), Some(Side::Right));
        assert!(near(trajectory.state()[0] - floor, g / 1e4, 1e-12), "{:?}", trajectory.state());

        let orbit = analyse_flow(&flow, law, [floor, -v, 0.0, 0.0], &Settings::default(), 8);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "floor {floor}");
        assert!(near(orbit.mesh_fraction, 1.0, 1e-12), "floor {floor}: {}", orbit.mesh_fraction);
    }
}

/// An oscillator, its law and a start where lengths are `length` times and rates `rate` times as large.
fn in_units(
    oscillator: &Oscillator,
    law: Law,
    start: State,
    length: f64,
    rate: f64,
) -> (Oscillator, Law, State) {
    let force = length * rate * rate;
    let domain = |d: &Domain| Domain {
        damping: d.damping.map(|row| row.map(|c| rate * c)),
        stiffness: d.stiffness.map(|row| row.map(|k| rate * rate * k)),
        load: d.load.map(|f| force * f),
    };
    let scaled = Oscillator {
        walls: oscillator.walls.map(|wall| length * wall),
        contacts: [Contact::Impact; 2],
        omega: rate * oscillator.omega,
        force: oscillator.force.map(|f| force * f),
        free: domain(&oscillator.free),
        meshing: [domain(&oscillator.meshing[0]), domain(&oscillator.meshing[1])],
        ..*oscillator
    };
    assert_eq!(scaled.length_scale(), length * oscillator.length_scale());
    let [x1, v1, x2, v2] = start;
    let start = [length * x1, length * rate * v1, length * x2, length * rate * v2];
    (scaled, Law { mesh_speed: law.mesh_speed.map(|speed| length * rate * speed), ..law }, start)
}

/// Gear pairs over the paper's plane, and the impact oscillators from rest below their wall.
fn all_kinds() -> Vec<(Oscillator, Law, State)> {
    let mut list = Vec::new();
    for j in 0..9 {
        for i in 0..9 {
            let omega = 1.1 + 1.3 * f64::from(j);
            let pair = GearPair { omega, ..GearPair::paper(0.03 + 0.12 * f64::from(i)) };
            list.push((pair.oscillator().unwrap(), pair.law(), REST));
        }
    }
    for i in 0..24 {
        let (gamma, sigma) = (if i % 2 == 0 { 0.0 } else { 0.05 }, 0.3 * f64::from(i % 3 - 1));
        let case = ImpactOscillator { gamma, omega: 1.3 + 0.07 * f64::from(i), sigma, e: 0.7 };
        list.push((case.oscillator(), case.law(), [sigma - 0.5, 0.0, 0.1, 0.0]));
    }
    list
}

fn measured((oscillator, law, start): &(Oscillator, Law, State)) -> Measurement {
    measure(&Flow::new(oscillator), *law, *start, &budget())
}

/// Powers of two multiply every length without rounding: not a bit may differ.
#[test]
fn a_unit_of_length_changes_no_bit() {
    for case in all_kinds() {
        let ours = measured(&case);
        for length in [2f64.powi(-20), 2f64.powi(20)] {
            let (oscillator, law, start) = case;
            let mut theirs = measured(&in_units(&oscillator, law, start, length, 1.0));
            theirs.strobe = theirs.strobe.map(|x| x / length);
            assert_eq!(format!("{theirs:?}"), format!("{ours:?}"), "{length:e}: {case:?}");
        }
    }
}

/// A power of two as the unit of time changes no bit of the motion, and none of what is read off it but by the
/// rounding of tangent vectors, which mix displacements and velocities.
#[test]
fn a_unit_of_time_changes_no_class() {
    for case in all_kinds() {
        let ours = measured(&case);
        for rate in [2f64.powi(-20), 2f64.powi(20)] {
            let (oscillator, law, start) = case;
            let theirs = measured(&in_units(&oscillator, law, start, 1.0, rate));
            let say = || format!("{rate:e}: {case:?}\n{ours:?}\n{theirs:?}");
            assert_eq!((theirs.period, theirs.status), (ours.period, ours.status), "{}", say());
            assert_eq!(theirs.symmetric, ours.symmetric, "{}", say());
            for (i, unit) in [1.0, rate, 1.0, rate].into_iter().enumerate() {
                // On a cycle that both reach; after as many periods, where it is not one.
                let close = 1e-9 * (1.0 + ours.strobe[i].abs());
                let same = ours.periods_run == theirs.periods_run;
                assert!(!same || near(theirs.strobe[i] / unit, ours.strobe[i], close), "{}", say());
            }
        }
    }
}
