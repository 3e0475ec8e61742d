//! Extreme parameters: every motion stays finite or ends with a [`Stop`], and the work is bounded.

use crate::common::pairs::AsPair;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::common::{BUDGET, REST, apart, flow_of, negated, paper, sign, strobe, work_since};
use rattlemap_dynamics::model::{Contact, Domain, GearPair, Law, Pair, Side, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EVENTS_PER_PERIOD_CAP, GapEvent, Stop, Trajectory, Work};
use rattlemap_dynamics::orbit::{Budget, Class, Settings, Status, analyse, measure, measure_until};
use rayon::prelude::*;

/// Returns the largest allowed number of steps in a period: several per radian of the fastest oscillation of teeth
/// and supports, and those for the events.
fn step_budget(pair: &GearPair, work: Work) -> f64 {
    let p = pair;
    let by_mass = 1.0 / p.m1 + 1.0 / p.m2;
    let stiffness = (p.k1 / p.m1).max(p.k2 / p.m2) + p.k * by_mass;
    let damping = (p.r1 / p.m1).max(p.r2 / p.m2) + p.r * by_mass;
    let rate = stiffness.sqrt() + damping + p.omega;
    let period = std::f64::consts::TAU / p.omega;
    // At each grazing a step is halved many times.
    400.0 + 8.0 * rate * period + 60.0 * work.events as f64
}

/// Integrates a cell and checks every period. Returns the last state, or the stop.
fn run(pair: &GearPair, from: State, periods: u64) -> Result<State, Stop> {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), from);
    for period in 0..periods {
        let before = trajectory.work();
        trajectory.advance_period(&mut ())?;
        let work = work_since(trajectory.work(), before);
        let budget = step_budget(pair, work);
        assert!(
            (work.steps as f64) < budget,
            "{} steps > {budget:.0} in period {period} of {pair:?}: {work:?}",
            work.steps
        );
        assert!(work.root_iterations <= 4 * work.events + 16, "{work:?} in period {period} of {pair:?}");
        assert!(work.events <= EVENTS_PER_PERIOD_CAP);
        let state = trajectory.state();
        assert!(state.iter().all(|x| x.is_finite()), "{state:?} after period {period} of {pair:?}");
    }
    Ok(trajectory.state())
}

/// Returns pairs with one or more extreme parameters.
fn extremes() -> Vec<(&'static str, GearPair)> {
    let p = paper(0.5, 5.6);
    vec![
        ("perfectly plastic", GearPair { e: 0.0, ..p }),
        ("elastic", GearPair { e: 1.0, ..p }),
        ("nearly elastic, slow", GearPair { e: 0.999, omega: 1.0, ..p }),
        ("elastic, slow", GearPair { e: 1.0, omega: 1.0, ..p }),
        ("no threshold", GearPair { e: 0.3, mesh_speed: 0.0, ..p }),
        ("no threshold, slow", GearPair { e: 0.3, mesh_speed: 0.0, omega: 1.0, ..p }),
        ("no threshold, high restitution", GearPair { e: 0.9, mesh_speed: 0.0, ..p }),
        ("no threshold, high restitution, slow", GearPair { e: 0.9, mesh_speed: 0.0, omega: 1.0, ..p }),
        ("no threshold, nearly elastic, very slow", GearPair { e: 0.99, mesh_speed: 0.0, omega: 0.1, ..p }),
        ("no threshold, elastic", GearPair { e: 1.0, mesh_speed: 0.0, ..p }),
        ("no threshold, elastic, slow", GearPair { e: 1.0, mesh_speed: 0.0, omega: 1.0, ..p }),
        ("no threshold, plastic", GearPair { e: 0.0, mesh_speed: 0.0, omega: 1.5, ..p }),
        ("tiny threshold", GearPair { e: 0.5, mesh_speed: 1e-12, omega: 1.5, ..p }),
        ("tiniest threshold", GearPair { e: 0.5, mesh_speed: 1e-300, omega: 1.5, ..p }),
        ("huge threshold", GearPair { e: 0.5, mesh_speed: 1e9, ..p }),
        ("stiff mesh", GearPair { k: 1e6, ..p }),
        ("stiff mesh, plastic, slow", GearPair { k: 1e6, e: 0.0, omega: 1.5, ..p }),
        ("undamped mesh", GearPair { r: 0.0, e: 0.0, ..p }),
        ("stiff undamped mesh", GearPair { r: 0.0, k: 1e6, e: 0.0, ..p }),
        ("mesh without spring", GearPair { k: 0.0, e: 0.0, ..p }),
        ("mesh without spring and damper", GearPair { k: 0.0, r: 0.0, e: 0.0, ..p }),
        ("heavily damped mesh", GearPair { r: 1e4, e: 0.0, ..p }),
        ("no force", GearPair { force: 0.0, ..p }),
        ("strong force", GearPair { force: 1e6, ..p }),
        ("strong force, elastic", GearPair { force: 1e6, e: 1.0, ..p }),
        ("strong force, plastic, stiff", GearPair { force: 1e6, e: 0.0, k: 1e6, ..p }),
        ("strong negative force", GearPair { force: -1e6, ..p }),
        ("very small backlash", GearPair { b: 1e-9, ..p }),
        ("very small backlash, plastic", GearPair { b: 1e-9, e: 0.0, ..p }),
        ("very small backlash, high restitution", GearPair { b: 1e-9, e: 0.9, ..p }),
        ("very slow forcing", GearPair { omega: 1e-3, ..p }),
        ("very slow forcing, plastic", GearPair { omega: 1e-3, e: 0.0, ..p }),
        ("very slow forcing, stiff", GearPair { omega: 1e-2, e: 0.0, k: 1e6, ..p }),
        ("very fast forcing", GearPair { omega: 1e3, ..p }),
        ("very fast and strong forcing", GearPair { omega: 1e3, force: 1e6, ..p }),
        ("no supports", GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, ..p }),
        ("no supports, no threshold", GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, mesh_speed: 0.0, ..p }),
        ("undamped, elastic", GearPair { r1: 0.0, r2: 0.0, r: 0.0, e: 1.0, ..p }),
        ("resonance without damping", GearPair { r1: 0.0, r2: 0.0, k1: 32.0, omega: 4.0, ..p }),
        ("light against heavy", GearPair { m1: 1e-3, m2: 1e3, ..p }),
        ("heavy against light", GearPair { m1: 1e3, m2: 1e-3, e: 0.1, ..p }),
    ]
}

