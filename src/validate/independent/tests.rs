//! Harmonics and stages in the integrator, against closed forms.

mod friction;
#[path = "../../../dynamics/tests/common/pairs.rs"]
#[allow(dead_code, reason = "tests of the engines use the rest")]
mod pairs;

use std::f64::consts::TAU;

use nalgebra::{Complex, Matrix2, Vector2};

use super::machine::{Event, Flight};
use pairs::described;
use rattlemap_dynamics::model::{
    Contact, Domain, Harmonic, Law, Oscillator, Pair, REST, Side, Stage, State, state,
};
use rattlemap_dynamics::motion::EventKind;

const NO_WALLS: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// A mass of 1 without springs, under a constant load. Springs behind walls have no stiffness.
fn mass(load: f64, walls: [f64; 2], contact: Contact) -> Pair {
    let free = domain(0.0, load);
    Pair {
        degrees: 1,
        mass: [[1.0, 0.0], [0.0, 1.0]],
        gap: [1.0, 0.0],
        walls,
        contacts: [contact; 2],
        omega: 2.0,
        force: [0.0; 2],
        force_sin: [0.0; 2],
        free,
        meshing: [free; 2],
        harmonics: Vec::new(),
        stages: Vec::new(),
        schedule: Vec::new(),
    }
}

fn domain(stiffness: f64, load: f64) -> Domain {
    Domain { damping: [[0.0; 2]; 2], stiffness: [[stiffness, 0.0], [0.0, 0.0]], load: [load, 0.0] }
}

fn stage(stiffness: f64, load: f64) -> Stage {
    Stage { free: domain(stiffness, load), meshing: [domain(stiffness, load); 2] }
}

/// Integrates some periods and a part of the next one. Returns the state, and the events of the last period.
fn run(oscillator: &Oscillator, start: State, turns: f64) -> (State, Vec<Event>) {
    oscillator.validate().unwrap();
    let mut flight = Flight::new(oscillator, &start);
    let mut left = turns;
    loop {
        flight.events.clear();
        flight.advance(0.0, left.min(1.0) * TAU).unwrap();
        left -= 1.0;
        if left <= 0.0 {
            return (flight.state(), flight.events);
        }
    }
}

fn assert_near(ours: &[f64], exact: &[f64], within: f64, what: &str) {
    let off = ours.iter().zip(exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < within, "{what}: off by {off:e}, {ours:?} {exact:?}");
}

/// The steady response to each harmonic solves `(K - w^2 M + i w C) X = cos - i sin` with `w = order omega`.
#[test]
fn the_response_to_three_harmonics_is_that_of_the_closed_form() {
    let free =
        Domain { damping: [[1.1, -0.3], [-0.3, 0.8]], stiffness: [[9.0, -2.0], [-2.0, 5.0]], load: [0.0; 2] };
    let further = |order, cos, sin| Harmonic { order, cos, sin };
    let oscillator = Pair {
        degrees: 2,
        mass: [[2.0, 0.3], [0.3, 1.0]],
        gap: [1.0, -1.0],
        force: [3.0, -1.5],
        force_sin: [-2.0, 4.0],
        free,
        meshing: [free; 2],
        harmonics: vec![further(2, [1.0, 2.0], [0.5, 0.0]), further(7, [-9.0, 4.0], [30.0, 8.0])],
        ..mass(0.0, NO_WALLS, Contact::Rigid)
    };
    let steady = |t: f64| {
        let mut y = REST;
        for Harmonic { order, cos, sin } in oscillator.all_harmonics() {
            let w = f64::from(order) * oscillator.omega;
            let impedance = Matrix2::from_fn(|i, j| {
                Complex::new(free.stiffness[i][j] - w * w * oscillator.mass[i][j], w * free.damping[i][j])
            });
            let force = Vector2::from_fn(|i, _| Complex::new(cos[i], -sin[i]));
            let x = impedance.try_inverse().unwrap() * force * Complex::new(0.0, w * t).exp();
            for i in 0..2 {
                y[2 * i] += x[i].re;
                y[2 * i + 1] += (Complex::new(0.0, w) * x[i]).re;
            }
        }
        y
    };
    for turns in [0.13, 0.5, 1.0, 3.77] {
        let (y, _) = run(&described(&oscillator, Law::both(0.5, 0.0)), steady(0.0), turns);
        assert_near(&y, &steady(turns * oscillator.period()), 1e-10, "three harmonics");
    }
}

/// Returns the state of `x'' + k x = 0` after a time.
fn oscillated([x, v]: [f64; 2], k: f64, t: f64) -> [f64; 2] {
    let w = k.sqrt();
    let (sin, cos) = (w * t).sin_cos();
    [x * cos + v / w * sin, v * cos - x * w * sin]
}

