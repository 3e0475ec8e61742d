//! The published results of the paper, to their printed digits (omega = 5.6, Table 1, from rest).

use crate::common::pairs::OfPair;
use crate::common::{BUDGET, REST, apart, events, flow_of, paper};
use rattlemap_dynamics::model::{GearPair, Side, State};
use rattlemap_dynamics::motion::{GapEvent, Trajectory};
use rattlemap_dynamics::orbit::{Class, EventKind, Orbit, Settings, Status, analyse, measure};
use rattlemap_dynamics::stability::{StrobeMap, refine};

fn orbit(e: f64) -> Orbit {
    analyse(&GearPair::paper(e), REST, &Settings::default()).unwrap()
}

/// Returns time, kind, wall and states of the event nearest to time `t` on the trajectory from rest.
fn event_near(e: f64, t: f64) -> (f64, EventKind, Side, State, State) {
    let pair = GearPair::paper(e);
    let flow = flow_of(&pair);
    let events = events(&flow, pair.law(), REST, ((t + 1.0) / flow.period).ceil() as u64);
    let time = |event: &GapEvent| event.period as f64 * flow.period + event.t;
    let distance = |event: &GapEvent| (time(event) - t).abs();
    let event = events.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
    (time(event), event.kind, event.side, flow.to_state(event.before), flow.to_state(event.after))
}

/// Asserts that a number agrees with a printed one to the last printed digit.
#[track_caller]
fn assert_prints(value: f64, printed: &str) {
    let digits = printed.split('.').nth(1).map_or(0, str::len);
    assert_eq!(format!("{value:.digits$}"), printed);
}

#[track_caller]
fn assert_state(state: State, printed: [&str; 4]) {
    for (value, text) in state.iter().zip(printed) {
        assert_prints(*value, text);
    }
}

#[test]
fn e_0605_is_period_1_with_word_36() {
    let orbit = orbit(0.605);
    assert_eq!(orbit.class, Class::Periodic { period: 1 });
    assert_eq!(orbit.word.time_order(), "36");
    assert_eq!(orbit.word.paper_notation(), "P_{63}");
    let (t, kind, side, _, after) = event_near(0.605, 168.4154);
    assert_prints(t, "168.4154");
    let period = std::f64::consts::TAU / 5.6;
    assert_prints(t % period, "0.1158");
    assert_eq!((kind, side), (EventKind::Impact, Side::Right));
    assert_state(after, ["-0.6585", "3.4080", "-1.1585", "6.8180"]);
}

#[test]
fn e_0606_is_chaotic_with_local_flights_between_3_and_6() {
    let orbit = orbit(0.606);
    assert_eq!(orbit.class, Class::Chaotic);
    let word = orbit.word.time_order();
    assert!(word.contains("356"), "{word}");
}

#[test]
fn e_006_meshes_on_both_sides() {
    let orbit = orbit(0.06);
    assert_eq!(orbit.class, Class::Periodic { period: 1 });
    assert_eq!(orbit.word.paper_notation(), "P_{1 2^2 6 4 5^2 3}");
    let (t, kind, side, _, after) = event_near(0.06, 44.0097);
    assert_prints(t, "44.0097");
    assert_eq!((kind, side), (EventKind::MeshEnd, Side::Right));
    assert_state(after, ["0.1184", "6.3427", "-0.3816", "6.5333"]);
    // At that time the distance from the cycle is still 2e-4.
    let end = orbit.events.iter().find(|e| e.kind == EventKind::MeshEnd && e.side == Side::Right).unwrap();
    let distance = apart(end.before, after);
    assert!((1e-4..4e-4).contains(&distance), "{distance}");
}

#[test]
fn the_word_changes_between_e_00997_and_00998() {
    assert_eq!(orbit(0.0997).word.paper_notation(), "P_{6532}");
    assert_eq!(orbit(0.0998).word.paper_notation(), "P_{63}");
    // The state that the paper prints for 0.0997 belongs to 0.0996, before the impact.
    let (t, kind, side, before, _) = event_near(0.0996, 85.3515);
    assert!((t - 85.3515).abs() < 1e-4, "{t}");
    assert_eq!((kind, side), (EventKind::Impact, Side::Right));
    assert_state(before, ["-0.8008", "5.2444", "-1.3008", "-0.1840"]);
    let (_, _, _, before, _) = event_near(0.0997, 85.3515);
    assert_state(before, ["-0.8007", "5.2454", "-1.3007", "-0.1834"]);
}

