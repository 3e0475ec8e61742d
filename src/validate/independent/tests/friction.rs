//! Dry friction in the integrator, against closed forms.

use std::f64::consts::PI;

use super::super::machine::Slip;
use super::super::{Strobed, follow};
use super::pairs::{Friction, Rubbing};
use super::*;
use crate::record::{Record, valid};
use rattlemap_dynamics::model::{REST, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Class, Settings, analyse_flow};

const SETTINGS: Settings = Settings { transient_periods: 150, observed_periods: 20, max_period: 4 };

/// Number of oscillators whose cycles are compared.
const CYCLES: usize = 60;

fn element(row: [f64; 2], force: f64, speed: f64) -> Friction {
    Friction { row, force, speed }
}

/// A single mass of 1 on a spring, on rough ground.
fn block(stiffness: f64, friction: f64, speed: f64) -> Rubbing {
    let pair = Pair { free: domain(stiffness, 0.0), ..mass(0.0, NO_WALLS, Contact::Rigid) };
    Rubbing { pair, friction: vec![element([1.0, 0.0], friction, speed)] }
}

/// Integrates within the first period. Times of the result are in the oscillator's units.
fn motion(oscillator: &Oscillator, start: State, until: f64) -> Flight {
    assert!(until <= oscillator.period());
    oscillator.validate().unwrap();
    let mut flight = Flight::new(oscillator, &start);
    flight.advance(0.0, until * oscillator.omega).unwrap();
    flight.events.iter_mut().for_each(|event| event.t /= oscillator.omega);
    flight.slips.iter_mut().for_each(|slip| slip.t /= oscillator.omega);
    flight
}

fn check_slips(slips: &[Slip], expected: &[(Option<u8>, f64)], what: &str) {
    let close = |(slip, (symbol, t)): (&Slip, &(Option<u8>, f64))| {
        slip.symbol == *symbol && (slip.t - t).abs() < 1e-10
    };
    assert!(slips.len() == expected.len() && slips.iter().zip(expected).all(close), "{what}: {slips:?}");
}

fn kinds(flight: &Flight) -> Vec<(EventKind, Side)> {
    flight.events.iter().map(|ended| (ended.kind, ended.side)).collect()
}

fn record_of(oscillator: &Oscillator, start: State) -> Option<Record> {
    let budget = Budget {
        settings: SETTINGS,
        early_stop: false,
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    };
    let halt = std::sync::atomic::AtomicBool::new(false);
    follow(Strobed::new(oscillator, start, &halt), &budget)
}

/// Each half swing is shorter by `2 f / k`, until the spring does not overcome friction at a turning point.
#[test]
fn half_swings_become_shorter_and_end_for_ever() {
    let mut oscillator = block(4.0, 0.48, 0.0);
    oscillator.omega = 0.3;
    let flight = motion(&oscillator.described(Law::both(0.5, 0.0)), state(&[1.0]), 20.0);
    let turns: Vec<_> = [Some(b'0'), Some(b'0'), Some(b'0'), None].into_iter().zip(1..).collect();
    let turns: Vec<_> = turns.into_iter().map(|(symbol, n)| (symbol, 0.5 * PI * f64::from(n))).collect();
    check_slips(&flight.slips, &turns, "half swings");
    assert_near(&flight.state(), &[0.04, 0.0, 0.0, 0.0], 1e-10, "rest");
    assert_eq!(flight.state()[1], 0.0);
    // A force below the friction does not move the mass. This is a cycle without multipliers and events.
    let mut pushed = oscillator;
    (pushed.omega, pushed.force) = (1.0, [0.2, 0.0]);
    let record = record_of(&pushed.described(Law::both(0.5, 0.0)), state(&[1.0])).unwrap();
    assert_eq!((record.period, record.valid & valid::LYAPUNOV), (1, 0));
    assert_eq!(record.strobe[1], 0.0);
}

/// J. P. den Hartog's motion without stops. In the half swing from `x0` at rest to `-x0` at rest, `x - f / k` is a sum of a forced and
/// a free vibration, with `cos(omega t + shift)` in the force.
#[test]
fn steady_motion_without_stops_has_den_hartogs_amplitude() {
    let share = 0.2;
    for r in [0.8f64, 1.25, 1.7] {
        let (v, turn) = (1.0 / (1.0 - r * r), PI / r);
        let u = turn.sin() / (r * (1.0 + turn.cos()));
        let amplitude = (v * v - share * share * u * u).sqrt();
        let (sin, cos) = (-share * u / v, amplitude / v);
        let mut oscillator = block(1.0, share, 0.0);
        (oscillator.omega, oscillator.force, oscillator.force_sin) = (r, [cos, 0.0], [-sin, 0.0]);
        let law = Law::both(0.5, 0.0);
        let flight = motion(&oscillator.described(law), state(&[amplitude]), 0.9 * oscillator.period());
        check_slips(&flight.slips, &[(Some(b'0'), PI / r)], "one turn");
        let (y, _) = run(&oscillator.described(law), state(&[amplitude]), 7.5);
        assert_near(&y[..2], &[-amplitude, 0.0], 1e-9, "half a turn later");
    }
}

