//! Compares the independent integrator with closed forms on every kind of oscillator: one wall, contact without impact,
//! sticking, full mass matrices and gaps of several coordinates.

use crate::common::closed_form::{Linear, Wall, Walled};
use crate::common::pairs::{AsPair, described};
use crate::common::{REST, apart, paper};
use rattlemap::validate::independent::machine::{Event, Flight};
use rattlemap_dynamics::model::{Contact, Domain, Law, Pair, Side, State, state};
use rattlemap_dynamics::motion::EventKind;

/// Time since phase 0 of the first period, kind and wall of each event.
type Events = Vec<(f64, EventKind, usize)>;

/// Integrates some periods with the integrator that judges maps.
fn run(oscillator: &Pair, law: Law, start: State, periods: u32) -> (State, Events) {
    let mut flight = Flight::new(&described(oscillator, law), &start);
    let mut events = Vec::new();
    for n in 0..periods {
        flight.advance(0.0, std::f64::consts::TAU).expect("an ordinary motion");
        let begun = f64::from(n) * oscillator.period();
        let timed = |Event { t, kind, side, .. }| (begun + t / oscillator.omega, kind, side.index());
        events.extend(flight.events.drain(..).map(timed));
    }
    (flight.state(), events)
}

/// Returns the largest difference of event times. Kinds and walls must be equal.
fn time_error(ours: &Events, theirs: &Events) -> f64 {
    let names = |events: &Events| events.iter().map(|&(_, kind, side)| (kind, side)).collect::<Vec<_>>();
    assert_eq!(names(ours), names(theirs), "{ours:?} {theirs:?}");
    ours.iter().zip(theirs).map(|(ours, theirs)| (ours.0 - theirs.0).abs()).fold(0.0, f64::max)
}

/// Checks a motion against its closed form. Returns its events.
fn check(walled: &Walled, start: [f64; 2], periods: u32, what: &str) -> Events {
    let (oscillator, law) = walled.oscillator();
    let (exact, exact_events) = walled.run(start, periods);
    let (end, events) = run(&oscillator, law, state(&start), periods);
    let error = apart(end, state(&exact)).max(time_error(&events, &exact_events));
    assert!(error < 1e-10, "{what}: {error:e}");
    events
}

const FREE: Linear = Linear { m: 1.0, c: 0.1, k: 1.0, force: 1.0, omega: 0.8, load: 0.0 };

#[test]
fn one_wall_and_two_different_walls() {
    let stop = Some(Wall::Rigid { at: 0.3, e: 0.0 });
    let spring = Some(Wall::Elastic { at: -0.2, k: 29.0, c: 0.5 });
    for (walls, what) in [
        ([stop, None], "a stop on the right"),
        ([None, Some(Wall::Rigid { at: -0.7, e: 0.0 })], "a stop on the left"),
        ([None, spring], "a spring on the left"),
        ([stop, spring], "a stop and a spring"),
        ([Some(Wall::Elastic { at: 0.0, k: 4.0, c: 0.0 }), None], "a bilinear spring"),
        ([Some(Wall::Rigid { at: -0.5, e: 0.0 }), None], "a stop that is pressed and sticks"),
    ] {
        let at = walls[0].map_or(0.0, |wall| match wall {
            Wall::Rigid { at, .. } | Wall::Elastic { at, .. } => at,
        });
        let events = check(&Walled { free: FREE, walls }, [at.min(0.0) - 0.1, 0.3], 6, what);
        assert!(events.len() > 4, "{what}: {events:?}");
    }
}

/// A plastic ball on a table that shakes with 1.5 g sticks until the table falls faster than the ball.
#[test]
fn a_mass_sticks_to_a_rigid_wall_until_its_load_changes_sign() {
    let ball = Linear { m: 1.0, c: 0.0, k: 0.0, force: 1.5, omega: 1.0, load: -1.0 };
    let table = Walled { free: ball, walls: [None, Some(Wall::Rigid { at: 0.0, e: 0.0 })] };
    let events = check(&table, [0.0, 0.0], 3, "a plastic ball");
    // At phase 0 the table throws the ball off. Later the ball leaves when the table falls with 1 g.
    let off = events.iter().filter(|(t, kind, _)| *kind == EventKind::MeshEnd && *t > 1.0).map(|(t, ..)| t);
    let phases: Vec<f64> = off.map(|t| (1.5 * t.cos() - 1.0).abs()).collect();
    assert!(phases.len() >= 2 && phases.iter().all(|off| *off < 1e-10), "{phases:?}");
}