/// In one forcing period the first mass falls down a hill by a factor of `e^390`, while the second one vibrates in the gap.
#[test]
fn an_escape_within_a_long_period_takes_bounded_work() {
    let free = Domain {
        damping: [[1.0, 0.0], [0.0, 8.0]],
        stiffness: [[-15.0, 0.0], [0.0, 500.0]],
        load: [0.0, 1.0],
    };
    let oscillator = Pair {
        degrees: 2,
        mass: [[1.0, 0.0], [0.0, 1.0]],
        gap: [0.0, 1.0],
        walls: [0.7, f64::NEG_INFINITY],
        contacts: [Contact::Rigid; 2],
        omega: 0.053,
        force: [7.0, 8.0],
        free,
        meshing: [free; 2],
        ..paper(0.5, 1.0).pair()
    };
    let flow = Flow::new(&oscillator);
    let mut trajectory = Trajectory::new(&flow, Law::both(0.5, 0.0), state(&[0.0, 0.0, 0.1]));
    assert_eq!(trajectory.advance_period(&mut ()), Err(Stop::Escape));
    assert!(trajectory.work().steps < 10_000, "{:?}", trajectory.work());
}

#[test]
fn extreme_parameters_take_bounded_work() {
    for (what, pair) in extremes() {
        println!("{what}: {:?}", run(&pair, REST, 30));
    }
}

/// Returns starts on, near and behind the right wall.
fn starts(b: f64) -> Vec<(&'static str, State)> {
    vec![
        ("on the wall, at rest", state(&[b])),
        ("on the wall, closing", state(&[b, 1.0])),
        ("on the wall, closing very slowly", state(&[b, 1e-300])),
        ("on the wall, opening", state(&[b, -1.0])),
        ("on the wall, opening very slowly", state(&[b, -1e-300])),
        ("behind the wall, at rest", state(&[1.5 * b])),
        ("behind the wall, closing", state(&[1.5 * b, 3.0])),
        ("behind the wall, opening", state(&[1.5 * b, -3.0])),
        ("behind the wall by rounding", state(&[b * (1.0 + f64::EPSILON)])),
        ("behind the wall by rounding, opening", state(&[b * (1.0 + f64::EPSILON), -1.0])),
        ("in front of the wall by rounding", state(&[b * (1.0 - f64::EPSILON)])),
        ("in front of the wall by rounding, closing", state(&[b * (1.0 - f64::EPSILON), 1.0])),
        ("far behind the wall", state(&[50.0 * b, 0.0, -50.0 * b])),
        ("very fast", state(&[0.0, 1e4, 0.0, -1e4])),
    ]
}

