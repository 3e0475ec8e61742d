//! States at given times, above all at the exact time of an event.

use std::sync::atomic::AtomicBool;

use crate::common::linear::{Linear, with_wall};
use rattlemap_dynamics::model::{Contact, Law, Side, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{history, state_at};

/// Returns the flow of a ball with the acceleration 2 towards a wall at 0. The forcing has no amplitude.
fn falling(contact: Contact, omega: f64) -> Flow {
    let free = Linear { gamma: 0.0, square: 0.0, force: 0.0, load: 2.0, omega };
    Flow::new(&with_wall(free.oscillator(), Side::Right, 0.0, contact, [0.0, 0.0]))
}

fn at(flow: &Flow, law: Law, start: State, time: f64) -> State {
    state_at(flow, law, start, time, &AtomicBool::new(false)).unwrap().unwrap()
}

/// From the height 9 the ball falls for 3 and then bounces every 6, with the speed 6.
#[test]
fn the_state_at_the_exact_time_of_an_impact_is_the_one_after_it() {
    let start = state(&[-9.0]);
    for omega in [1.0, 0.7, std::f64::consts::TAU, std::f64::consts::TAU / 3.0] {
        let (flow, law) = (falling(Contact::Impact, omega), Law::both(1.0, 0.0));
        for n in 0..200 {
            let time = 3.0 + 6.0 * f64::from(n);
            for (time, speed) in [(time, -6.0), (time - 1e-9, 6.0), (time + 1e-9, -6.0)] {
                let [x, v, ..] = at(&flow, law, start, time);
                assert!((v - speed).abs() < 1e-8 && x.abs() < 1e-8, "omega = {omega}, t = {time}: {x} {v}");
            }
        }
    }
}

/// Samples at the times of impacts, which are multiples of the forcing period here, have the speed after them.
#[test]
fn samples_of_a_history_at_impacts_have_the_states_after_them() {
    let (flow, law) = (falling(Contact::Impact, std::f64::consts::TAU / 3.0), Law::both(1.0, 0.0));
    let history = |skipped, periods, samples| {
        let window = (skipped, periods);
        history(&flow, law, state(&[-9.0]), window, samples, &AtomicBool::new(false)).unwrap().unwrap()
    };
    let first = history(0, 8, 4);
    assert_eq!(first.samples.len(), 33);
    assert_eq!(first.events.len(), 4);
    for sample in &first.samples {
        // The time since the last impact at 3, 9, 15 ...
        let since = (sample.t + 3.0 + 1e-12).rem_euclid(6.0) - 1e-12;
        let [x, v, ..] = sample.state;
        let (height, speed) = (since * (6.0 - since), 2.0 * (since - 3.0));
        assert!((x + height).abs() < 1e-11 && (v - speed).abs() < 1e-11, "{sample:?}");
    }
    for (n, event) in first.events.iter().enumerate() {
        assert!((event.t - (3.0 + 6.0 * n as f64)).abs() < 1e-13, "{event:?}");
        assert!((event.before[1] - 6.0).abs() < 1e-12 && (event.after[1] + 6.0).abs() < 1e-12, "{event:?}");
    }
    // A window is a part of the whole, and its events do not depend on the number of samples.
    let (whole, last) = (history(0, 8, 7), history(4, 4, 4));
    assert_eq!(whole.events, first.events);
    assert_eq!(last.samples[1..], first.samples[17..]);
    assert!(first.events.ends_with(&last.events) && last.events.len() == 2, "{last:?}");
}
