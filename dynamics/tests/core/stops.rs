//! Oscillators between stops, and balls between walls, against closed forms of their events.

use crate::common::events;
use crate::common::linear::{Linear, with_wall};
use crate::common::pairs::AsPair;
use rattlemap_dynamics::model::{Contact, Law, Pair, Side, Stops, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Trajectory};

fn stops(e: f64) -> Stops {
    Stops { m: 1.5, force: 0.0, mesh_speed: 0.0, ..Stops::with_restitution(e) }
}

fn time(flow: &Flow, event: &GapEvent) -> f64 {
    event.period as f64 * flow.period + event.t
}

fn close(got: f64, want: f64, relative: f64) -> bool {
    (got - want).abs() <= relative * want.abs().max(1.0)
}

#[test]
fn an_elastic_free_particle_bounces_with_an_exact_period() {
    let stops = stops(1.0);
    let flow = Flow::new(&stops.pair());
    let speed = 0.7;
    let events = events(&flow, stops.law(), state(&[0.0, speed]), 200);
    assert_eq!(events.len(), ((200.0 * flow.period * speed / stops.b - 1.0) / 2.0) as usize + 1);
    for (n, event) in events.iter().enumerate() {
        let want = (2 * n + 1) as f64 * stops.b / speed;
        let got = time(&flow, event);
        assert!(close(got, want, 1e-14), "impact {n} at {got}, not {want}");
        assert_eq!(event.side, if n % 2 == 0 { Side::Right } else { Side::Left });
        assert_eq!((event.kind, event.after[1]), (EventKind::Impact, -event.before[1]));
        assert_eq!(event.before[1].abs(), speed, "impact {n}");
    }
}

#[test]
fn an_inelastic_free_particle_slows_down_geometrically() {
    for e in [0.2, 0.5, 0.9, 0.999] {
        let stops = stops(e);
        let flow = Flow::new(&stops.pair());
        let events = events(&flow, stops.law(), state(&[0.0, 40.0]), 100);
        assert!(events.len() >= 5, "e = {e}: {} impacts", events.len());
        let (mut t, mut speed) = (stops.b / 40.0, 40.0);
        for event in &events {
            assert!(close(time(&flow, event), t, 1e-13), "e = {e}: {} is not {t}", time(&flow, event));
            assert!(close(event.before[1].abs(), speed, 1e-13), "e = {e}");
            speed *= e;
            t += 2.0 * stops.b / speed;
        }
        assert!(t > 100.0 * flow.period, "e = {e}: the next impact, at {t}, was missed");
    }
}

/// A flight of `x'' = -w^2 x` from wall to wall takes `2 asin(w b / V) / w` with `V` the speed in the middle, and
/// arrives with the speed with which it left.
#[test]
fn a_harmonic_oscillator_between_stops_agrees_with_the_closed_form() {
    for e in [1.0, 0.99, 0.8] {
        let stops = Stops { k: 6.0, m: 1.5, ..stops(e) };
        let w = (stops.k / stops.m).sqrt();
        let flow = Flow::new(&stops.pair());
        let start = 30.0;
        let events = events(&flow, stops.law(), state(&[0.0, start]), 30);
        let mut t = (w * stops.b / start).asin() / w;
        let mut speed = (start * start - (w * stops.b).powi(2)).sqrt();
        // The rounding error of a speed is the rounding error of the energy divided by the speed.
        let fast_enough = events.iter().take_while(|event| event.before[1].abs() > 0.1);
        for (n, event) in fast_enough.enumerate() {
            assert!(
                close(time(&flow, event), t, 1e-12),
                "e = {e}: impact {n}: {} is not {t}",
                time(&flow, event)
            );
            assert!(close(event.before[1].abs(), speed, 1e-12), "e = {e}: impact {n}");
            speed *= e;
            t += 2.0 * (w * stops.b / speed.hypot(w * stops.b)).asin() / w;
        }
        assert!(events.len() > 20, "e = {e}");
    }
}

#[test]
fn a_harmonic_oscillator_reaches_the_wall_at_the_right_speed() {
    let stops = Stops { k: 6.0, m: 1.5, ..stops(0.5) };
    let (w, b) = ((stops.k / stops.m).sqrt(), stops.b);
    let flow = Flow::new(&stops.pair());
    for beyond in [1e-3, 1e-6, 1e-9, 1e-12] {
        let miss = events(&flow, stops.law(), state(&[0.0, w * b * (1.0 - beyond)]), 3);
        assert!(miss.is_empty(), "an impact at {beyond:e} below the speed: {miss:?}");
        let hit = events(&flow, stops.law(), state(&[0.0, w * b * (1.0 + beyond)]), 1);
        assert!(!hit.is_empty(), "no impact at {beyond:e} above the speed");
        // Near grazing the rounding error of the time is large.
        let want = (1.0 / (1.0 + beyond)).asin() / w;
        let rounding = 4.0 * f64::EPSILON / beyond.sqrt();
        assert!((hit[0].t - want).abs() < rounding.max(1e-14), "{beyond:e}: {} is not {want}", hit[0].t);
    }
}

/// Returns a ball under gravity `g` towards the right wall, whose free flights are parabolas. Behind the walls at 0.5
/// and -0.5 there are springs and dampers.
fn ball(g: f64, damping: f64) -> Pair {
    let free = Linear { gamma: 0.0, square: 0.0, force: 0.0, load: g, omega: 1.0 };
    let right = with_wall(free.oscillator(), Side::Right, 0.5, Contact::Impact, [1e4, damping]);
    with_wall(right, Side::Left, -0.5, Contact::Impact, [1e4, damping])
}

