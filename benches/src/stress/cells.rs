//! Shared by the parts: engines by name, the reference's answers, and bounds on what rounding may do.

use serde::Serialize;

use rattlemap::gpu::Precision;
use rattlemap::record::distance::{self, farther};
use rattlemap_dynamics::flow::Flow;
pub(super) use rattlemap_dynamics::model::REST;
use rattlemap_dynamics::model::{GearPair, Model, State};
use rattlemap_dynamics::reference::{Stop, Trajectory};

/// Who computed a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum EngineName {
    /// Lanes in single precision.
    #[serde(rename = "lanes f32")]
    LanesF32,
    /// Lanes in double precision.
    #[serde(rename = "lanes f64")]
    LanesF64,
    /// The event-driven reference, f64.
    #[serde(rename = "reference")]
    Reference,
}

impl EngineName {
    /// Every engine, in the order in which they are told.
    pub const ALL: [EngineName; 3] = [EngineName::LanesF32, EngineName::LanesF64, EngineName::Reference];

    /// The name in tables and legends.
    pub fn name(self) -> &'static str {
        match self {
            EngineName::LanesF32 => "lanes f32",
            EngineName::LanesF64 => "lanes f64",
            EngineName::Reference => "reference",
        }
    }

    /// Half a unit in the last place of 1.
    pub(super) fn unit_roundoff(self) -> f64 {
        match self {
            EngineName::LanesF32 => 0.5 * f64::from(f32::EPSILON),
            EngineName::LanesF64 | EngineName::Reference => 0.5 * f64::EPSILON,
        }
    }
}

impl From<Precision> for EngineName {
    fn from(precision: Precision) -> EngineName {
        match precision {
            Precision::F32 => EngineName::LanesF32,
            Precision::F64 => EngineName::LanesF64,
        }
    }
}

/// Table 1 with a restitution and an excitation frequency.
pub(super) fn paper(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

/// The flow of a cell; cells are made valid.
pub(super) fn flow_of(pair: &GearPair) -> Box<Flow> {
    Box::new(Flow::new(&pair.oscillator().expect("cells are made valid")))
}

/// The reference, some periods after a start.
pub(super) fn after(pair: &GearPair, start: State, periods: u32) -> Result<State, Stop> {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), start);
    for _ in 0..periods {
        trajectory.advance_period(&mut ())?;
    }
    Ok(trajectory.state())
}

/// Largest difference of two states; infinite if one is not finite.
pub(super) fn apart(a: &State, b: &State) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| distance::apart(a, b)).fold(0.0, farther)
}

/// Roundings by which starts and parameters are moved to see what rounding may do.
const ROUNDINGS: f64 = 4.0;

/// How far the reference ends from where it does when its start or a parameter moves within
/// the engine's rounding: the largest of all such moves, and the state's own rounding.
pub(super) fn sensitivity(pair: &GearPair, start: State, periods: u32, engine: EngineName) -> f64 {
    sensitivity_to(ROUNDINGS * engine.unit_roundoff(), pair, start, periods)
}

/// The same for moves by a share `amount` of every number.
pub(super) fn sensitivity_to(amount: f64, pair: &GearPair, start: State, periods: u32) -> f64 {
    let Ok(end) = after(pair, start, periods) else { return f64::INFINITY };
    let moved_start = |k: usize| {
        let mut moved = start;
        moved[k % 4] += if k < 4 { amount } else { -amount } * start[k % 4].abs().max(pair.b);
        after(pair, moved, periods)
    };
    let moved_pair = |k: usize| {
        let sign = if k.is_multiple_of(2) { amount } else { -amount };
        let mut moved = *pair;
        let value = pair.value(k / 2) * (1.0 + sign);
        // A restitution of 1 has but one side.
        moved.set_at(k / 2, value).ok().map(|()| after(&moved, start, periods))
    };
    let ends = (0..8).map(moved_start).chain((0..2 * GearPair::PARAMETERS.len()).filter_map(moved_pair));
    let size = end.iter().fold(pair.b, |m, x| m.max(x.abs()));
    ends.map(|moved| moved.map_or(f64::INFINITY, |moved| apart(&moved, &end))).fold(amount * size, farther)
}

/// What rounding may make of an error after so many steps: the reference is moved by four
/// roundings at once, every step rounds, and roundings add up like a random walk.
pub(super) fn bar(sensitivity: f64, steps: f64) -> f64 {
    const FACTOR: f64 = 4.0;
    (FACTOR + steps.sqrt() / ROUNDINGS) * sensitivity
}

/// Where rounding may do more than this, an error says nothing.
pub(super) const UNFORESEEN: f64 = 0.1;