#[test]
fn starts_near_a_wall_run_and_agree_with_their_mirror_images() {
    for e in [0.0, 0.5, 1.0] {
        for mesh_speed in [0.0, 0.01] {
            for (omega, force) in [(5.6, 50.0), (5.6, -50.0), (1.0, 50.0), (5.6, 0.0)] {
                let pair = GearPair { mesh_speed, force, ..paper(e, omega) };
                for (what, start) in starts(pair.b) {
                    let mirrored = GearPair { force: -force, ..pair };
                    let got = run(&pair, start, 5);
                    // Only elastic impacts without a threshold can exceed the cap.
                    assert!(matches!(got, Ok(_) | Err(Stop::CapEvents)), "{what}: {got:?}, {pair:?}");
                    assert!(got.is_ok() || (e, mesh_speed) == (1.0, 0.0), "{what}: {got:?}, {pair:?}");
                    let image = run(&mirrored, negated(start), 5);
                    assert_eq!(image.map(negated), got, "{what}: {pair:?}");
                }
            }
        }
    }
}

#[test]
fn the_start_and_the_load_determine_the_first_event() {
    let pair = paper(0.5, 5.6);
    let first = |force: f64, start: State| {
        let pair = GearPair { force, ..pair };
        let flow = flow_of(&pair);
        let mut trajectory = Trajectory::new(&flow, pair.law(), start);
        let mut events: Vec<GapEvent> = Vec::new();
        trajectory.advance_to(1e-9, &mut events).expect("an ordinary cell");
        (trajectory.meshing(), events.first().map(|event| event.after[1]))
    };
    for side in Side::BOTH {
        let s = sign(side);
        let b = s * pair.b;
        // F > 0 accelerates gear 1 to the right at phase 0.
        let (pressing, pulling) = (s * 50.0, s * -50.0);
        assert_eq!(first(pressing, state(&[b])), (Some(side), Some(0.0)), "pressed on the wall");
        assert_eq!(first(pulling, state(&[b])), (None, None), "pulled off the wall");
        assert_eq!(first(pressing, state(&[b, s * 3.0])), (None, Some(s * -1.5)), "closing");
        assert_eq!(first(pulling, state(&[b, s * 3.0])), (None, Some(s * -1.5)), "closing");
        assert_eq!(first(pressing, state(&[b, s * -3.0])), (None, None), "opening");
        assert_eq!(first(pulling, state(&[1.2 * b])), (Some(side), None), "behind the wall");
        let (meshing, event) = first(pressing, state(&[b, s * 0.01]));
        assert_eq!((meshing, event), (Some(side), Some(s * -0.005)), "slowly closing, pressed");
        let (meshing, event) = first(pulling, state(&[b, s * 0.01]));
        assert_eq!((meshing, event), (None, Some(s * -0.005)), "slowly closing, pulled");
    }
}

/// The amplitude of gear 1 agrees with the position of the wall to within 64 roundings.
#[test]
fn grazing_motion_gains_no_energy() {
    let pair = GearPair { force: 0.0, r1: 0.0, k2: 0.0, r2: 0.0, ..paper(0.5, 5.6) };
    let speed = (pair.k1 / pair.m1).sqrt() * pair.b;
    for steps in -64..=64 {
        let start = state(&[0.0, speed * (1.0 + f64::from(steps) * f64::EPSILON)]);
        let end = run(&pair, start, 20).expect("a trajectory without a stop");
        let energy = 0.5 * pair.m1 * end[1].powi(2) + 0.5 * pair.k1 * end[0].powi(2);
        assert!(energy < 0.5 * pair.m1 * speed * speed * (1.0 + 1e-12), "the energy has grown: {end:?}");
    }
}

#[test]
fn states_that_are_not_finite_stop_the_trajectory() {
    let pair = paper(0.5, 5.6);
    let flow = flow_of(&pair);
    for start in [state(&[f64::NAN]), state(&[0.0, f64::INFINITY]), state(&[0.0, 0.0, 0.0, f64::NAN])] {
        let mut trajectory = Trajectory::new(&flow, pair.law(), start);
        let ended = trajectory.advance_period(&mut ());
        assert!(matches!(ended, Err(Stop::NonFinite | Stop::CapRoot)), "{start:?}: {ended:?}");
        let steps = trajectory.work().steps;
        assert!(steps < 1_000_000, "{start:?}: {ended:?} after {steps} steps");
    }
}