/// Meissner's equation: the stiffness alternates between two values.
#[test]
fn a_stiffness_that_alternates_is_integrated_piece_by_piece() {
    // Number of repetitions of the list of stiffnesses and of the turns for which each of them holds.
    type Pieces = &'static [(f64, f64)];
    type Changes = &'static [(f64, usize)];
    let cases: [(Changes, u32, Pieces); 4] = [
        (&[(0.0, 1), (0.4, 0)], 3, &[(11.0, 0.4), (3.0, 0.6)]),
        (&[(0.25, 1), (0.7, 0)], 3, &[(3.0, 0.25), (11.0, 0.45), (3.0, 0.3)]),
        (&[(0.25, 1), (0.7, 1), (0.9, 0)], 1, &[(3.0, 0.25), (11.0, 0.55)]),
        (&[(0.3, 1)], 2, &[(11.0, 1.0)]),
    ];
    for (schedule, repeat, pieces) in cases {
        let oscillator = Pair {
            free: domain(3.0, 0.0),
            stages: vec![stage(11.0, 0.0)],
            schedule: schedule.to_vec(),
            ..mass(0.0, NO_WALLS, Contact::Rigid)
        };
        let pass = |y: [f64; 2], &(k, turns): &(f64, f64)| oscillated(y, k, turns * oscillator.period());
        let exact = (0..repeat).fold([0.2, 0.7], |y, _| pieces.iter().fold(y, pass));
        let turns = f64::from(repeat) * pieces.iter().map(|(_, turns)| turns).sum::<f64>();
        let (y, _) = run(&described(&oscillator, Law::both(0.5, 0.0)), state(&[0.2, 0.7]), turns);
        assert_near(&y[..2], &exact, 1e-10, &format!("{schedule:?}"));
    }
}

/// Checks kinds and times of events, in turns, on the left wall.
fn check_events(events: &[Event], expected: &[(EventKind, f64)]) {
    assert_eq!(events.len(), expected.len(), "{events:?}");
    for (event, (kind, turns)) in events.iter().zip(expected) {
        let off = event.t / TAU - turns;
        assert!(event.kind == *kind && event.side == Side::Left && off.abs() < 1e-12, "{event:?}, {turns}");
    }
}

/// A mass rests on the floor until a stage lifts it with the acceleration 2. In the next stage it falls with the acceleration 20. It rises
/// by `h = 2 (0.3 T)^2 / 2` and has the speed `v = 2 (0.3 T)` then; it reaches the floor `(v + sqrt(v^2 + 40 h)) / 20` later.
#[test]
fn a_stage_releases_a_mass_at_rest() {
    let floor = mass(-20.0, [f64::INFINITY, 0.0], Contact::Rigid);
    let falls = (0.6 + (0.36f64 + 40.0 * 0.09).sqrt()) / 20.0;
    for (lifts, expected) in [
        (0.3, vec![(EventKind::MeshEnd, 0.3), (EventKind::MeshStart, 0.6 + falls)]),
        (0.0, vec![(EventKind::MeshStart, 0.3 + falls), (EventKind::MeshEnd, 1.0)]),
    ] {
        let schedule = vec![(lifts, 1), (lifts + 0.3, 0)];
        let oscillator = Pair { stages: vec![stage(0.0, 2.0)], schedule, ..floor.clone() };
        let (y, events) = run(&described(&oscillator, Law::both(0.0, 0.0)), REST, 3.0);
        check_events(&events, &expected);
        assert_eq!(y[..2], [0.0; 2]);
    }
}

/// The force at phase 0 is 0. If it then presses, a gap at rest stays on the wall; with the other sign the gap leaves.
#[test]
fn derivatives_of_the_force_decide_about_rest() {
    for (force_sin, stays) in [(-1.0, true), (1.0, false)] {
        let oscillator = Pair {
            force_sin: [force_sin, 0.0],
            stages: vec![stage(0.0, 0.0)],
            schedule: vec![(0.0, 1), (0.4, 0)],
            ..mass(-20.0, [f64::INFINITY, 0.0], Contact::Rigid)
        };
        let (_, events) = run(&described(&oscillator, Law::both(0.0, 0.0)), REST, 2.0);
        let expected: &[_] = if stays { &[] } else { &[(EventKind::MeshEnd, 1.0)] };
        let at_end: Vec<_> = events.into_iter().filter(|event| event.t > 0.99 * TAU).collect();
        check_events(&at_end, expected);
    }
}

/// A mass reaches the floor at 0.2 turns with the speed `v` and leaves it with `v / 2`. A stage ends the contact onset at 0.25
/// turns, and lifts the mass.
#[test]
fn a_stage_ends_a_contact_onset() {
    let floor = mass(-1.0, [f64::INFINITY, 0.0], Contact::Impact);
    let schedule = vec![(0.0, 0), (0.25, 1), (0.9, 0)];
    let oscillator = Pair { stages: vec![stage(0.0, 3.0)], schedule, ..floor };
    let period = oscillator.period();
    let (fall, onset, rise, last) = (0.2 * period, 0.05 * period, 0.65 * period, 0.1 * period);
    let (v, h) = (fall, 0.5 * fall * fall);
    let (y, events) = run(&described(&oscillator, Law::both(0.5, 10.0)), state(&[h]), 1.0);
    check_events(&events, &[(EventKind::MeshStart, 0.2), (EventKind::MeshEnd, 0.25)]);
    let moved = |[x, v]: [f64; 2], load: f64, t: f64| [x + v * t + 0.5 * load * t * t, v + load * t];
    let exact = moved(moved(moved([0.0, 0.5 * v], -1.0, onset), 3.0, rise), -1.0, last);
    assert_near(&y[..2], &exact, 1e-11, "after the onset");
    // In a stage that presses the mass, the onset goes on.
    let pressed = Pair { stages: vec![stage(0.0, -3.0)], ..oscillator };
    let (_, events) = run(&described(&pressed, Law::both(0.5, 10.0)), state(&[h]), 0.3);
    check_events(&events, &[(EventKind::MeshStart, 0.2)]);
}
