//! Fixtures for tests of one motion, shared by the tests of the reference and of the lanes.
#![allow(dead_code, reason = "every test binary compiles this module and uses a part of it")]

use pairs::{AsPair, OfPair};
pub(crate) use rattlemap_dynamics::model::REST;
use rattlemap_dynamics::model::{GearPair, Law, Side, State};
use rattlemap_dynamics::motion::{EventKind, GapEvent, Stop, Trajectory, Work};
use rattlemap_dynamics::orbit::{Budget, Settings};
use rattlemap_dynamics::{motion::Flow, pair::DomainKind};

pub(crate) mod linear;
pub(crate) mod pairs;
pub(crate) mod table;

/// The default budget of a map, with early stops and exponents.
pub(crate) const BUDGET: Budget = Budget {
    settings: Settings { transient_periods: 400, observed_periods: 128, max_period: 64 },
    early_stop: true,
    undecided_periods: 1584,
    confirm_chaos: 0,
    exponent: true,
    shows_exponent: true,
    quantities: false,
};

/// Whether two numbers differ by at most `within`.
pub(crate) fn near(a: f64, b: f64, within: f64) -> bool {
    (a - b).abs() <= within
}

/// Returns the gear pair of Table 1 with this restitution and excitation frequency.
pub(crate) fn paper(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

pub(crate) fn flow_of(pair: &GearPair) -> Flow {
    Flow::new(&pair.pair())
}

/// Returns the difference of two counters of work.
pub(crate) fn work_since(now: Work, before: Work) -> Work {
    Work {
        steps: now.steps - before.steps,
        halvings: now.halvings - before.halvings,
        events: now.events - before.events,
        impacts: now.impacts - before.impacts,
        root_iterations: now.root_iterations - before.root_iterations,
    }
}

/// Returns the strobe state after `periods` periods.
pub(crate) fn strobe(flow: &Flow, pair: &GearPair, from: State, periods: u64) -> Result<State, Stop> {
    let mut trajectory = Trajectory::new(flow, pair.law(), from);
    for _ in 0..periods {
        trajectory.advance_period(&mut ())?;
    }
    Ok(trajectory.state())
}

/// Returns the events of `periods` periods. The trajectory must not stop.
pub(crate) fn events(flow: &Flow, law: Law, from: State, periods: u64) -> Vec<GapEvent> {
    let mut trajectory = Trajectory::new(flow, law, from);
    let mut events = Vec::new();
    (0..periods).for_each(|_| trajectory.advance_period(&mut events).expect("a trajectory without a stop"));
    events
}

/// Returns the columns of the derivative of a map by central differences of fourth order with the steps `h` and
/// `2 h`.
pub(crate) fn differences(map: impl Fn(State) -> State, y: State, h: f64) -> [State; 4] {
    std::array::from_fn(|j| {
        let central = |h: f64| -> State {
            let moved = |h: f64| map(std::array::from_fn(|i| y[i] + if i == j { h } else { 0.0 }));
            let (right, left) = (moved(h), moved(-h));
            std::array::from_fn(|i| (right[i] - left[i]) / (2.0 * h))
        };
        let (narrow, wide) = (central(h), central(2.0 * h));
        std::array::from_fn(|i| (4.0 * narrow[i] - wide[i]) / 3.0)
    })
}

/// Returns the domain of the flight that follows an event.
pub(crate) fn domain_after(event: &GapEvent) -> DomainKind {
    match event.kind {
        EventKind::Impact | EventKind::MeshEnd => DomainKind::Free,
        EventKind::MeshStart => DomainKind::Meshing(event.side),
    }
}

/// Motion in one domain between two instants, each of which is an event or a strobe.
#[derive(Clone, Debug)]
pub(crate) struct Leg {
    pub(crate) domain: DomainKind,
    /// Time since phase 0 at the start, and duration.
    pub(crate) t: f64,
    pub(crate) duration: f64,
    pub(crate) start: State,
    pub(crate) end: State,
    /// The event at the start; none at a strobe.
    pub(crate) begins: Option<GapEvent>,
    /// The event at the end; none at a strobe.
    pub(crate) ends: Option<GapEvent>,
}

/// Returns the legs of `periods` periods after `skip` periods.
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

/// Returns the larger of two numbers, or NaN if one is NaN; `f64::max` would ignore it.
pub(crate) fn max_or_nan(m: f64, d: f64) -> f64 {
    if d.is_nan() || d > m { d } else { m }
}

/// Returns the largest difference of two states.
pub(crate) fn apart<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(&b).map(|(x, y)| (x - y).abs()).fold(0.0, max_or_nan)
}

/// Returns the largest entry of a state, or 1 if that is larger.
pub(crate) fn size<const N: usize>(y: [f64; N]) -> f64 {
    y.iter().fold(1.0, |m, x| m.max(x.abs()))
}

/// Returns the largest difference of two states, relative to their size.
pub(crate) fn departure<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    apart(a, b) / size(a).max(size(b))
}

/// Returns the symbol of the mirror image of a flight.
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

pub(crate) fn negated<const N: usize>(y: [f64; N]) -> [f64; N] {
    y.map(|x| -x)
}

/// Returns `+1` for the right wall and `-1` for the left, independently of the tested code.
pub(crate) fn sign(side: Side) -> f64 {
    if side == Side::Right { 1.0 } else { -1.0 }
}
