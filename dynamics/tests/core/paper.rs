//! Every published fact of the paper, to its printed digits (omega = 5.6, Table 1, from rest).

use crate::common::{REST, apart, flow_of, paper};
use rattlemap_dynamics::model::{GearPair, Side, State};
use rattlemap_dynamics::orbit::{Budget, Class, EventKind, Orbit, Settings, Status, analyse, measure};
use rattlemap_dynamics::reference::{GapEvent, Trajectory};
use rattlemap_dynamics::stability::pitchfork;

fn orbit(e: f64) -> Orbit {
    analyse(&GearPair::paper(e), REST, &Settings::default()).unwrap()
}

/// The event nearest to time `t` on the trajectory from rest: time, and states.
fn event_near(e: f64, t: f64) -> (f64, EventKind, Side, State, State) {
    let pair = GearPair::paper(e);
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
    let mut met: Vec<GapEvent> = Vec::new();
    while (trajectory.period() as f64) * flow.period < t + 1.0 {
        trajectory.advance_period(&mut met).unwrap();
    }
    let time = |h: &GapEvent| h.period as f64 * flow.period + h.t;
    let h = met.iter().min_by(|a, b| (time(a) - t).abs().total_cmp(&(time(b) - t).abs())).unwrap();
    (time(h), h.kind, h.side, flow.to_state(h.before), flow.to_state(h.after))
}

/// Asserts that numbers agree with printed ones to the last printed digit.
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
fn e_0606_is_aperiodic_with_local_flights_between_3_and_6() {
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
    // The state is still 2e-4 away from its limit.
    let end = orbit.events.iter().find(|e| e.kind == EventKind::MeshEnd && e.side == Side::Right).unwrap();
    let left = apart(end.before, after);
    assert!((1e-4..4e-4).contains(&left), "{left}");
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
    let guess = orbit(0.54).strobe;
    let e = pitchfork(&GearPair::paper(0.54), "e", 0.54, 0.544, guess).unwrap();
    assert_prints(e, "0.5419");
    // To 1e-6, and independent of the bracket.
    let other = pitchfork(&GearPair::paper(0.54), "e", 0.5405, 0.5432, guess).unwrap();
    assert!((e - other).abs() < 1e-9, "{e} {other}");
    // On either side, close by, the orbit is what the value says.
    assert_eq!(orbit(e - 1e-5).symmetric, Some(true));
    assert_eq!(orbit(e + 1e-5).symmetric, Some(false));
}

#[test]
fn orbits_next_to_the_pitchfork_are_decided_early() {
    // A map's budget.
    let budget = Budget {
        settings: Settings::default(),
        early_stop: true,
        undecided_periods: 1584,
        exponent: true,
        shows_exponent: true,
    };
    for (e, symmetric) in [(0.541, true), (0.543, false)] {
        let pair = GearPair::paper(e);
        let measured = measure(&flow_of(&pair), pair.law(), REST, &budget);
        let periods = measured.periods_run + measured.search_periods;
        assert_eq!((measured.period, measured.symmetric), (Some(1), Some(symmetric)), "{e}");
        // Measurement 101 and 38, of 528 to wait for.
        assert!(periods < 200, "{e}: {periods}");
    }
    for (e, symmetric) in [(0.541, true), (0.543, false)] {
        let orbit = orbit(e);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e}");
        assert_eq!(orbit.symmetric, Some(symmetric), "{e}");
        let [re, im] = orbit.floquet.unwrap()[0];
        assert!(re.hypot(im) < 1.0, "{e}: {re} {im}");
        assert_eq!(orbit.status, Status::Slow, "decided by Newton, not by waiting");
    }
}

#[test]
fn symmetry_up_to_the_pitchfork_and_period_1_up_to_0605() {
    for i in 0..=54 {
        let e = f64::from(i) * 0.01;
        let orbit = orbit(e);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e}");
        assert_eq!(orbit.symmetric, Some(true), "{e}");
    }
    for e in [0.545, 0.56, 0.58, 0.6, 0.605] {
        let orbit = orbit(e);
        assert_eq!(orbit.class, Class::Periodic { period: 1 }, "{e}");
        assert_eq!(orbit.symmetric, Some(false), "{e}");
    }
}

#[test]
fn the_window_holds_period_4_and_above_it_period_2() {
    for (e, expected) in [(0.855, 4), (0.86, 4), (0.87, 2), (0.88, 2), (0.9, 2), (0.92, 2)] {
        assert_eq!(orbit(e).class, Class::Periodic { period: expected }, "{e}");
    }
    // Towards its end a period-3 orbit coexists; from rest at 0.93 the motion finds that one.
    assert_eq!(orbit(0.93).class, Class::Periodic { period: 3 });
    for e in [0.61, 0.65, 0.7, 0.8, 0.84, 0.94, 0.96] {
        assert_eq!(orbit(e).class, Class::Chaotic, "{e}");
    }
}

#[test]
fn the_contact_free_response_ends_the_impacting_ones() {
    for (omega, impacts) in [(9.8, true), (10.1, false), (12.0, false)] {
        let orbit = analyse(&paper(0.5, omega), REST, &Settings::default()).unwrap();
        assert_eq!(orbit.impacts_per_period > 0.0, impacts, "{omega}");
    }
}
