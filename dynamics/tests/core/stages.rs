//! Stages and harmonics of the force, against closed forms and equivalent oscillators.

use crate::common::pairs::AsPair;
use nalgebra::{Complex, DVector};
use std::f64::consts::TAU;

use crate::common::linear::{Linear, invariants, product, with_wall};
use crate::common::{BUDGET, REST, near, paper};
use crate::run_up::above;
use rattlemap_dynamics::model::{
    Contact, Domain, Drive, Harmonic, Law, NonImpacting, Pair, Side, Stage, State, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{GapEvent, Trajectory};
use rattlemap_dynamics::orbit::{Class, EventKind, Settings, Status, analyse_flow, measure};

const LAW: Law = Law { restitution: [0.0; 2], mesh_speed: [0.0; 2] };

/// Returns the state after a number of forcing periods.
fn after(oscillator: &Pair, law: Law, start: State, periods: u32) -> State {
    let flow = Flow::new(oscillator);
    let mut trajectory = Trajectory::<0>::new(&flow, law, start);
    (0..periods).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
    trajectory.state()
}

fn apart(a: State, b: State) -> f64 {
    (0..4).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
}

/// Returns an oscillator that moves freely like `linear` in the first stage and like `others` in further stages.
fn staged(linear: Linear, others: &[Linear], schedule: &[(f64, usize)]) -> Pair {
    let stage = |linear: &Linear| {
        let Pair { free, meshing, .. } = linear.oscillator();
        Stage { free, meshing }
    };
    let stages = others.iter().map(stage).collect();
    Pair { stages, schedule: schedule.to_vec(), ..linear.oscillator() }
}

/// E. Meissner, Schweizerische Bauzeitung 72 (1918) 95: the trace of the monodromy matrix decides on stability.
#[test]
fn meissners_equation_is_stable_within_its_borders() {
    let (mut stable, mut unstable) = (0, 0);
    for i in 0..11 {
        for j in 0..6 {
            let (delta, epsilon, share) = (0.17 + 0.21 * f64::from(i), 0.13 * f64::from(j), 0.4);
            let with = |square: f64| Linear { gamma: 0.02, square, force: 0.0, load: 0.0, omega: 1.0 };
            let (first, second) = (with(delta + epsilon), with(delta - epsilon));
            let oscillator = staged(first, &[second], &[(0.0, 0), (share, 1)]);
            let [early, late] = [first.fundamental(share * TAU), second.fundamental((1.0 - share) * TAU)];
            let exact = product(late, early);
            let flow = Flow::new(&oscillator);
            let columns = [state(&[1.0]), state(&[0.0, 1.0])];
            let mut trajectory = Trajectory::with_tangents(&flow, LAW, state(&[0.1]), columns);
            trajectory.advance_period(&mut ()).unwrap();
            let case = format!("delta = {delta}, epsilon = {epsilon}");
            for (j, column) in trajectory.tangents().iter().enumerate() {
                for i in 0..2 {
                    assert!(near(column[i], exact[i][j], 1e-13), "{} {} {case}", column[i], exact[i][j]);
                }
            }
            let [trace, determinant] = invariants(exact);
            let found = measure(&flow, LAW, state(&[0.1]), &BUDGET);
            if trace.abs() < 1.0 + determinant {
                assert_eq!((found.period, found.status), (Some(1), Status::Ok), "{case}: {found:?}");
                stable += 1;
            } else {
                // Slow growth does not escape within the budget.
                assert!(matches!(found.status, Status::Escape | Status::Slow), "{case}: {found:?}");
                let [growth, _] = found.lyapunov.unwrap_or([f64::INFINITY; 2]);
                assert!(found.period.is_none() && growth > 0.0, "{case}: {found:?}");
                unstable += 1;
            }
        }
    }
    assert!(stable > 15 && unstable > 8, "{stable} stable, {unstable} unstable");
}

/// A mass rests on a rigid wall, leaves it when the load changes its sign, and is thrown back.
#[test]
fn a_change_of_the_load_releases_a_mass_at_rest() {
    let with = |load: f64| Linear { gamma: 0.0, square: 0.0, force: 0.0, load, omega: 1.0 };
    let oscillator = staged(with(1.0), &[with(-1.0)], &[(0.0, 0), (0.8, 1)]);
    let oscillator = with_wall(oscillator, Side::Right, 0.0, Contact::Rigid, [0.0; 2]);
    let orbit = analyse_flow(&Flow::new(&oscillator), LAW, REST, &Settings::default(), 8);
    assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{orbit:?}");
    // Away for 0.2 periods, then back with the opposite acceleration.
    let returns = 0.2 + 0.08_f64.sqrt();
    let times: Vec<_> = orbit.events.iter().map(|event| (event.kind, event.t_mod_period / TAU)).collect();
    let [(start, on), (end, off)] = times[..] else { panic!("{times:?}") };
    assert_eq!([start, end], [EventKind::MeshStart, EventKind::MeshEnd]);
    assert!(near(on, returns, 1e-14) && near(off, 0.8, 1e-14), "{times:?}");
    let speed = orbit.events[0].before[1];
    assert!(near(speed, 0.08_f64.sqrt() * TAU, 1e-13), "{speed}");
}

/// A mass falls with 20 until a stage lifts it with 2 at phase 0. The contact ends in the period that ends there.
#[test]
fn a_release_at_phase_0_belongs_to_the_period_before() {
    let loaded = |load: f64| Linear { gamma: 0.5, square: 0.0, force: 0.0, load, omega: 1.0 };
    let free = staged(loaded(-20.0), &[loaded(2.0)], &[(0.0, 1), (0.3, 0)]);
    let flow = Flow::new(&Pair { walls: [f64::INFINITY, 0.0], ..free });
    let mut trajectory = Trajectory::new(&flow, LAW, REST);
    let mut events: Vec<GapEvent> = Vec::new();
    (0..2).for_each(|_| trajectory.advance_period(&mut events).unwrap());
    let ends = events.iter().filter(|event| event.kind == EventKind::MeshEnd);
    assert_eq!(ends.map(|event| (event.period, event.t)).collect::<Vec<_>>(), [(0, TAU), (1, TAU)]);
    assert_eq!(measure(&flow, LAW, REST, &BUDGET).period, Some(1));
    let orbit = analyse_flow(&flow, LAW, REST, &Settings::default(), 1);
    assert_eq!((orbit.class, orbit.word.time_order().as_str()), (Class::Periodic { period: 1 }, "45"));
}

/// A contact behind a wall keeps its mode when the stiffness there changes.
#[test]
fn a_contact_lasts_when_its_stiffness_changes() {
    let free = Linear { gamma: 0.1, square: 0.0, force: 0.0, load: 1.0, omega: 1.0 };
    let mut oscillator = with_wall(free.oscillator(), Side::Right, 0.5, Contact::Elastic, [4.0, 0.0]);
    let softer = with_wall(free.oscillator(), Side::Right, 0.5, Contact::Elastic, [3.0, 0.0]);
    oscillator.stages = vec![Stage { free: softer.free, meshing: softer.meshing }];
    oscillator.schedule = vec![(0.25, 1), (0.75, 0)];
    let behind = |square: f64| Linear { gamma: 0.1, square, force: 0.0, load: 1.0, omega: 1.0 };
    // From the wall: depth y with y'' + 0.2 y' + k y = 1.
    let mut exact = [0.25, 0.0];
    for (k, share) in [(4.0, 0.25), (3.0, 0.5), (4.0, 0.25)] {
        exact = behind(k).flow(exact, 0.0, share * TAU);
    }
    let found = after(&oscillator, LAW, state(&[0.75]), 1);
    assert!(near(found[0] - 0.5, exact[0], 1e-13) && near(found[1], exact[1], 1e-13), "{found:?} {exact:?}");
}

/// Returns an oscillator with half the frequency and the same force, and with its schedule twice in a period.
fn at_half_the_frequency(oscillator: &Pair) -> Pair {
    let twice = |harmonic: Harmonic| Harmonic { order: 2 * harmonic.order, ..harmonic };
    let halves = [0.0, 0.5].into_iter();
    Pair {
        omega: 0.5 * oscillator.omega,
        force: [0.0; 2],
        force_sin: [0.0; 2],
        harmonics: oscillator.all_harmonics().map(twice).collect(),
        schedule: halves
            .flat_map(|from| oscillator.schedule.iter().map(move |&(begins, i)| (from + 0.5 * begins, i)))
            .collect(),
        ..oscillator.clone()
    }
}

/// Gear pairs with a third harmonic of the force and a second stage of the stiffness in contact.
fn gear_pairs() -> Vec<(Pair, Law)> {
    let mut list = Vec::new();
    for (e, omega) in [(0.06, 5.6), (0.605, 5.6), (0.72, 1.5), (0.3, 3.0), (0.8, 4.4)] {
        let pair = paper(e, omega);
        let mut oscillator = pair.pair();
        oscillator.harmonics = vec![Harmonic { order: 3, cos: [2.0, -1.0], sin: [-1.5, 0.5] }];
        let softer =
            |domain: Domain| Domain { stiffness: domain.stiffness.map(|row| row.map(|k| 0.7 * k)), ..domain };
        oscillator.stages = vec![Stage { free: oscillator.free, meshing: oscillator.meshing.map(softer) }];
        oscillator.schedule = vec![(0.1, 0), (0.6, 1)];
        list.push((oscillator, pair.law()));
    }
    list
}

#[test]
fn a_period_of_half_the_frequency_is_two_periods() {
    for (oscillator, law) in gear_pairs() {
        let half = at_half_the_frequency(&oscillator);
        let off = apart(after(&oscillator, law, REST, 6), after(&half, law, REST, 3));
        assert!(off < 1e-10, "{off:e}: {oscillator:?}");
    }
}

/// Mirror images need odd harmonics, and stages that recur after half a period.
#[test]
fn mirror_images_need_odd_harmonics_and_stages_of_half_a_period() {
    let pair = paper(0.06, 5.6).pair();
    let softer =
        |domain: Domain| Domain { stiffness: domain.stiffness.map(|row| row.map(|k| 0.7 * k)), ..domain };
    let stages = vec![Stage { free: pair.free, meshing: pair.meshing.map(softer) }];
    let with = |schedule: &[(f64, usize)]| {
        let (stages, schedule) = (stages.clone(), schedule.to_vec());
        Pair { stages, schedule, ..pair.clone() }.mirror_symmetric()
    };
    assert!(with(&[(0.1, 0), (0.25, 1), (0.6, 0), (0.75, 1)]));
    assert!(!with(&[(0.0, 0), (0.5, 1)]));
    assert!(!with(&[(0.1, 0), (0.25, 1), (0.6, 0), (0.8, 1)]));
    let of_order = |order: u32| {
        let harmonics = vec![Harmonic { order, cos: [1.0, 0.0], sin: [0.0; 2] }];
        Pair { harmonics, ..pair.clone() }.mirror_symmetric()
    };
    assert!(of_order(3) && !of_order(2));
}

/// The steady response to several harmonics is the sum of the responses.
#[test]
fn the_steady_motion_is_the_sum_of_the_responses_to_all_harmonics() {
    let first = Linear { gamma: 0.05, square: 2.0, force: 1.0, load: 0.3, omega: 0.9 };
    let mut oscillator = first.oscillator();
    let orders = [(2, 0.7), (3, -0.4), (7, 3.0)];
    oscillator.harmonics =
        orders.map(|(order, force)| Harmonic { order, cos: [force, 0.0], sin: [0.0; 2] }).to_vec();
    let mut exact = first.steady(0.0);
    for (order, force) in orders {
        let linear = Linear { force, load: 0.0, omega: first.omega * f64::from(order), ..first };
        let [x, v] = linear.steady(0.0);
        exact = [exact[0] + x, exact[1] + v];
    }
    let steady = NonImpacting::new(&oscillator).unwrap().steady();
    assert!(near(steady[0], exact[0], 1e-14) && near(steady[1], exact[1], 1e-14), "{steady:?} {exact:?}");
    let moved = after(&oscillator, LAW, state(&[exact[0], exact[1], 0.0, 0.0]), 1);
    assert!(near(moved[0], exact[0], 1e-13) && near(moved[1], exact[1], 1e-13), "{moved:?} {exact:?}");
}

/// The steady response to sixteen harmonics is the sum of sixteen closed forms, on both engines.
#[test]
fn sixteen_harmonics_act_like_the_sum_of_their_responses() {
    let omega = 0.7;
    let steady = |phase: f64| {
        let of = |order: u32| {
            let rate = omega * f64::from(order);
            let response = Complex::from(1.0) / Complex::new(1.0 - rate * rate, 0.04 * rate);
            let wave = response * Complex::from_polar(1.0 / f64::from(order), f64::from(order) * phase);
            [wave.re, -rate * wave.im]
        };
        (1..=16).map(of).fold([0.0; 2], |[x, v], [dx, dv]| [x + dx, v + dv])
    };
    for is_machine in [false, true] {
        let mut oscillator = above(-100.0, omega, 0.0, is_machine);
        let drive = |order: u32| Drive {
            order,
            cos: DVector::from_element(1, 1.0 / f64::from(order)),
            sin: DVector::zeros(1),
        };
        oscillator.drives = (1..=16).map(drive).collect();
        oscillator.validate().unwrap();
        let flow = Flow::new(&oscillator);
        let mut trajectory = Trajectory::<0>::new(&flow, LAW, state(&steady(0.0)));
        for n in 1..160 {
            let phase = 0.04 * f64::from(n);
            trajectory.advance_to(phase / omega, &mut ()).unwrap();
            let (found, [x, v]) = (trajectory.state(), steady(phase));
            assert!(
                (found[0] - x).abs() < 1e-12 && (found[1] - v).abs() < 1e-12,
                "{phase}: {found:?}, {x} {v}"
            );
        }
        oscillator.drives.push(drive(17));
        let error = oscillator.validate().unwrap_err().to_string();
        assert!(error.starts_with("harmonics = 17: it must be at most 16"), "{error}");
    }
}