#[test]
fn the_pitchfork_lies_at_05419() {
    // A multiplier of the half-period map crosses -1 there: its derivative plus 1 is singular.
    let determinant = |e: f64, guess: State| {
        let pair = GearPair::paper(e);
        let (flow, map) = (flow_of(&pair), StrobeMap::MirroredHalves(1));
        let seed = Trajectory::new(&flow, pair.law(), guess);
        let symmetric = refine(&seed, map).unwrap().state;
        let derivative = map.apply(&seed, symmetric).unwrap().derivative();
        ((derivative + nalgebra::DMatrix::identity(4, 4)).determinant(), symmetric)
    };
    let (mut low, mut high) = (0.54, 0.544);
    let (at_low, mut state) = determinant(low, orbit(low).strobe);
    while high - low > 1e-9 {
        let (middle, next) = determinant(0.5 * (low + high), state);
        state = next;
        if middle * at_low > 0.0 { low = 0.5 * (low + high) } else { high = 0.5 * (low + high) }
    }
    assert_prints(low, "0.5419");
    assert!((low - 0.541_908).abs() < 1e-6, "{low}");
    assert_eq!(orbit(low - 1e-5).symmetric, Some(true));
    assert_eq!(orbit(low + 1e-5).symmetric, Some(false));
}

#[test]
fn orbits_next_to_the_pitchfork_are_decided_early() {
    for (e, symmetric) in [(0.541, true), (0.543, false)] {
        let pair = GearPair::paper(e);
        let measured = measure(&flow_of(&pair), pair.law(), REST, &BUDGET);
        let periods = measured.periods_run + measured.search_periods;
        assert_eq!((measured.period, measured.symmetric), (Some(1), Some(symmetric)), "{e}");
        // The orbits are decided after 101 and 38 periods; the full budget is 528.
        assert!(periods < 200, "{e}: {periods}");
        let orbit = orbit(e);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e}");
        assert_eq!(orbit.symmetric, Some(symmetric), "{e}");
        let [re, im] = orbit.floquet.unwrap()[0];
        assert!(re.hypot(im) < 1.0, "{e}: {re} {im}");
        assert_eq!(orbit.status, Status::Slow, "decided by Newton's method before the motion has converged");
    }
}

#[test]
fn orbits_have_period_1_up_to_0605_and_are_symmetric_up_to_the_pitchfork() {
    for e in (0..=54).map(|i| f64::from(i) * 0.01).chain([0.545, 0.56, 0.58, 0.6, 0.605]) {
        let orbit = orbit(e);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e}");
        assert_eq!(orbit.symmetric, Some(e < 0.5419), "{e}");
    }
}

#[test]
fn the_periodic_window_has_period_4_and_then_period_2() {
    for (e, expected) in [(0.855, 4), (0.86, 4), (0.87, 2), (0.88, 2), (0.9, 2), (0.92, 2)] {
        assert_eq!(orbit(e).class, Class::Periodic { period: expected }, "{e}");
    }
    // Near the end of the window a period-3 orbit coexists, which the motion from rest at 0.93 reaches.
    assert_eq!(orbit(0.93).class, Class::Periodic { period: 3 });
    for e in [0.61, 0.65, 0.7, 0.8, 0.84, 0.94, 0.96] {
        assert_eq!(orbit(e).class, Class::Chaotic, "{e}");
    }
}

#[test]
fn the_response_is_contact_free_above_a_frequency() {
    for (omega, impacts) in [(9.8, true), (10.1, false), (12.0, false)] {
        let orbit = analyse(&paper(0.5, omega), REST, &Settings::default()).unwrap();
        assert_eq!(orbit.impacts_per_period > 0.0, impacts, "{omega}");
    }
}
