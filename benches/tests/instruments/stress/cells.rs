//! Items that several parts use: engines, results of the reference, and bounds on the effect of rounding.

use rattlemap::gpu::Precision;
use rattlemap::record::distance::{self, farther};
pub(super) use rattlemap_dynamics::model::REST;
use rattlemap_dynamics::model::{GearPair, Model, Pair, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{Stop, Trajectory, Work};

/// The engine that computed a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EngineName {
    /// Lanes in single precision.
    LanesF32,
    /// Lanes in double precision.
    LanesF64,
    /// The event-driven reference, in double precision.
    Reference,
}

impl EngineName {
    /// Returns half a unit in the last place of 1.
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

/// Returns the pair of Table 1 with this restitution and excitation frequency.
pub(super) fn paper(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

/// Returns the oscillator of a cell. All cells of these tests are valid.
pub(super) fn oscillator_of(pair: &GearPair) -> Pair {
    Pair::of(&pair.oscillator().expect("a valid cell")).expect("a pair")
}

/// Returns the flow of a cell.
pub(super) fn flow_of(pair: &GearPair) -> Box<Flow> {
    Box::new(Flow::new(&oscillator_of(pair)))
}

/// Runs the reference for some periods. Returns its state, or why it stopped, and its work.
pub(super) fn run_reference(pair: &GearPair, start: State, periods: u32) -> (Result<State, Stop>, Work) {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), start);
    let end = (0..periods).try_for_each(|_| trajectory.advance_period(&mut ()));
    (end.map(|()| trajectory.state()), trajectory.work())
}

/// Returns the reference's state some periods after a start.
pub(super) fn state_after(pair: &GearPair, start: State, periods: u32) -> Result<State, Stop> {
    run_reference(pair, start, periods).0
}

/// Returns the largest difference of two states; infinite if one is not finite.
pub(super) fn state_distance(a: &State, b: &State) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| distance::apart(a, b)).fold(0.0, farther)
}

/// Number of unit roundoffs by which starts and parameters are moved to measure the effect of rounding.
const ROUNDINGS: f64 = 4.0;

/// Returns how far the reference's end moves when its start or a parameter moves within the engine's rounding: the largest
/// of all such moves, and of the state's own rounding.
pub(super) fn sensitivity(pair: &GearPair, start: State, periods: u32, engine: EngineName) -> f64 {
    sensitivity_to(ROUNDINGS * engine.unit_roundoff(), pair, start, periods)
}

/// Returns the sensitivity to relative changes by `amount` of the start and of each parameter.
pub(super) fn sensitivity_to(amount: f64, pair: &GearPair, start: State, periods: u32) -> f64 {
    let Ok(end) = state_after(pair, start, periods) else { return f64::INFINITY };
    let moved_start = |k: usize| {
        let mut moved = start;
        moved[k % 4] += if k < 4 { amount } else { -amount } * start[k % 4].abs().max(pair.b);
        state_after(pair, moved, periods)
    };
    let moved_pair = |k: usize| {
        let sign = if k.is_multiple_of(2) { amount } else { -amount };
        let mut moved = *pair;
        let value = pair.value(k / 2) * (1.0 + sign);
        // A restitution of 1 can only decrease.
        moved.set_at(k / 2, value).ok().map(|()| state_after(&moved, start, periods))
    };
    let ends = (0..8).map(moved_start).chain((0..2 * GearPair::PARAMETERS.len()).filter_map(moved_pair));
    let size = end.iter().fold(pair.b, |m, x| m.max(x.abs()));
    ends.map(|moved| moved.map_or(f64::INFINITY, |moved| state_distance(&moved, &end)))
        .fold(amount * size, farther)
}

/// Returns the error that rounding may cause in so many steps. The sensitivity belongs to four roundings at once, every
/// step rounds, and roundings add up like a random walk.
pub(super) fn bar(sensitivity: f64, steps: f64) -> f64 {
    const FACTOR: f64 = 4.0;
    (FACTOR + steps.sqrt() / ROUNDINGS) * sensitivity
}

/// Largest bound with which errors are compared. Where rounding may cause more, an error shows nothing.
pub(super) const UNPREDICTABLE: f64 = 0.1;