/// If powers of the rates leave the range of f64, no step can be certified.
#[test]
fn rates_out_of_range_stop_the_trajectory_at_once() {
    for (what, pair) in [
        ("frequency", paper(0.5, 1e80)),
        ("damping", GearPair { r1: 1e70, ..paper(0.5, 1e60) }),
        ("stiffness", GearPair { k1: 1e140, ..paper(0.5, 1e60) }),
    ] {
        let flow = flow_of(&pair);
        let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[0.1, 1.0]));
        let ended = trajectory.advance_period(&mut ());
        assert_eq!(ended, Err(Stop::NonFinite), "{what}");
        assert!(trajectory.work().steps < 1000, "{what}: {:?}", trajectory.work());
    }
}

/// If the rounding error of the displacements exceeds the distance of the walls, there are events on every shortest step. These events must
/// also count.
#[test]
fn events_within_rounding_count_for_the_cap() {
    let pair = GearPair { force: 5e112, b: 0.01, e: 0.0, mesh_speed: 14.0, ..paper(0.0, 0.6) };
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
    let ended = (0..8).try_for_each(|_| trajectory.advance_period(&mut ()));
    assert!(matches!(ended, Ok(()) | Err(Stop::CapEvents)), "{ended:?}");
    assert!(trajectory.work().events <= 8 * (EVENTS_PER_PERIOD_CAP + 1), "{:?}", trajectory.work());
}

/// 60 impacts with `e = 0.5` reduce a speed by the factor `1e18`.
#[test]
fn chatter_ends_at_a_tiny_threshold() {
    for mesh_speed in [1e-6, 1e-8, 1e-9, 1e-10, 1e-12, 1e-15] {
        let pair = GearPair { mesh_speed, ..paper(0.5, 1.5) };
        let flow = flow_of(&pair);
        let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
        let ended = trajectory.advance_period(&mut ());
        assert_eq!(ended, Ok(()), "mesh_speed = {mesh_speed:e}: {:?}", trajectory.work());
        let events = trajectory.work().events;
        assert!(events < 300, "mesh_speed = {mesh_speed:e}: {events} events");
    }
}

/// Both gears come to rest in contact, without a force that presses or pulls.
#[test]
fn resting_on_a_wall_takes_few_steps() {
    let pair = GearPair {
        force: 0.0,
        r1: 0.0,
        r2: 4.8,
        k1: 0.0,
        k2: 0.0,
        r: 0.0,
        e: 0.0,
        omega: 0.3,
        ..paper(0.0, 0.3)
    };
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[0.0, -9.7]));
    for piece in 1..=50 {
        let before = trajectory.work().steps;
        trajectory
            .advance_to(flow.period * f64::from(piece) / 50.0, &mut ())
            .expect("a trajectory without a stop");
        let steps = trajectory.work().steps - before;
        assert!(steps < 10_000, "{steps} steps in 1/50 of a period, {:?}", trajectory.state());
    }
}

/// A slow force presses the gear against the wall. Impacts at a speed of 1e-7 would be 1e8 in one period.
#[test]
fn elastic_chatter_without_a_threshold_stops_at_the_cap() {
    let pair = GearPair { e: 1.0, mesh_speed: 0.0, omega: 0.01, ..paper(1.0, 0.01) };
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[pair.b, -1e-7]));
    let ended = trajectory.advance_period(&mut ());
    assert_eq!(ended, Err(Stop::CapEvents));
    assert!(trajectory.work().events <= EVENTS_PER_PERIOD_CAP + 1);
}

#[test]
fn a_hundred_thousand_periods_do_not_drift() {
    no_drift_until(100_000);
}

#[test]
#[ignore = "half a minute; scripts/test.sh --all"]
fn a_million_periods_do_not_drift() {
    no_drift_until(1_000_000);
}

fn no_drift_until(periods: u64) {
    const CELLS: [(f64, f64); 8] =
        [(0.56, 5.6), (0.2, 4.8), (0.0, 5.6), (0.2, 9.2), (0.56, 3.4), (0.2, 2.5), (0.0, 4.2), (0.5, 11.0)];
    CELLS.par_iter().for_each(|&(e, omega)| {
        let pair = paper(e, omega);
        let flow = flow_of(&pair);
        let early = strobe(&flow, &pair, REST, 10_000).expect("an ordinary cell");
        let late = strobe(&flow, &pair, early, periods - 10_000).expect("an ordinary cell");
        let drift = apart(early, late);
        println!("e = {e}, omega = {omega}: drift {drift:.1e}");
        // Four times the measured value.
        assert!(drift < 1e-13, "e = {e}, omega = {omega}: {early:?} became {late:?}");
    });
}

