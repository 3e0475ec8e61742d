//! Corners of the parameter space: every cell ends, in finite states or in a named stop, and
//! with a bounded amount of work.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::common::{REST, apart, flow_of, negated, paper, sign, strobe, work_since};
use rattlemap_dynamics::model::{GearPair, Side, State};
use rattlemap_dynamics::orbit::{Budget, Class, Settings, Status, analyse, measure, measure_until};
use rattlemap_dynamics::reference::{EVENTS_PER_PERIOD_CAP, GapEvent, Stop, Trajectory, Work};
use rayon::prelude::*;

/// Steps a period may take, besides those for its events: several per radian of the fastest
/// oscillation that the teeth or the supports can make.
fn step_budget(pair: &GearPair, work: Work) -> f64 {
    let p = pair;
    let by_mass = 1.0 / p.m1 + 1.0 / p.m2;
    let stiffness = (p.k1 / p.m1).max(p.k2 / p.m2) + p.k * by_mass;
    let damping = (p.r1 / p.m1).max(p.r2 / p.m2) + p.r * by_mass;
    let rate = stiffness.sqrt() + damping + p.omega;
    let period = std::f64::consts::TAU / p.omega;
    // A graze costs the halvings down to rounding, and more than one may lie in a period.
    400.0 + 8.0 * rate * period + 60.0 * work.events as f64
}

/// Runs a cell, checks every period, and says how it ended.
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

/// One extreme at a time, and some together.
fn extremes() -> Vec<(&'static str, GearPair)> {
    let p = paper(0.5, 5.6);
    vec![
        ("perfectly plastic", GearPair { e: 0.0, ..p }),
        ("elastic", GearPair { e: 1.0, ..p }),
        ("nearly elastic, slow", GearPair { e: 0.999, omega: 1.0, ..p }),
        ("elastic, slow", GearPair { e: 1.0, omega: 1.0, ..p }),
        ("no threshold", GearPair { e: 0.3, mesh_speed: 0.0, ..p }),
        ("no threshold, slow", GearPair { e: 0.3, mesh_speed: 0.0, omega: 1.0, ..p }),
        ("no threshold, lively", GearPair { e: 0.9, mesh_speed: 0.0, ..p }),
        ("no threshold, lively and slow", GearPair { e: 0.9, mesh_speed: 0.0, omega: 1.0, ..p }),
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
        ("mesh of nothing", GearPair { k: 0.0, r: 0.0, e: 0.0, ..p }),
        ("heavily damped mesh", GearPair { r: 1e4, e: 0.0, ..p }),
        ("no force", GearPair { force: 0.0, ..p }),
        ("strong force", GearPair { force: 1e6, ..p }),
        ("strong force, elastic", GearPair { force: 1e6, e: 1.0, ..p }),
        ("strong force, plastic, stiff", GearPair { force: 1e6, e: 0.0, k: 1e6, ..p }),
        ("strong force the other way", GearPair { force: -1e6, ..p }),
        ("next to no backlash", GearPair { b: 1e-9, ..p }),
        ("next to no backlash, plastic", GearPair { b: 1e-9, e: 0.0, ..p }),
        ("next to no backlash, lively", GearPair { b: 1e-9, e: 0.9, ..p }),
        ("very slow forcing", GearPair { omega: 1e-3, ..p }),
        ("very slow forcing, plastic", GearPair { omega: 1e-3, e: 0.0, ..p }),
        ("very slow forcing, stiff", GearPair { omega: 1e-2, e: 0.0, k: 1e6, ..p }),
        ("very fast forcing", GearPair { omega: 1e3, ..p }),
        ("very fast and strong forcing", GearPair { omega: 1e3, force: 1e6, ..p }),
        ("no supports", GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, ..p }),
        ("no supports, no threshold", GearPair { k1: 0.0, k2: 0.0, r1: 0.0, r2: 0.0, mesh_speed: 0.0, ..p }),
        ("nothing damped, elastic", GearPair { r1: 0.0, r2: 0.0, r: 0.0, e: 1.0, ..p }),
        ("resonance without damping", GearPair { r1: 0.0, r2: 0.0, k1: 32.0, omega: 4.0, ..p }),
        ("light against heavy", GearPair { m1: 1e-3, m2: 1e3, ..p }),
        ("heavy against light", GearPair { m1: 1e3, m2: 1e-3, e: 0.1, ..p }),
    ]
}

