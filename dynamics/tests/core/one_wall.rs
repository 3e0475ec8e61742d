//! Classification of oscillators with one wall, against closed forms, and the effect of units.

use crate::common::linear::{Linear, transformed, unforced, with_wall};
use crate::common::pairs::AsPair;
use crate::common::{BUDGET, near};
use crate::single_stop::{Family, Impacting};
use rattlemap_dynamics::model::{Contact, Domain, GearPair, Law, Pair, REST, Side, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{GapEvent, Trajectory};
use rattlemap_dynamics::orbit::{
    Budget, Class, EventKind, Measurement, Orbit, Settings, Status, analyse_flow, measure,
};

/// `x'' + 2 gamma x' + x = cos(omega t)` with a wall at `sigma`, and a second, damped body that touches nothing.
#[derive(Clone, Copy, Debug)]
struct ImpactOscillator {
    gamma: f64,
    omega: f64,
    sigma: f64,
    e: f64,
}

impl ImpactOscillator {
    fn family(&self) -> Family {
        Family::new(self.gamma, self.omega, self.e, 1)
    }

    fn oscillator(&self) -> Pair {
        let single = self.family().linear.oscillator();
        let free = Domain {
            damping: [[2.0 * self.gamma, 0.0], [0.0, 1.0]],
            stiffness: [[1.0, 0.0], [0.0, 4.0]],
            ..single.free
        };
        let plain = Pair { degrees: 2, free, meshing: [free; 2], ..single.clone() };
        with_wall(plain, Side::Right, self.sigma, Contact::Impact, [1000.0, 1.0])
    }

    fn law(&self) -> Law {
        Law::both(self.e, 0.01)
    }

    /// Returns the stable orbit with one impact per period, and its displacement and velocity at phase 0.
    fn orbit(&self) -> (Impacting, [f64; 2]) {
        let family = self.family();
        let orbit = family.at_stop(self.sigma);
        (orbit, family.strobe(&orbit))
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

#[test]
fn an_orbit_at_one_wall_is_classified_and_agrees_with_the_closed_form() {
    for case in cases() {
        let (exact, [x, v]) = case.orbit();
        assert!(exact.speed > 0.3, "{case:?}");
        let flow = Flow::new(&case.oscillator());
        let start = state(&[x - 0.01, v + 0.02, 0.3, -0.2]);

        let orbit = analyse_flow(&flow, case.law(), start, &Settings::default(), 8);
        assert_eq!((orbit.class, orbit.status), (Class::Periodic { period: 1 }, Status::Ok), "{case:?}");
        assert_eq!((orbit.symmetric, orbit.impacts_per_period), (Some(false), 1.0), "{case:?}");
        for (ours, exact) in orbit.strobe.into_iter().zip([x, v, 0.0, 0.0]) {
            assert!(near(ours, exact, 1e-11), "{case:?}: {:?}, not {:?}", orbit.strobe, [x, v]);
        }
        let [event] = &orbit.events[..] else { panic!("{case:?}: {:?}", orbit.events) };
        assert_eq!((event.kind, event.side), (EventKind::Impact, Side::Right));
        assert!(near(event.t, exact.at, 1e-11) && near(event.before[1], exact.speed, 1e-11), "{case:?}");
        assert!(near(event.after[1], -case.e * exact.speed, 1e-11), "{case:?}");
        // The multipliers are a complex pair of modulus `e exp(-gamma T)`.
        let exponent = case.e.ln() / flow.period - case.gamma;
        assert!(near(orbit.lyapunov, exponent, 1e-10), "{case:?}: {} not {exponent}", orbit.lyapunov);

        let cell = measure(&flow, case.law(), start, &BUDGET);
        assert_eq!(
            (cell.period, cell.status, cell.impacts_per_period),
            (Some(1), Status::Ok, 1.0),
            "{case:?}"
        );
        assert!(near(cell.lyapunov.unwrap()[0], exponent, 1e-10), "{case:?}");
        assert!(cell.periods_run < 200, "{case:?}: {}", cell.periods_run);
    }
}

#[test]
fn an_oscillator_with_a_left_wall_is_the_mirror_image_of_one_with_a_right_wall() {
    for case in cases() {
        let right = case.oscillator();
        let mirrored = |d: &Domain| Domain { load: d.load.map(|x| -x), ..*d };
        let left = Pair {
            walls: [f64::INFINITY, -case.sigma],
            contacts: [Contact::Impact; 2],
            force: right.force.map(|x| -x),
            free: mirrored(&right.free),
            meshing: [mirrored(&right.meshing[1]), mirrored(&right.meshing[0])],
            ..right.clone()
        };
        assert_eq!(left.length_scale(), right.length_scale());
        let (_, [x, v]) = case.orbit();
        let start = state(&[x - 0.01, v + 0.02, 0.3, -0.2]);
        let run = |oscillator: &Pair, start: State| {
            let flow = Flow::new(oscillator);
            analyse_flow(&flow, case.law(), start, &Settings::default(), 8)
        };
        let (a, b) = (run(&right, start), run(&left, start.map(|x| -x)));
        assert_eq!((a.class, a.status, a.lyapunov), (b.class, b.status, b.lyapunov), "{case:?}");
        assert_eq!(a.strobe, b.strobe.map(|x| -x), "{case:?}");
        assert!(b.events.iter().all(|event| event.side == Side::Left), "{case:?}");
    }
}

/// Both without a wall and with one out of reach, the motion is the steady response.
#[test]
fn a_wall_out_of_reach_does_not_change_the_motion() {
    let case = ImpactOscillator { gamma: 0.05, omega: 1.5, sigma: 5.0, e: 0.8 };
    let near_wall = case.oscillator();
    let no_wall = Pair { walls: [f64::INFINITY, f64::NEG_INFINITY], ..near_wall.clone() };
    let orbits: Vec<Orbit> = [near_wall, no_wall]
        .iter()
        .map(|oscillator| {
            let flow = Flow::new(oscillator);
            assert!(flow.non_impacting().is_some());
            let cell = measure(&flow, case.law(), REST, &BUDGET);
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

/// Without a second wall and a force, only the load and the position of the floor give a scale of length.
#[test]
fn a_ball_comes_to_rest_on_a_floor_at_any_position() {
    let (g, v, e) = (2.0, 1.0, 0.5);
    let ball = |floor: f64| {
        let free = Linear { gamma: 0.0, square: 0.0, force: 0.0, load: g, omega: 1.0 };
        with_wall(free.oscillator(), Side::Right, floor, Contact::Impact, [1e4, 200.0])
    };
    for floor in [0.0, 0.75, -3.0] {
        let oscillator = ball(floor);
        assert!(oscillator.length_scale() >= g);
        let flow = Flow::new(&oscillator);
        let law = Law::both(e, 0.0);
        let mut trajectory = Trajectory::new(&flow, law, state(&[floor, -v]));
        let mut events: Vec<GapEvent> = Vec::new();
        (0..3).for_each(|_| trajectory.advance_period(&mut events).unwrap());
        let end = events.pop().unwrap();
        assert_eq!(end.kind, EventKind::MeshStart, "floor {floor}");
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
        // At rest the spring behind the floor is compressed by `g / k`.
        assert_eq!(trajectory.meshing(), Some(Side::Right));
        assert!(near(trajectory.state()[0] - floor, g / 1e4, 1e-12), "{:?}", trajectory.state());

        let orbit = analyse_flow(&flow, law, state(&[floor, -v]), &Settings::default(), 8);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "floor {floor}");
        assert!(near(orbit.mesh_fraction, 1.0, 1e-12), "floor {floor}: {}", orbit.mesh_fraction);
    }
}

/// Transforms an oscillator, its law and a start so that lengths are multiplied by `length` and rates by `rate`.
pub(crate) fn in_units(
    oscillator: &Pair,
    law: Law,
    start: State,
    length: f64,
    rate: f64,
) -> (Pair, Law, State) {
    let force = length * rate * rate;
    let domain = |d: &Domain| Domain {
        damping: d.damping.map(|row| row.map(|c| rate * c)),
        stiffness: d.stiffness.map(|row| row.map(|k| rate * rate * k)),
        load: d.load.map(|f| force * f),
    };
    let scaled = Pair {
        walls: oscillator.walls.map(|wall| length * wall),
        omega: rate * oscillator.omega,
        ..transformed(oscillator, domain, |f| f.map(|f| force * f))
    };
    assert_eq!(scaled.length_scale(), length * oscillator.length_scale());
    let [x1, v1, x2, v2, ..] = start;
    let start = state(&[length * x1, length * rate * v1, length * x2, length * rate * v2]);
    (scaled, Law { mesh_speed: law.mesh_speed.map(|speed| length * rate * speed), ..law }, start)
}

/// Returns gear pairs over restitution and frequency, and impact oscillators that start from rest.
fn gear_pairs_and_impact_oscillators() -> Vec<(Pair, Law, State)> {
    let mut list = Vec::new();
    for j in 0..9 {
        for i in 0..9 {
            let omega = 1.1 + 1.3 * f64::from(j);
            let pair = GearPair { omega, ..GearPair::paper(0.03 + 0.12 * f64::from(i)) };
            list.push((pair.pair(), pair.law(), REST));
        }
    }
    for i in 0..24 {
        let (gamma, sigma) = (if i % 2 == 0 { 0.0 } else { 0.05 }, 0.3 * f64::from(i % 3 - 1));
        let case = ImpactOscillator { gamma, omega: 1.3 + 0.07 * f64::from(i), sigma, e: 0.7 };
        list.push((case.oscillator(), case.law(), state(&[sigma - 0.5, 0.0, 0.1])));
    }
    list
}

fn measured((oscillator, law, start): &(Pair, Law, State)) -> Measurement {
    let budget = Budget { undecided_periods: 1024, ..BUDGET };
    measure(&Flow::new(oscillator), *law, *start, &budget)
}

/// Multiplication by a power of two is exact.
#[test]
fn a_unit_of_length_that_is_a_power_of_two_changes_no_bit() {
    for case in gear_pairs_and_impact_oscillators() {
        let ours = measured(&case);
        for length in [2f64.powi(-20), 2f64.powi(20)] {
            let (oscillator, law, start) = case.clone();
            let mut theirs = measured(&in_units(&oscillator, law, start, length, 1.0));
            theirs.strobe = theirs.strobe.map(|x| x / length);
            assert_eq!(format!("{theirs:?}"), format!("{ours:?}"), "{length:e}: {case:?}");
        }
    }
}

/// The motion does not change by a bit, but tangent vectors have other rounding errors, because they mix
/// displacements and velocities.
#[test]
fn a_unit_of_time_that_is_a_power_of_two_changes_no_class() {
    for case in gear_pairs_and_impact_oscillators() {
        let ours = measured(&case);
        for rate in [2f64.powi(-20), 2f64.powi(20)] {
            let (oscillator, law, start) = case.clone();
            let theirs = measured(&in_units(&oscillator, law, start, 1.0, rate));
            let say = || format!("{rate:e}: {case:?}\n{ours:?}\n{theirs:?}");
            assert_eq!((theirs.period, theirs.status), (ours.period, ours.status), "{}", say());
            assert_eq!(theirs.symmetric, ours.symmetric, "{}", say());
            for (i, unit) in [1.0, rate, 1.0, rate].into_iter().enumerate() {
                let close = 1e-9 * (1.0 + ours.strobe[i].abs());
                let same = ours.periods_run == theirs.periods_run;
                assert!(!same || near(theirs.strobe[i] / unit, ours.strobe[i], close), "{}", say());
            }
        }
    }
}

/// Two equal pendulums lose their relative motion in impacts, and then swing together for ever. Nothing in this model has a length.
#[test]
fn equal_pendulums_that_collide_end_in_a_common_swing() {
    let free = Domain { damping: [[0.0; 2]; 2], stiffness: [[1.0, 0.0], [0.0, 1.0]], load: [0.0; 2] };
    let pendulums = Pair { gap: [1.0, -1.0], ..unforced(2, free) };
    let flow = Flow::new(&with_wall(pendulums, Side::Right, 0.0, Contact::Rigid, [0.0; 2]));
    for e in [0.0, 0.3, 0.5, 0.8] {
        for [x1, v1, x2, v2] in [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.3], [1.0, 0.0, 1.0, 0.0], [0.0; 4]] {
            let start = state(&[x1, v1, x2, v2]);
            let orbit = analyse_flow(&flow, Law::both(e, 0.0), start, &Settings::default(), 8);
            assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e} {start:?}: {:?}", orbit.status);
            let together = [0.5 * (x1 + x2), 0.5 * (v1 + v2)];
            for (ours, exact) in orbit.strobe.into_iter().zip([together, together].concat()) {
                assert!(near(ours, exact, 1e-12), "{e} {start:?}: {:?}", orbit.strobe);
            }
        }
    }
}