/// A belt carries the block until the spring overcomes friction.
#[test]
fn a_belt_carries_a_block_until_it_slips() {
    let mut oscillator = block(4.0, 2.0, 0.5);
    oscillator.omega = 0.5;
    let sticks = 0.5 * 0.25f64.asin();
    let x = 0.5 - (2.0 * sticks).cos();
    let slips = sticks + (0.5 - x) / 0.5;
    let flight = motion(&oscillator.described(Law::both(0.5, 0.0)), state(&[-0.5]), slips + 1.0);
    check_slips(&flight.slips, &[(None, sticks), (Some(b'7'), slips)], "belt");
    let exact = [0.5 + 0.25 * 2f64.sin(), 0.5 * 2f64.cos()];
    assert_near(&flight.state()[..2], &exact, 1e-10, "after the slip");
    // The block can also start at rest on the belt.
    let flight = motion(&oscillator.described(Law::both(0.5, 0.0)), state(&[-0.5, 0.5]), 1.0);
    assert_near(&flight.state(), &[0.0, 0.5, 0.0, 0.0], 1e-13, "on the belt");
}

/// Friction acts against the motion to the floor and away from it.
#[test]
fn an_impact_reverses_sliding() {
    let floor = mass(0.0, [f64::INFINITY, 0.0], Contact::Impact);
    let pair = Pair { omega: 0.5, ..floor };
    let oscillator = Rubbing { pair, friction: vec![element([-2.0, 0.0], 0.25, 0.0)] };
    let flight = motion(&oscillator.described(Law::both(0.8, 0.0)), state(&[1.0, -2.0]), 8.0);
    let (falls, speed) = (2.0 * (2.0 - 3f64.sqrt()), 0.8 * 3f64.sqrt());
    assert_eq!(kinds(&flight), [(EventKind::Impact, Side::Left)]);
    check_slips(&flight.slips, &[(None, falls), (None, falls + 2.0 * speed)], "floor");
    assert_near(&flight.state(), &[speed * speed, 0.0, 0.0, 0.0], 1e-10, "rest");
}

/// A mass hits another one that sticks to the ground.
#[test]
fn an_impact_sets_a_mass_sliding() {
    let oscillator = Rubbing {
        pair: Pair {
            degrees: 2,
            gap: [1.0, -1.0],
            omega: 1.0,
            ..mass(0.0, [0.0, f64::NEG_INFINITY], Contact::Impact)
        },
        friction: vec![element([0.0, 1.0], 0.3, 0.0)],
    };
    let flight = motion(&oscillator.described(Law::both(0.5, 0.0)), state(&[-1.0, 1.0]), 4.0);
    assert_eq!(kinds(&flight), [(EventKind::Impact, Side::Right)]);
    check_slips(&flight.slips, &[(Some(b'7'), 1.0), (None, 3.5)], "hit");
    assert_eq!(flight.slips[0].after, 1);
    assert_near(&flight.state(), &[0.75, 0.25, 0.9375, 0.0], 1e-11, "after the impact");
}

/// A wall carries the load first, and friction carries it afterwards.
#[test]
fn a_rigid_wall_lets_go_before_friction() {
    let floor = mass(-1.0, [f64::INFINITY, 0.0], Contact::Rigid);
    let loaded = |force: f64| Rubbing {
        pair: Pair { omega: 1.0, force_sin: [force, 0.0], ..floor.clone() },
        friction: vec![element([3.0, 0.0], 0.5 / 3.0, 0.0)],
    };
    let law = Law::both(0.5, 0.0);
    let flight = motion(&loaded(3.0).described(law), REST, 1.5);
    let (lets_go, slips) = ((1.0 / 3.0f64).asin(), 0.5f64.asin());
    assert_eq!(kinds(&flight), [(EventKind::MeshStart, Side::Left), (EventKind::MeshEnd, Side::Left)]);
    assert!((flight.events[1].t - lets_go).abs() < 1e-12);
    check_slips(&flight.slips, &[(None, 0.0), (Some(b'7'), slips)], "lifted");
    let dt = 1.5 - slips;
    let v = 3.0 * (slips.cos() - 1.5f64.cos()) - 1.5 * dt;
    let x = 3.0 * (slips.cos() * dt - (1.5f64.sin() - slips.sin())) - 0.75 * dt * dt;
    assert_near(&flight.state()[..2], &[x, v], 1e-11, "lifted");
    // Friction holds while the force is small. At the limit of friction, the wall carries the load again.
    let flight = motion(&loaded(1.2).described(law), REST, TAU);
    let kinds = kinds(&flight);
    assert_eq!(kinds[1..], [(EventKind::MeshEnd, Side::Left), (EventKind::MeshStart, Side::Left)]);
    assert!((flight.events[2].t - (PI - (0.5 / 1.2f64).asin())).abs() < 1e-11, "{:?}", flight.events);
    assert!(flight.slips.iter().all(|slip| slip.symbol.is_none()), "{:?}", flight.slips);
    assert_eq!(flight.state(), REST);
}

