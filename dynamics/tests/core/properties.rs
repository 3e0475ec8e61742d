//! Invariants of the motion of all gear pairs.

use crate::common::pairs::{AsPair, OfPair};
use crate::common::{departure, domain_after, mirrored_symbol, negated, paper, sign, size};
use proptest::prelude::*;
use rattlemap_dynamics::model::{GearPair, REST, Side, State, state};
use rattlemap_dynamics::motion::{EventKind, GapEvent, Stop, Trajectory};
use rattlemap_dynamics::stability::UNIT;
use rattlemap_dynamics::{motion::Flow, pair::DomainKind};
use rayon::prelude::*;

/// Largest number of events for which two computations of one motion are compared. After more events, rounding errors may have grown
/// although the tangents have not, because damping reduced the tangents before.
pub(crate) const COMPARABLE_EVENTS: usize = 12;

/// Number of events examined in one trajectory. There may be millions in a period.
const EVENTS: usize = 400;

/// Numbers between `low` and `high`, uniform in their logarithm.
pub(crate) fn logarithmic(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low.ln()..high.ln()).prop_map(f64::exp)
}

/// Numbers of a strategy, and zero in one of `weight + 1` cases.
pub(crate) fn or_zero(
    weight: u32,
    values: impl Strategy<Value = f64> + 'static,
) -> impl Strategy<Value = f64> {
    prop_oneof![weight => values.boxed(), 1 => Just(0.0).boxed()]
}

fn or_none(values: impl Strategy<Value = f64> + 'static) -> impl Strategy<Value = f64> {
    or_zero(8, values)
}

fn pairs() -> impl Strategy<Value = GearPair> {
    let masses = (logarithmic(0.1, 10.0), logarithmic(0.1, 10.0));
    let supports = (or_none(0.0..5.0), or_none(0.0..5.0), or_none(0.0..2000.0), or_none(0.0..2000.0));
    let mesh = (or_none(0.0..5.0), logarithmic(10.0, 1e5));
    let forcing = (0.01..200.0, 0.3..15.0);
    let contact =
        (logarithmic(0.01, 2.0), or_none(prop_oneof![4 => 0.0..1.0, 1 => Just(1.0)]), or_none(0.0..0.1));
    (masses, supports, mesh, forcing, contact).prop_map(
        |((m1, m2), (r1, r2, k1, k2), (r, k), (force, omega), (b, e, mesh_speed))| GearPair {
            m1,
            m2,
            r1,
            r2,
            k1,
            k2,
            r,
            k,
            force,
            omega,
            b,
            e,
            mesh_speed,
        },
    )
}

fn starts() -> impl Strategy<Value = State> {
    prop::array::uniform4(-2.0..2.0)
        .prop_map(|[z, v1, x2, v2]: [f64; 4]| state(&[x2 + z, 5.0 * v1, x2, 5.0 * v2]))
}

/// Shifts the end of a flight back if it crosses phase 0, as a pair without supports is shifted there.
fn shifted_back(pair: &GearPair, q: [f64; 4], [from, to]: [&GapEvent; 2]) -> [f64; 4] {
    let is_shifted = pair.k1 == 0.0 && pair.k2 == 0.0 && from.period < to.period;
    if is_shifted { [q[0], q[1], to.before[2], q[3]] } else { q }
}

fn flow_of(pair: &GearPair) -> Flow {
    Flow::new(&pair.pair())
}

/// Returns the events of some periods, or those before the cap on events. No other stop may occur.
fn events_of(flow: &Flow, pair: &GearPair, y: State, periods: u64) -> Result<Vec<GapEvent>, TestCaseError> {
    let mut trajectory = Trajectory::new(flow, pair.law(), y);
    let mut events = Vec::new();
    for _ in 0..periods {
        match trajectory.advance_period(&mut events) {
            Ok(()) => {}
            Err(Stop::CapEvents) => break,
            Err(stop) => return Err(TestCaseError::fail(format!("{stop}"))),
        }
        prop_assert!(trajectory.state().iter().all(|x| x.is_finite()), "{:?}", trajectory.state());
    }
    events.truncate(EVENTS);
    Ok(events)
}

/// Returns the time from one event to the next.
fn between(flow: &Flow, from: &GapEvent, to: &GapEvent) -> f64 {
    (to.period - from.period) as f64 * flow.period + (to.t - from.t)
}