#[test]
fn every_extreme_ends_with_bounded_work() {
    for (what, pair) in extremes() {
        println!("{what}: {:?}", run(&pair, REST, 30));
    }
}

/// Starts where the law of contact has to decide first.
fn starts(b: f64) -> Vec<(&'static str, State)> {
    vec![
        ("on the wall, at rest", [b, 0.0, 0.0, 0.0]),
        ("on the wall, closing", [b, 1.0, 0.0, 0.0]),
        ("on the wall, closing at next to nothing", [b, 1e-300, 0.0, 0.0]),
        ("on the wall, opening", [b, -1.0, 0.0, 0.0]),
        ("on the wall, opening at next to nothing", [b, -1e-300, 0.0, 0.0]),
        ("beyond the wall, at rest", [1.5 * b, 0.0, 0.0, 0.0]),
        ("beyond the wall, closing", [1.5 * b, 3.0, 0.0, 0.0]),
        ("beyond the wall, opening", [1.5 * b, -3.0, 0.0, 0.0]),
        ("beyond the wall by a rounding", [b * (1.0 + f64::EPSILON), 0.0, 0.0, 0.0]),
        ("beyond the wall by a rounding, opening", [b * (1.0 + f64::EPSILON), -1.0, 0.0, 0.0]),
        ("short of the wall by a rounding", [b * (1.0 - f64::EPSILON), 0.0, 0.0, 0.0]),
        ("short of the wall by a rounding, closing", [b * (1.0 - f64::EPSILON), 1.0, 0.0, 0.0]),
        ("far beyond the wall", [50.0 * b, 0.0, -50.0 * b, 0.0]),
        ("very fast", [0.0, 1e4, 0.0, -1e4]),
    ]
}

#[test]
fn every_start_is_taken_up() {
    for e in [0.0, 0.5, 1.0] {
        for mesh_speed in [0.0, 0.01] {
            for (omega, force) in [(5.6, 50.0), (5.6, -50.0), (1.0, 50.0), (5.6, 0.0)] {
                let pair = GearPair { mesh_speed, force, ..paper(e, omega) };
                for (what, start) in starts(pair.b) {
                    let mirrored = GearPair { force: -force, ..pair };
                    let got = run(&pair, start, 5);
                    // Elastic taps at next to no speed and without a threshold never end.
                    assert!(matches!(got, Ok(_) | Err(Stop::CapEvents)), "{what}: {got:?}, {pair:?}");
                    assert!(got.is_ok() || (e, mesh_speed) == (1.0, 0.0), "{what}: {got:?}, {pair:?}");
                    // The mirror image of start and force: the left wall is treated the same.
                    let image = run(&mirrored, negated(start), 5);
                    assert_eq!(image.map(negated), got, "{what}: {pair:?}");
                }
            }
        }
    }
}

/// Where a start belongs, by the rules for starts.
#[test]
fn starts_obey_their_rules() {
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
        // F > 0 pushes gear 1 to the right at phase 0.
        let (pressing, pulling) = (s * 50.0, s * -50.0);
        assert_eq!(first(pressing, [b, 0.0, 0.0, 0.0]), (Some(side), Some(0.0)), "pressed on the wall");
        assert_eq!(first(pulling, [b, 0.0, 0.0, 0.0]), (None, None), "pulled off the wall");
        assert_eq!(first(pressing, [b, s * 3.0, 0.0, 0.0]), (None, Some(s * -1.5)), "closing");
        assert_eq!(first(pulling, [b, s * 3.0, 0.0, 0.0]), (None, Some(s * -1.5)), "closing");
        assert_eq!(first(pressing, [b, s * -3.0, 0.0, 0.0]), (None, None), "opening");
        assert_eq!(first(pulling, [1.2 * b, 0.0, 0.0, 0.0]), (Some(side), None), "beyond the wall");
        let (meshing, event) = first(pressing, [b, s * 0.01, 0.0, 0.0]);
        assert_eq!((meshing, event), (Some(side), Some(s * -0.005)), "slowly closing, pressed");
        let (meshing, event) = first(pulling, [b, s * 0.01, 0.0, 0.0]);
        assert_eq!((meshing, event), (None, Some(s * -0.005)), "slowly closing, pulled");
    }
}

