//! Fixtures of one motion, for tests of the reference and of the lanes.
#![allow(dead_code, reason = "every test binary compiles this module and uses a part of it")]

use rattlemap_dynamics::flow::{DomainKind, Flow};
use rattlemap_dynamics::model::{GearPair, Side, State};
use rattlemap_dynamics::reference::{EventKind, GapEvent, Stop, Trajectory, Work};

pub(crate) mod linear;
pub(crate) mod table;

/// At rest in the middle of the gap.
pub(crate) const REST: State = [0.0; 4];

/// Table 1 with a restitution and an excitation frequency.
pub(crate) fn paper(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

/// The flow of a pair that is known to be valid.
pub(crate) fn flow_of(pair: &GearPair) -> Flow {
    Flow::new(&pair.oscillator().expect("valid parameters"))
}

/// Work done from one snapshot to the next.
pub(crate) fn work_since(now: Work, before: Work) -> Work {
    Work {
        steps: now.steps - before.steps,
        halvings: now.halvings - before.halvings,
        events: now.events - before.events,
        impacts: now.impacts - before.impacts,
        root_iterations: now.root_iterations - before.root_iterations,
    }
}

/// The strobe state after some periods.
pub(crate) fn strobe(flow: &Flow, pair: &GearPair, from: State, periods: u64) -> Result<State, Stop> {
    let mut trajectory = Trajectory::new(flow, pair.law(), from);
    for _ in 0..periods {
        trajectory.advance_period(&mut ())?;
    }
    Ok(trajectory.state())
}

/// The domain of the flight that follows an event.
pub(crate) fn domain_after(event: &GapEvent) -> DomainKind {
    match event.kind {
        EventKind::Impact | EventKind::MeshEnd => DomainKind::Free,
        EventKind::MeshStart => DomainKind::Meshing(event.side),
    }
}

/// Motion in one domain between two marks: events, or strobes inside a flight.
#[derive(Clone, Debug)]
pub(crate) struct Leg {
    pub(crate) domain: DomainKind,
    /// Time since phase 0 at the start, and duration.
    pub(crate) t: f64,
    pub(crate) duration: f64,
    pub(crate) start: State,
    pub(crate) end: State,
    /// The event that begins it; none at a strobe.
    pub(crate) begins: Option<GapEvent>,
    /// The event that ends it; none at a strobe.
    pub(crate) ends: Option<GapEvent>,
}

/// The legs of `periods` periods after `skip` periods.
pub(crate) fn legs(flow: &Flow, pair: &GearPair, from: State, skip: u64, periods: u64) -> Vec<Leg> {
    let mut trajectory = Trajectory::new(flow, pair.law(), from);
    for _ in 0..skip {
        trajectory.advance_period(&mut ()).expect("an ordinary cell");
    }
    let mut legs = Vec::new();
    for _ in 0..periods {
        let domain = trajectory.meshing().map_or(DomainKind::Free, DomainKind::Meshing);
        let mut mark = (0.0, trajectory.state(), domain, None);
        let mut events: Vec<GapEvent> = Vec::new();
        trajectory.advance_period(&mut events).expect("an ordinary cell");
        for event in events {
            let (t, start, domain, begins) = mark;
            let end = flow.to_state(event.before);
            legs.push(Leg { domain, t, duration: event.t - t, start, end, begins, ends: Some(event) });
            mark = (event.t, flow.to_state(event.after), domain_after(&event), Some(event));
        }
        let (t, start, domain, begins) = mark;
        let end = trajectory.state();
        legs.push(Leg { domain, t, duration: flow.period - t, start, end, begins, ends: None });
    }
    legs
}

/// Largest difference of two states.
pub(crate) fn apart(a: State, b: State) -> f64 {
    let differences = a.iter().zip(&b).map(|(x, y)| (x - y).abs());
    // `f64::max` would swallow a NaN.
    differences.fold(0.0, |m: f64, d| if d.is_nan() || d > m { d } else { m })
}

/// The same in units of the larger of 1 and their largest entry.
pub(crate) fn departure(a: State, b: State) -> f64 {
    let scale = a.iter().chain(&b).fold(1.0f64, |m, x| m.max(x.abs()));
    apart(a, b) / scale
}

/// The other wall's name for a flight.
pub(crate) fn mirrored_symbol(symbol: u8) -> u8 {
    match symbol {
        b'1' => b'4',
        b'2' => b'5',
        b'3' => b'6',
        b'4' => b'1',
        b'5' => b'2',
        b'6' => b'3',
        other => panic!("no symbol: {other}"),
    }
}

/// The opposite of a state.
pub(crate) fn negated(y: State) -> State {
    y.map(|x| -x)
}

/// `+1` for the right wall, `-1` for the left; spelled out here so that nothing is shared
/// with what is being tested.
pub(crate) fn sign(side: Side) -> f64 {
    if side == Side::Right { 1.0 } else { -1.0 }
}