#[test]
fn extreme_parameters_are_classified() {
    let settings = Settings { transient_periods: 20, observed_periods: 32, max_period: 16 };
    for (what, pair) in extremes() {
        let orbit = analyse(&pair, REST, &settings).unwrap();
        let failed = orbit.class == Class::Failed;
        assert_eq!(orbit.status.code() >= Status::CapEvents.code(), failed, "{what}: {:?}", orbit.status);
        // Only a superstable cycle may have an infinite exponent.
        let superstable = orbit.lyapunov == f64::NEG_INFINITY && orbit.class == Class::Periodic { period: 1 };
        assert!(failed || orbit.lyapunov.is_finite() || superstable, "{what}: {orbit:?}");
        assert!(failed || orbit.strobe.iter().all(|x| x.is_finite()), "{what}");
    }
}

#[test]
fn the_class_does_not_depend_on_the_unit_of_length() {
    for e in [0.06, 0.605, 0.7] {
        let plain = analyse(&paper(e, 5.6), REST, &Settings::default()).unwrap();
        for scale in [1e-100, 1e-17, 1e9] {
            let p = paper(e, 5.6);
            let pair =
                GearPair { force: scale * p.force, b: scale * p.b, mesh_speed: scale * p.mesh_speed, ..p };
            let scaled = analyse(&pair, REST, &Settings::default()).unwrap();
            assert_eq!((scaled.class, scaled.status), (plain.class, plain.status), "{e} {scale:e}");
            if plain.class != Class::Chaotic {
                assert_eq!(scaled.word, plain.word, "{e} {scale:e}");
                assert!((scaled.lyapunov - plain.lyapunov).abs() < 1e-9, "{e} {scale:e}");
            }
        }
    }
}

/// An undamped and nearly elastic pair with a high speed has a hundred thousand impacts in every period.
#[test]
fn a_cell_stops_when_its_allowance_is_spent() {
    let settings = Settings { transient_periods: 20, observed_periods: 12, max_period: 4 };
    let budget = Budget { settings, undecided_periods: 0, ..BUDGET };
    let allowance = budget.allowance();
    let undamped = GearPair { r1: 0.0, r2: 0.0, r: 0.0, ..paper(0.9999, 5.6) };
    let flow = flow_of(&undamped);
    let fast = state(&[0.0, 2.8e5]);
    let measured = measure(&flow, undamped.law(), fast, &budget);
    assert_eq!(measured.status, Status::CapEvents, "{measured:?}");
    assert!(measured.periods_run < budget.periods(), "{measured:?}");
    let mut trajectory = Trajectory::<0>::new(&flow, undamped.law(), fast).allowing(allowance);
    let ended = (0..budget.periods()).try_for_each(|_| trajectory.advance_period(&mut ()));
    assert_eq!(ended, Err(Stop::CapEvents));
    assert_eq!(trajectory.work().events, allowance.events + 1);
    assert_eq!(trajectory.period(), u64::from(measured.periods_run));

    // A light gear oscillates through thousands of radians in a period of a slow force.
    let light = GearPair { m1: 2e-6, ..paper(0.5, 0.004) };
    let flow = flow_of(&light);
    let measured = measure(&flow, light.law(), REST, &budget);
    assert_eq!(measured.status, Status::TooStiff, "{measured:?}");
    let mut trajectory = Trajectory::<0>::new(&flow, light.law(), REST).allowing(allowance);
    let ended = (0..budget.periods()).try_for_each(|_| trajectory.advance_period(&mut ()));
    assert_eq!((ended, trajectory.work().steps), (Err(Stop::TooStiff), allowance.steps + 1));
}

/// After the flag is raised, a cell ends within one period and returns no result.
#[test]
fn a_cell_ends_when_its_flag_is_raised() {
    let pair = paper(0.7, 5.6);
    let flow = flow_of(&pair);
    let settings = Settings { transient_periods: 2_000_000, ..Settings::default() };
    let budget = Budget { settings, early_stop: false, ..BUDGET };
    let halt = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let measured = scope.spawn(|| measure_until(&flow, pair.law(), REST, &budget, &halt));
        std::thread::sleep(Duration::from_millis(50));
        halt.store(true, Ordering::Relaxed);
        let clock = Instant::now();
        assert!(measured.join().unwrap().is_none());
        assert!(clock.elapsed() < Duration::from_secs(1), "{:?}", clock.elapsed());
    });
}