/// Starts that touch the far wall exactly, to rounding, or just not.
#[test]
fn grazing_starts_end() {
    // No force, no support: gear 1 flies straight, and a spring turns it at the wall.
    let pair = GearPair { force: 0.0, r1: 0.0, k2: 0.0, r2: 0.0, ..paper(0.5, 5.6) };
    let speed = (pair.k1 / pair.m1).sqrt() * pair.b;
    for steps in -64..=64 {
        let start = [0.0, speed * (1.0 + f64::from(steps) * f64::EPSILON), 0.0, 0.0];
        let end = run(&pair, start, 20).expect("grazing ends");
        let energy = 0.5 * pair.m1 * end[1].powi(2) + 0.5 * pair.k1 * end[0].powi(2);
        assert!(energy < 0.5 * pair.m1 * speed * speed * (1.0 + 1e-12), "energy from nowhere: {end:?}");
    }
}

/// What is not finite is said so, and soon.
#[test]
fn states_that_are_not_finite_are_named() {
    let pair = paper(0.5, 5.6);
    let flow = flow_of(&pair);
    for start in [[f64::NAN, 0.0, 0.0, 0.0], [0.0, f64::INFINITY, 0.0, 0.0], [0.0, 0.0, 0.0, f64::NAN]] {
        let mut trajectory = Trajectory::new(&flow, pair.law(), start);
        let ended = trajectory.advance_period(&mut ());
        assert!(matches!(ended, Err(Stop::NonFinite | Stop::CapRoot)), "{start:?}: {ended:?}");
        let steps = trajectory.work().steps;
        assert!(steps < 1_000_000, "{start:?}: {ended:?} only after {steps} steps");
    }
}

/// Where powers of the rates leave the range of f64 no step can be certified: that is said at
/// once, and not after as many steps as a period may have.
#[test]
fn rates_out_of_range_are_named_at_once() {
    for (what, pair) in [
        ("frequency", paper(0.5, 1e80)),
        ("damping", GearPair { r1: 1e70, ..paper(0.5, 1e60) }),
        ("stiffness", GearPair { k1: 1e140, ..paper(0.5, 1e60) }),
    ] {
        let flow = flow_of(&pair);
        let mut trajectory = Trajectory::new(&flow, pair.law(), [0.1, 1.0, 0.0, 0.0]);
        let ended = trajectory.advance_period(&mut ());
        assert_eq!(ended, Err(Stop::NonFinite), "{what}");
        assert!(trajectory.work().steps < 1000, "{what}: {:?}", trajectory.work());
    }
}

/// Motion so large that the walls' distance is less than its rounding meets them on every
/// shortest step: those events, too, are counted against the cap.
#[test]
fn events_within_rounding_are_capped() {
    let pair = GearPair { force: 5e112, b: 0.01, e: 0.0, mesh_speed: 14.0, ..paper(0.0, 0.6) };
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
    let ended = (0..8).try_for_each(|_| trajectory.advance_period(&mut ()));
    assert!(matches!(ended, Ok(()) | Err(Stop::CapEvents)), "{ended:?}");
    assert!(trajectory.work().events <= 8 * (EVENTS_PER_PERIOD_CAP + 1), "{:?}", trajectory.work());
}

/// However small the threshold, chatter reaches it: 60 impacts halve a speed by `1e18`.
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

/// Teeth that come to rest on a wall, with nothing to press or pull them, rest there: a gear
/// coasts to a stop, the other on its flank.
#[test]
fn resting_on_a_wall_is_no_work() {
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
    let mut trajectory = Trajectory::new(&flow, pair.law(), [0.0, -9.7, 0.0, 0.0]);
    for piece in 1..=50 {
        let before = trajectory.work().steps;
        trajectory
            .advance_to(flow.period * f64::from(piece) / 50.0, &mut ())
            .expect("rest is no reason to stop");
        let steps = trajectory.work().steps - before;
        assert!(steps < 10_000, "{steps} steps in 1/50 of a period, {:?}", trajectory.state());
    }
}