/// A mass lies on another one that lies on the ground. Both begin to slide together, and then separately.
#[test]
fn masses_on_each_other_slide_one_after_the_other() {
    let oscillator = Rubbing {
        pair: Pair {
            degrees: 2,
            gap: [0.3, 1.0],
            omega: 1.0,
            force_sin: [2.0, 0.0],
            ..mass(0.0, NO_WALLS, Contact::Rigid)
        },
        friction: vec![element([1.0, 0.0], 0.5, 0.0), element([2.0, -2.0], 0.15, 0.0)],
    };
    let flight = motion(&oscillator.described(Law::both(0.0, 0.0)), REST, 1.2);
    let (both, one) = (0.25f64.asin(), 0.55f64.asin());
    check_slips(&flight.slips, &[(Some(b'7'), both), (Some(b'7'), one)], "stack");
    let v = 0.5 * (2.0 * (both.cos() - one.cos()) - 0.5 * (one - both));
    let dt = 1.2 - one;
    let exact = [v + 2.0 * (one.cos() - 1.2f64.cos()) - 0.8 * dt, v + 0.3 * dt];
    let [_, first, _, second, ..] = flight.state();
    assert_near(&[first, second], &exact, 1e-11, "stack");
}

/// A stage moves a block that sticks.
#[test]
fn a_stage_overcomes_friction() {
    let oscillator = Rubbing {
        pair: Pair {
            stages: vec![stage(0.0, -2.0)],
            schedule: vec![(0.0, 0), (0.25, 1)],
            ..mass(1.0, NO_WALLS, Contact::Rigid)
        },
        friction: vec![element([1.0, 0.0], 1.5, 0.0)],
    };
    let (begins, t) = (0.25 * oscillator.period(), 0.6 * oscillator.period());
    let flight = motion(&oscillator.described(Law::both(0.5, 0.0)), state(&[0.3]), t);
    check_slips(&flight.slips, &[(Some(b'7'), begins)], "stage");
    let dt = t - begins;
    assert_near(&flight.state()[..2], &[0.3 - 0.25 * dt * dt, -0.5 * dt], 1e-12, "stage");
}

/// Cycles with dry friction have periods, words and multipliers of the reference.
#[test]
fn cycles_are_those_of_the_reference() {
    let mut seed = 1u64;
    let mut unit = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut slips = 0;
    for n in 0..CYCLES {
        let mut even = |reach: f64| reach * (2.0 * unit() - 1.0);
        let contact = [Contact::Impact, Contact::Rigid, Contact::Elastic][n % 3];
        let free = Domain {
            damping: [[0.3, 0.05], [0.05, 0.2]],
            stiffness: [[4.0 + even(2.0), -1.0], [-1.0, 6.0 + even(3.0)]],
            load: [even(1.0), even(1.0)],
        };
        let gap = [1.0, [-1.0, 0.4][n % 2]];
        let mut behind = free;
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            behind.stiffness[i][j] += 300.0 * gap[i] * gap[j];
            behind.damping[i][j] += 2.0 * gap[i] * gap[j];
        }
        let wall = 0.2 + even(0.1);
        (0..2).for_each(|i| behind.load[i] += 300.0 * wall * gap[i]);
        let mut friction =
            vec![element([gap, [1.0, 0.0], [even(1.0), 1.0]][n / 2 % 3], 0.2 + even(0.19), 0.0)];
        if n % 3 != 1 && n % 5 == 0 {
            friction.push(element([0.3, 1.2], 0.2 + even(0.19), [0.0, 0.4][n % 2]));
        }
        let oscillator = Rubbing {
            pair: Pair {
                degrees: 2,
                gap,
                omega: 1.8 + even(1.0),
                force: [even(3.0), even(2.0)],
                free,
                meshing: [behind; 2],
                ..mass(0.0, [wall, f64::NEG_INFINITY], contact)
            },
            friction,
        };
        let law = Law::both(0.6, 0.05);
        oscillator.described(law).validate().unwrap();
        let start = state(&[0.1 * wall, 0.2, 0.0, 0.1]);
        let record = record_of(&oscillator.described(law), start).unwrap();
        let orbit = analyse_flow(&Flow::new(oscillator.form(law)), law, start, &SETTINGS, 0);
        assert_eq!(orbit.class, Class::Periodic { period: record.period }, "{n}");
        assert_eq!(record.word().as_ref(), Some(&orbit.word), "{n}");
        let off = record.lyapunov - orbit.lyapunov;
        assert!(record.valid & valid::LYAPUNOV == 0 || off.abs() < 1e-6, "{n}: off by {off:e}");
        slips += orbit.word.symbols().iter().filter(|&&symbol| symbol == b'7').count();
    }
    assert!(slips > 20, "{slips}");
}