/// On a table at rest a ball comes to rest after infinitely many impacts, which take `2 v / (g (1 - e))`.
#[test]
fn a_ball_bounces_infinitely_often_in_finite_time() {
    let ball = Linear { m: 1.0, c: 0.0, k: 0.0, force: 0.0, omega: 1.0, load: -1.0 };
    let table = Walled { free: ball, walls: [None, Some(Wall::Rigid { at: 0.0, e: 0.6 })] };
    let (oscillator, law) = table.oscillator();
    let (state, events) = run(&oscillator, law, state(&[0.0, 0.9]), 2);
    let (t, kind, _) = *events.last().unwrap();
    let rest = 2.0 * 0.9 / (1.0 - 0.6);
    assert!(kind == EventKind::MeshStart && (t - rest).abs() < 1e-6 * rest, "{t} {rest}");
    assert_eq!(state, REST);
    assert!(events.len() > 20);
}

/// Returns the oscillator in coordinates `u` with `x = T u`. The gap, its walls and its events do not change.
fn in_coordinates(o: &Pair, t: [[f64; 2]; 2]) -> Pair {
    let [[a, b], [c, d]] = t;
    let congruent = |m: [[f64; 2]; 2]| {
        let of = |u: [f64; 2], v: [f64; 2]| {
            u[0] * (m[0][0] * v[0] + m[0][1] * v[1]) + u[1] * (m[1][0] * v[0] + m[1][1] * v[1])
        };
        let (first, second) = ([a, c], [b, d]);
        [[of(first, first), of(first, second)], [of(first, second), of(second, second)]]
    };
    let covariant = |f: [f64; 2]| [a * f[0] + c * f[1], b * f[0] + d * f[1]];
    let domain = |domain: &Domain| Domain {
        damping: congruent(domain.damping),
        stiffness: congruent(domain.stiffness),
        load: covariant(domain.load),
    };
    Pair {
        mass: congruent(o.mass),
        gap: covariant(o.gap),
        force: covariant(o.force),
        force_sin: covariant(o.force_sin),
        free: domain(&o.free),
        meshing: [domain(&o.meshing[0]), domain(&o.meshing[1])],
        ..o.clone()
    }
}

/// In the other coordinates the mass matrix is full, and the gap depends on both coordinates.
#[test]
fn motions_do_not_depend_on_the_coordinates() {
    let matrices = [[[1.0, 0.3], [0.0, 1.0]], [[0.4, 2.0], [1.0, 0.7]], [[1.0, 1.0], [1.0, 0.0]]];
    for (e, contacts, what) in [
        (0.6, [Contact::Impact; 2], "impacts"),
        (0.0, [Contact::Impact; 2], "meshing"),
        (0.0, [Contact::Rigid; 2], "sticking"),
        (0.3, [Contact::Elastic, Contact::Rigid], "a soft and a rigid wall"),
        (0.0, [Contact::Elastic; 2], "backlash without impact"),
    ] {
        let pair = paper(e, 5.6);
        let oscillator = Pair { contacts, ..pair.pair() };
        let (end, events) = run(&oscillator, pair.law(), REST, 3);
        assert!(events.len() > 5, "{what}: {events:?}");
        for t in matrices {
            let (other, other_events) = run(&in_coordinates(&oscillator, t), pair.law(), REST, 3);
            let back = [0, 1].map(|i| [0, 1].map(|rate| t[i][0] * other[rate] + t[i][1] * other[2 + rate]));
            let error = apart(end, state(&[back[0][0], back[0][1], back[1][0], back[1][1]]));
            let error = error.max(time_error(&events, &other_events));
            assert!(error < 1e-9, "{what}, {t:?}: {error:e}");
        }
    }
}

#[test]
fn a_start_behind_a_rigid_wall_begins_on_the_wall() {
    let oscillator = Pair { contacts: [Contact::Rigid; 2], ..paper(0.0, 5.6).pair() };
    let start = |oscillator: &Pair| {
        Flight::new(&described(oscillator, Law::both(0.0, 0.0)), &state(&[0.9, 0.0, 0.1]))
    };
    let flight = start(&oscillator);
    let off = apart(flight.state(), state(&[0.6, 0.0, 0.1]));
    assert!(off < 1e-15 && flight.contact(0).is_none(), "{:?}", flight.state());
    let soft = Pair { contacts: [Contact::Elastic; 2], ..oscillator.clone() };
    assert_eq!(start(&soft).contact(0), Some(Side::Right));
}