/// The flights between impacts last `2 v / g`, each `e` times the one before. The series ends at `2 v / (g (1 - e))`.
#[test]
fn a_bouncing_ball_comes_to_rest_at_the_end_of_the_series() {
    let (g, v) = (2.0, 1.0);
    for e in [0.1, 0.5, 0.6, 0.9, 0.99] {
        // Behind an undamped stop the ball would oscillate and touch the wall again and again.
        let flow = Flow::new(&ball(g, 20.0));
        let law = Law::both(e, 0.0);
        let (scale, top) = (1.0 - e, v * v / (2.0 * g));
        assert!(top < 1.0, "the ball reaches the other wall");
        // With a lower speed the series ends within the period.
        let v = if e > 0.9 { v * scale } else { v };
        let events = events(&flow, law, state(&[0.5, -v]), 4);
        let (mut t, mut speed) = (0.0, v);
        let impacts = events.iter().filter(|event| event.kind == EventKind::Impact).count();
        for event in &events[..impacts] {
            t += 2.0 * speed / g;
            assert!(close(time(&flow, event), t, 1e-13), "e = {e}: {} is not {t}", time(&flow, event));
            assert!((event.before[1] - speed).abs() < 1e-12 * speed, "e = {e}: speed {}", event.before[1]);
            speed *= e;
        }
        let rest = events.get(impacts).unwrap_or_else(|| panic!("e = {e}: the ball does not come to rest"));
        let end = 2.0 * v / (g * scale);
        assert_eq!(rest.kind, EventKind::MeshStart, "e = {e}");
        assert!((time(&flow, rest) - end).abs() < 1e-12 * end, "e = {e}: {} is not {end}", time(&flow, rest));
        assert_eq!(rest.after[..2], [0.5, 0.0], "e = {e}");
        assert_eq!(events.len(), impacts + 1, "e = {e}: {:?}", &events[impacts..]);
    }
}

/// Meshing starts at the first contact whose leaving speed is at or below the mesh speed.
#[test]
fn a_bouncing_ball_meshes_at_the_mesh_speed() {
    let (g, v, e, threshold) = (2.0, 1.0, 0.6, 1e-3);
    let flow = Flow::new(&ball(g, 0.0));
    let law = Law::both(e, threshold);
    let events = events(&flow, law, state(&[0.5, -v]), 3);
    let count = (1..).find(|&n| v * e.powi(n) <= threshold).unwrap() as usize;
    assert!(events[..count - 1].iter().all(|event| event.kind == EventKind::Impact), "{events:?}");
    assert_eq!(events[count - 1].kind, EventKind::MeshStart, "{events:?}");
    // The undamped stop returns the ball with the same speed.
    let end = &events[count];
    assert_eq!(end.kind, EventKind::MeshEnd, "{events:?}");
    assert!((end.before[1] + events[count - 1].after[1].abs()).abs() < 1e-11, "{end:?}");
}

#[test]
fn a_ball_reaches_the_other_wall_at_the_right_speed() {
    let g = 2.0f64;
    let flow = Flow::new(&ball(g, 0.0));
    let law = Law::both(0.5, 0.0);
    let grazing = (2.0 * g).sqrt();
    for beyond in [1e-4, 1e-8, 1e-11, 1e-13] {
        let first = |v: f64| events(&flow, law, state(&[0.5, -v]), 1)[0];
        let hit = first(grazing * (1.0 + beyond));
        assert_eq!(hit.side, Side::Left, "{beyond:e} above the speed: {hit:?}");
        let miss = first(grazing * (1.0 - beyond));
        assert_eq!(miss.side, Side::Right, "{beyond:e} below the speed: {miss:?}");
    }
    // At exactly that speed, `v^2 / (2 g) = 1`, rounding decides between no event and a very slow impact. The flag of
    // near grazing must be set.
    let mut trajectory = Trajectory::new(&flow, law, state(&[0.5, -2.0]));
    let mut events: Vec<GapEvent> = Vec::new();
    trajectory.advance_to(1.5, &mut events).expect("an ordinary cell");
    assert!(trajectory.near_grazing());
    assert!(events.iter().all(|event| event.before[1].abs() < 1e-7), "{events:?}");
    // z = 0.5 - 2 t + t^2
    assert!((trajectory.state()[0] + 0.25).abs() < 1e-7, "{:?}", trajectory.state());
}

/// The jump over an infinite series of impacts must not go beyond the requested time.
#[test]
fn infinite_chatter_stops_at_the_requested_time() {
    let flow = Flow::new(&ball(2.0, 0.0));
    let law = Law::both(0.5, 0.0);
    // The series ends at 2.
    for short in [1e-3, 1e-4, 1e-5, 1e-6] {
        let mut trajectory = Trajectory::new(&flow, law, state(&[0.5, -1.0]));
        trajectory.advance_to(2.0 - short, &mut ()).expect("an ordinary cell");
        assert_eq!(trajectory.time_in_period(), 2.0 - short, "{short:e} before the end of the series");
    }
}

/// The requested times are exact multiples of the step lengths 1.25, 2.5, 5 and 10.
#[test]
fn a_step_may_end_at_the_requested_time() {
    let stops = Stops { m: 1.0, k: 1.0, omega: 0.05, ..stops(0.5) };
    let flow = Flow::new(&stops.pair());
    for goal in [1.25, 2.5, 3.75, 5.0, 8.75, 10.0, 18.75, 28.75, 38.75, 48.75] {
        let mut trajectory = Trajectory::new(&flow, stops.law(), state(&[0.1]));
        trajectory.advance_to(goal, &mut ()).expect("an ordinary cell");
        let off = (trajectory.state()[0] - 0.1 * goal.cos()).abs();
        assert!(off < 1e-14, "off by {off:.1e} at {goal}");
    }
}
