//! Elastic walls that only push, and walls with a preload.

use crate::common::linear::{Linear, with_law, with_wall};
use crate::common::near;
use crate::common::pairs::described;
use rattlemap_dynamics::model::{Contact, Law, Oscillator, Side, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{EventKind, GapEvent, Stop, Trajectory};

const LAW: Law = Law { restitution: [0.5; 2], mesh_speed: [0.01; 2] };

fn both_walls(free: Linear, at: f64, contact: Contact, spring: [f64; 2], preload: Option<f64>) -> Oscillator {
    let wall = |o, side: Side| with_wall(o, side, side.sign() * at, Contact::Elastic, spring);
    let walled = described(&Side::BOTH.into_iter().fold(free.oscillator(), wall), LAW);
    Side::BOTH.into_iter().fold(walled, |o, side| with_law(o, side, contact, preload))
}

/// An inertia of 5 kg m^2 behind a backlash of 45 degrees with a spring and a damper, released at 90 degrees, as in the Modelica library's
/// example of backlash. The values at 1 s come from an integrator of order 8 that switches at the events.
#[test]
fn backlash_that_does_not_pull_has_the_published_trace() {
    let still = Linear { gamma: 0.0, square: 0.0, force: 0.0, load: 0.0, omega: std::f64::consts::TAU };
    for (contact, expected) in
        [(Contact::Pushing, [0.10348, -6.21340]), (Contact::Elastic, [0.36518, -5.41207])]
    {
        let spring = [20_000.0 / 5.0, 50.0 / 5.0];
        let flow = Flow::new(&both_walls(still, std::f64::consts::FRAC_PI_8, contact, spring, None));
        let mut trajectory = Trajectory::<0>::new(&flow, LAW, state(&[std::f64::consts::FRAC_PI_2]));
        trajectory.advance_period(&mut ()).unwrap();
        let [x, v, ..] = trajectory.state();
        assert!(near(x, expected[0], 1e-5) && near(v, expected[1], 1e-5), "{contact:?}: {x} {v}");
    }
}

/// A mass between walls whose force is the preload alone flies freely between them. Behind a wall it turns around, and returns to the wall
/// after the time `2 w / preload` with the same speed. All times and states are sums of these terms.
#[test]
fn a_constant_force_returns_the_mass_with_its_speed() {
    let still = Linear { gamma: 0.0, square: 0.0, force: 0.0, load: 0.0, omega: 0.25 };
    for contact in [Contact::Elastic, Contact::Pushing] {
        let flow = Flow::new(&both_walls(still, 0.5, contact, [0.0, 0.0], Some(4.0)));
        let mut events: Vec<GapEvent> = Vec::new();
        let units = [state(&[1.0]), state(&[0.0, 1.0])];
        let mut trajectory = Trajectory::with_tangents(&flow, LAW, state(&[0.0, 3.0]), units);
        trajectory.advance_to(3.0, &mut events).unwrap();
        // From 0 to the right wall, behind it, to the left wall, and so on.
        let (crosses, turns) = (1.0 / 3.0, 2.0 * 3.0 / 4.0);
        let times = [0.5 * crosses, 0.5 * crosses + turns, 1.5 * crosses + turns];
        let kinds = [EventKind::MeshStart, EventKind::MeshEnd, EventKind::MeshStart];
        for ((event, time), kind) in events.iter().zip(times).zip(kinds) {
            assert!(event.kind == kind && near(event.t, time, 1e-14), "{event:?} at {time}");
        }
        let inside = 3.0 - times[2];
        let [x, v, ..] = trajectory.state();
        assert!(
            near(x, -0.5 - 3.0 * inside + 2.0 * inside * inside, 1e-14)
                && near(v, -3.0 + 4.0 * inside, 1e-14)
        );
        // A faster mass is earlier at the walls and stays longer behind them; a shift of the start changes the time alone.
        let speed = 3.0;
        let by_speed = |dx: f64, dv: f64| {
            // Time of the last event as a function of the start.
            let later = -dx / speed + dv * (-1.5 / speed / speed + 2.0 / 4.0);
            [-dv * inside + (speed - 4.0 * inside) * later, -dv - 4.0 * later]
        };
        for (tangent, expected) in
            trajectory.tangents().into_iter().zip([by_speed(1.0, 0.0), by_speed(0.0, 1.0)])
        {
            let is_near = near(tangent[0], expected[0], 1e-13) && near(tangent[1], expected[1], 1e-13);
            assert!(is_near, "{tangent:?} {expected:?}");
        }
    }
}

/// Rest on a wall under a load below the preload is an infinite series of contacts.
#[test]
fn rest_under_a_load_below_the_preload_ends() {
    let pressed = Linear { gamma: 0.1, square: 0.0, force: 0.0, load: 1.0, omega: 1.0 };
    for contact in [Contact::Elastic, Contact::Pushing] {
        let walled = with_wall(pressed.oscillator(), Side::Right, 0.5, Contact::Elastic, [10.0, 1.0]);
        let end = |preload: f64, start: f64| {
            let flow = Flow::new(&with_law(described(&walled, LAW), Side::Right, contact, Some(preload)));
            let mut trajectory = Trajectory::<0>::new(&flow, LAW, state(&[start]));
            (0..20).try_for_each(|_| trajectory.advance_period(&mut ())).map(|()| trajectory.state()[0])
        };
        assert_eq!(end(2.0, 0.5), Err(Stop::CapEvents));
        // A load above the preload presses the mass into the spring: 10 (x - 0.5) + preload = 1.
        for preload in [-2.0, 0.0, 0.6] {
            let rest = end(preload, 0.5).unwrap();
            assert!(near(rest, 0.5 + (1.0 - preload) / 10.0, 1e-3), "{contact:?}: {preload} {rest}");
        }
    }
}

/// A preload belongs to elastic walls, and only the last wall of a side may be one that only pushes.
#[test]
fn preloads_of_other_walls_are_refused() {
    let free = Linear { gamma: 0.05, square: 1.0, force: 1.0, load: 0.0, omega: 1.5 };
    let message = |contact: Contact, preload: f64| {
        let pair = with_wall(free.oscillator(), Side::Right, 0.2, contact, [8.0, 0.0]);
        let oscillator = with_law(described(&pair, LAW), Side::Right, contact, Some(preload));
        oscillator.validate().map_err(|error| error.to_string())
    };
    assert_eq!(message(Contact::Elastic, 1.0), Ok(()));
    let not_elastic = "preload of right wall 1 = 1: it must be 0, because the wall is not elastic";
    assert_eq!(message(Contact::Impact, 1.0), Err(not_elastic.to_owned()));
    let not_a_number = "preload of right wall 1 = NaN: it must be a finite number";
    assert_eq!(message(Contact::Pushing, f64::NAN), Err(not_a_number.to_owned()));
}