/// Checks `free_flights_stay_between_the_walls` for one pair.
fn check_free_flights(pair: &GearPair, y: State) -> Result<(), TestCaseError> {
    let flow = flow_of(pair);
    let events = events_of(&flow, pair, y, 3)?;
    for two in events.windows(2).filter(|two| domain_after(&two[0]) == DomainKind::Free) {
        let (from, to) = (&two[0], &two[1]);
        // The jump over an infinite series of impacts is no flight.
        if pair.mesh_speed == 0.0 && pair.e > 0.0 && to.kind == EventKind::MeshStart && to.before[1] == 0.0 {
            continue;
        }
        let free = flow.domain(DomainKind::Free);
        let (sin, cos) = (pair.omega * from.t).sin_cos();
        let duration = between(&flow, from, to);
        // Rounding error of the gap for large displacements and long flights.
        let size = size(from.after).max(size(to.before)) + pair.b;
        let rate = (pair.k1 / pair.m1 + pair.k2 / pair.m2).sqrt();
        let travel = 64.0 * f64::EPSILON * size * (1.0 + duration * (1.0 + rate));
        // The rounding error of the phase grows with the number of steps since the strobe.
        let steps = 1.0 + from.t * (rate + (pair.k / pair.m1 + pair.k / pair.m2).sqrt());
        let drive = f64::EPSILON * steps * 0.5 * pair.force / pair.m1 * duration * duration;
        let rounding = travel + drive;
        for i in 1..=24 {
            let q = free.propagate(from.after, [cos, sin], duration * f64::from(i) / 24.0);
            prop_assert!(q[0].abs() <= pair.b + rounding, "gap {} at {i}/24 of {two:#?}", q[0]);
            if i == 24 {
                let off = departure(shifted_back(pair, q, [from, to]), to.before);
                prop_assert!(off <= 1e-11 * size, "ends {off:.1e} from {q:?}: {two:#?}");
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, max_global_rejects: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A free flight between two events stays between the walls, and ends in the state of the second event.
    #[test]
    fn free_flights_stay_between_the_walls(pair in pairs(), y in starts()) {
        check_free_flights(&pair, y)?;
    }

    /// Meshing stays behind its wall after the contact onset, and ends in the state of its last event.
    #[test]
    fn meshing_stays_behind_its_wall(pair in pairs(), y in starts()) {
        let flow = flow_of(&pair);
        let events = events_of(&flow, &pair, y, 3)?;
        for two in events.windows(2).filter(|two| two[0].kind == EventKind::MeshStart) {
            let (from, to) = (&two[0], &two[1]);
            prop_assert_eq!(to.kind, EventKind::MeshEnd);
            prop_assert_eq!(to.side, from.side);
            let (side, s) = (from.side, sign(from.side));
            let meshing = flow.domain(DomainKind::Meshing(side));
            let (sin, cos) = (pair.omega * from.t).sin_cos();
            let duration = between(&flow, from, to);
            let size = size(from.after).max(size(to.before)) + pair.b;
            let mut onset_over = false;
            for i in 1..=24 {
                let q = meshing.propagate(from.after, [cos, sin], duration * f64::from(i) / 24.0);
                let depth = s * q[0] - pair.b;
                onset_over |= depth > 1e-11 * size;
                prop_assert!(!onset_over || depth > -1e-11 * size, "in front of the wall at {i}/24 of {two:#?}");
                if i == 24 {
                    let off = departure(shifted_back(&pair, q, [from, to]), to.before);
                    prop_assert!(off <= 1e-9, "ends {off:.1e} from {q:?}: {two:#?}");
                }
            }
        }
    }

    /// Impacts conserve the momentum, lose the right energy, and obey `w+ = -e w-`.
    #[test]
    fn impacts_obey_momentum_energy_and_restitution(pair in pairs(), y in starts()) {
        let flow = flow_of(&pair);
        for event in events_of(&flow, &pair, y, 5)? {
            let (before, after) = (flow.to_state(event.before), flow.to_state(event.after));
            if event.kind == EventKind::MeshEnd {
                prop_assert_eq!(before, after);
                continue;
            }
            prop_assert_eq!(event.before[0], flow.wall(event.side));
            prop_assert_eq!(event.after[0], flow.wall(event.side));
            prop_assert_eq!(event.after[1], -pair.e * event.before[1]);
            prop_assert!(sign(event.side) * event.before[1] >= -1e-7, "not closing: {event:?}");
            let scale = (pair.m1 + pair.m2) * size(before).max(size(after));
            let momentum = flow.momentum(after) - flow.momentum(before);
            prop_assert!(momentum.abs() <= 8.0 * f64::EPSILON * scale, "momentum {momentum:e}: {event:?}");
            let energy = flow.kinetic_energy(after) - flow.kinetic_energy(before);
            let lost = 0.5 / (1.0 / pair.m1 + 1.0 / pair.m2) * (1.0 - pair.e * pair.e) * event.before[1].powi(2);
            let rounding = 16.0 * f64::EPSILON * scale * size(before).max(size(after));
            prop_assert!((energy + lost).abs() <= rounding, "energy {energy:e}, not {:e}: {event:?}", -lost);
        }
    }

    /// The symmetry is `(y, t) -> (-y, t + T/2)`.
    #[test]
    fn the_mirror_image_of_a_motion_is_a_motion(pair in pairs(), y in starts()) {
        let flow = flow_of(&pair);
        let half = 0.5 * flow.period;
        let mut original = Trajectory::with_tangents(&flow, pair.law(), y, UNIT);
        prop_assume!(original.advance_to(half, &mut ()).is_ok());
        let state = original.state();
        // A start from the state alone would be free motion if the gap is in a contact onset.
        let gap = state[0] - state[2];
        prop_assume!(original.meshing().is_none_or(|side| sign(side) * gap > pair.b + 1e-9));
        original.set_tangents(UNIT);
        original.clear_near_grazing();
        let mut events = Vec::new();
        let stopped = original.advance_to(flow.period, &mut events).is_err();
        prop_assume!(!stopped && !original.near_grazing());
        // Exclude motions that amplify rounding errors strongly, or come very close to the threshold.
        let growth = original.tangents().iter().flatten().fold(1.0f64, |m, x| m.max(x.abs()));
        prop_assume!(growth < 1e4);
        prop_assume!(events.iter().all(|event| (pair.e * event.before[1].abs() - pair.mesh_speed).abs() > 1e-7));

        let mut mirror = Trajectory::new(&flow, pair.law(), negated(state));
        let mut images: Vec<GapEvent> = Vec::new();
        mirror.advance_to(half, &mut images).expect("the original did not stop");
        prop_assert!(images.len() == events.len() || events.len() > COMPARABLE_EVENTS);
        for (image, event) in images.iter().zip(&events).take(COMPARABLE_EVENTS) {
            prop_assert_eq!(image.kind, event.kind);
            prop_assert_eq!(image.side, event.side.mirrored());
            if let (Some(a), Some(b)) = (image.symbol, event.symbol) {
                prop_assert_eq!(mirrored_symbol(a), b);
            }
            let tolerance = 1e-8 * growth;
            prop_assert!((image.t + half - event.t).abs() < tolerance, "{image:?} for {event:?}");
            prop_assert!(departure(negated(image.after), event.after) < tolerance, "{image:?} for {event:?}");
        }
        if events.len() <= COMPARABLE_EVENTS {
            let off = departure(negated(mirror.state()), original.state());
            prop_assert!(off < 1e-11 * growth * size(state), "off by {off:.1e} at a growth of {growth:.1e}");
        }
    }

    #[test]
    fn a_period_in_pieces_agrees_with_a_whole_period(pair in pairs(), y in starts(), cuts in prop::array::uniform3(0.0..1.0f64)) {
        let flow = flow_of(&pair);
        let mut whole = Trajectory::with_tangents(&flow, pair.law(), y, UNIT);
        let mut events: Vec<GapEvent> = Vec::new();
        prop_assume!(whole.advance_period(&mut events).is_ok() && !whole.near_grazing());
        let growth = whole.tangents().iter().flatten().fold(1.0f64, |m, x| m.max(x.abs()));
        prop_assume!(growth < 1e4);
        let mut cuts = cuts;
        cuts.sort_by(f64::total_cmp);
        let mut pieces = Trajectory::new(&flow, pair.law(), y);
        for cut in cuts {
            pieces.advance_to(cut * flow.period, &mut ()).expect("the whole did not stop");
            prop_assert_eq!(pieces.time_in_period(), cut * flow.period);
        }
        pieces.advance_period(&mut ()).expect("the whole did not stop");
        if events.len() <= COMPARABLE_EVENTS {
            prop_assert_eq!(pieces.work().events, whole.work().events);
            let off = departure(pieces.state(), whole.state());
            prop_assert!(off < 1e-11 * growth * size(y), "off by {off:.1e} at a growth of {growth:.1e}");
        }
    }
}

/// Late in a long period, the time of an event has a larger rounding error, and so has the speed of a stiff flight.
#[test]
fn a_stiff_flight_late_in_a_period_ends_in_the_state_of_its_event() {
    let pair = GearPair {
        m1: 0.657_851_055_472_107,
        m2: 0.580_344_156_213_021,
        r1: 0.0,
        r2: 1.729_238_273_442_989_9,
        k1: 1_773.364_913_022_762_5,
        k2: 1_757.475_379_600_580_5,
        r: 0.0,
        k: 10.000_000_000_000_002,
        force: 0.01,
        omega: 0.3,
        b: 1.0,
        e: 0.0,
        mesh_speed: 0.0,
    };
    let start = -1.642_490_278_186_327;
    check_free_flights(&pair, state(&[start, 0.0, start])).expect("an agreement");
}

/// Meshing starts with almost no pressing acceleration, so its end depends on rounding.
#[test]
fn meshing_with_hardly_any_pressing_ends() {
    let pair = GearPair {
        m1: 0.360_926_782_500_657_3,
        m2: 1.279_671_013_419_157,
        r1: 3.321_036_086_643_82,
        r2: 0.0,
        k1: 0.0,
        k2: 0.0,
        r: 4.906_999_323_832_98,
        k: 94.331_105_298_561_91,
        force: 12.159_123_368_975_937,
        omega: 6.696_986_044_308_057,
        b: 0.056_905_186_449_552_28,
        e: 0.285_430_285_787_210_1,
        mesh_speed: 0.043_454_217_307_052_935,
    };
    let start = state(&[
        0.385_414_006_558_098_93,
        3.661_243_976_023_188_7,
        0.328_508_820_108_546_65,
        3.661_243_974_235_642,
    ]);
    let mut ends_in_onset = 0;
    // The pressing acceleration is 0, or 1e-13 to 1e-3 of the total.
    for k in 0..=400 {
        let more = if k == 0 { 0.0 } else { 10f64.powf(-13.0 + f64::from(k) / 40.0) };
        let pair = GearPair { force: pair.force * (1.0 + more), ..pair };
        let flow = flow_of(&pair);
        let events = events_of(&flow, &pair, start, 1).expect("no stop");
        let meshing = flow.domain(DomainKind::Meshing(Side::Right));
        let ends = |event: &&GapEvent| event.kind == EventKind::MeshEnd && event.side == Side::Right;
        for end in events.iter().filter(ends).filter(|end| end.before[0] < pair.b) {
            let (sin, cos) = (pair.omega * end.t).sin_cos();
            let pressing = meshing.acceleration(&end.before, &[cos, sin]);
            assert!(pressing.abs() < 1e-12 * pair.force / pair.m1, "{pressing:e} at the end: {end:?}");
            ends_in_onset += 1;
        }
    }
    assert!(ends_in_onset > 100, "{ends_in_onset}");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let cells: Vec<GearPair> =
        (0..64).map(|i| paper(f64::from(i % 8) / 7.0, 1.0 + 1.4 * f64::from(i / 8))).collect();
    let run = |threads: usize| -> Vec<(State, u64)> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        pool.install(|| {
            let cell = |pair: &GearPair| {
                let flow = flow_of(pair);
                let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
                for _ in 0..60 {
                    trajectory.advance_period(&mut ()).expect("an ordinary cell");
                }
                (trajectory.state(), trajectory.work().events)
            };
            cells.par_iter().map(cell).collect()
        })
    };
    let one = run(1);
    assert!(one.iter().any(|(_, events)| *events > 0));
    for threads in [2, 4] {
        assert_eq!(run(threads), one, "{threads} threads");
    }
}