/// Chatter without end in a named stop, not in an endless loop: elastic, pressed, and no
/// threshold to mesh at.
#[test]
fn elastic_chatter_without_a_threshold_is_bounded() {
    // Sustained on the right wall by a slow force, tapping it at 1e-7: 1e8 impacts a period.
    let pair = GearPair { e: 1.0, mesh_speed: 0.0, omega: 0.01, ..paper(1.0, 0.01) };
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), [pair.b, -1e-7, 0.0, 0.0]);
    let ended = trajectory.advance_period(&mut ());
    assert_eq!(ended, Err(Stop::CapEvents));
    assert!(trajectory.work().events <= EVENTS_PER_PERIOD_CAP + 1);
}

/// A hundred thousand periods on stable cells leave no trace: the strobe state is that of 10^4.
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
        // Measurement 2.5e-14; four times that.
        assert!(drift < 1e-13, "e = {e}, omega = {omega}: {early:?} became {late:?}");
    });
}

#[test]
fn every_extreme_is_analysed() {
    let settings = Settings { transient_periods: 20, observed_periods: 32, max_period: 16 };
    for (what, pair) in extremes() {
        let orbit = analyse(&pair, REST, &settings).unwrap();
        let failed = orbit.class == Class::Failed;
        assert_eq!(orbit.status.code() >= Status::CapEvents.code(), failed, "{what}: {:?}", orbit.status);
        // A superstable cycle has minus infinity; nothing else is without an exponent.
        let superstable = orbit.lyapunov == f64::NEG_INFINITY && orbit.class == Class::Periodic { period: 1 };
        assert!(failed || orbit.lyapunov.is_finite() || superstable, "{what}: {orbit:?}");
        assert!(failed || orbit.strobe.iter().all(|x| x.is_finite()), "{what}");
    }
}

#[test]
fn answers_do_not_depend_on_the_unit_of_length() {
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

/// Undamped and nearly elastic, a pair keeps what speed it starts with: a hundred thousand impacts in every period.
#[test]
fn a_cell_may_take_so_much_and_no_more() {
    let settings = Settings { transient_periods: 20, observed_periods: 12, max_period: 4 };
    let budget =
        Budget { settings, early_stop: true, undecided_periods: 0, exponent: true, shows_exponent: true };
    let allowance = budget.allowance();
    let undamped = GearPair { r1: 0.0, r2: 0.0, r: 0.0, ..paper(0.9999, 5.6) };
    let flow = flow_of(&undamped);
    let fast = [0.0, 2.8e5, 0.0, 0.0];
    let measured = measure(&flow, undamped.law(), fast, &budget);
    assert_eq!(measured.status, Status::CapEvents, "{measured:?}");
    assert!(measured.periods_run < budget.periods(), "{measured:?}");
    // By hand it takes as many events, and one.
    let mut trajectory = Trajectory::<0>::new(&flow, undamped.law(), fast).allowing(allowance);
    let ended = (0..budget.periods()).try_for_each(|_| trajectory.advance_period(&mut ()));
    assert_eq!(ended, Err(Stop::CapEvents));
    assert_eq!(trajectory.work().events, allowance.events + 1);
    assert_eq!(trajectory.period(), u64::from(measured.periods_run));

    // A light gear turns thousands of radians in a period of a slow force.
    let light = GearPair { m1: 2e-6, ..paper(0.5, 0.004) };
    let flow = flow_of(&light);
    let measured = measure(&flow, light.law(), REST, &budget);
    assert_eq!(measured.status, Status::TooStiff, "{measured:?}");
    let mut trajectory = Trajectory::<0>::new(&flow, light.law(), REST).allowing(allowance);
    let ended = (0..budget.periods()).try_for_each(|_| trajectory.advance_period(&mut ()));
    assert_eq!((ended, trajectory.work().steps), (Err(Stop::TooStiff), allowance.steps + 1));
}

/// Whoever raises the flag waits for a period at most, and has no answer.
#[test]
fn a_cell_ends_when_it_is_told_to() {
    let pair = paper(0.7, 5.6);
    let flow = flow_of(&pair);
    let settings = Settings { transient_periods: 2_000_000, ..Settings::default() };
    let budget =
        Budget { settings, early_stop: false, undecided_periods: 0, exponent: true, shows_exponent: true };
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
