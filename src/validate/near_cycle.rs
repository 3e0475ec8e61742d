//! Records whose multipliers were computed near a cycle instead of on it.
//!
//! A lane computes multipliers at its present state. This state is near the cycle, or still approaches it if the status is `slow`. If the
//! strobe map is strongly curved or amplifies rounding, these multipliers differ from those of the cycle. The record is correct if the
//! reference computes the same values at the same state.

use super::cell::{Cell, ROUNDING_FACTOR};
use crate::gpu::rules;
use crate::record::classify::{classify, status};
use crate::record::distance::apart;
use crate::record::{Record, valid};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::motion::{GapEvent, Observer, States};
use rattlemap_dynamics::orbit::{Class, Status};
use rattlemap_dynamics::stability::{StrobeMap, refine};

/// Returns the record with the exponent of the cycle itself, and the distance from the cycle. None unless the reference confirms the
/// record's exponent at the record's state.
pub(super) fn on_its_cycle(cell: &Cell<'_>, record: &Record) -> Option<(Record, f64)> {
    let Class::Periodic { period } = classify(record) else { return None };
    let needed = valid::STROBE | valid::LYAPUNOV;
    if record.valid & needed != needed || !record.strobe().iter().all(|x| x.is_finite()) {
        return None;
    }
    let cycle = refine(&cell.trajectory(record.strobe()), StrobeMap::Periods(period))?;
    let is_slow = status(record) == Status::Slow;
    let reach = if is_slow { rules::recurrence_distance() } else { rules::ON_CYCLE };
    let distance = cell.apart(&record.strobe(), &cycle.state);
    let is_there = distance <= ROUNDING_FACTOR * reach;
    let time = f64::from(period) * cell.flow.period;
    let status = if is_slow { Status::Ok.code() } else { record.status };
    // The lane's averages end at the strobe state. With a negative multiplier they began on the other side of the cycle.
    let turns = cycle.multipliers.first().is_some_and(|[re, _]| *re < 0.0);
    let before = |i: usize| if turns { 2.0 * cycle.state[i] - record.strobe[i] } else { record.strobe[i] };
    let began = std::array::from_fn(before);
    let settled = Record { lyapunov: cycle.exponent(cell.flow.period), status, ..record.clone() };
    (is_there && is_within_scatter(cell, began, record.lyapunov * time, period))
        .then_some((settled, distance))
}

/// Whether rounding explains a multiplier. Its logarithm `log_multiplier` must lie in the range that the reference computes from this state
/// if rounding perturbs the motion in each period.
fn is_within_scatter(cell: &Cell<'_>, state: State, log_multiplier: f64, period: u32) -> bool {
    let mut read = cell.multipliers_from(state, period);
    // A multiplier of zero counts as the smallest that can be resolved.
    let none = cell.bars.none();
    read.iter_mut().filter(|log| **log == f64::NEG_INFINITY).for_each(|log| *log = none);
    if read.is_empty() || !read.iter().all(|log| log.is_finite()) {
        return false;
    }
    let least = read.iter().copied().fold(f64::INFINITY, f64::min);
    let most = read.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A few samples underestimate their range, so it is extended by its own width on both sides.
    let nearest = log_multiplier.clamp(least - (most - least), most + (most - least));
    cell.bars.is_same_multiplier(log_multiplier, nearest, f64::from(period))
}

/// Whether an event of a cycle lies at phase 0 within the engine's resolution.
pub(super) fn meets_strobe(cell: &Cell<'_>, state: State, period: u32) -> bool {
    let mut trajectory = cell.trajectory(state);
    let mut met = Times::default();
    if (0..period).any(|_| trajectory.advance_period(&mut met).is_err()) {
        return false;
    }
    let bar = ROUNDING_FACTOR * rules::on_strobe(cell.precision);
    met.0.iter().any(|t| {
        let turns = t / cell.flow.period;
        apart(turns, turns.round()) < bar
    })
}

/// Times of events since phase 0.
#[derive(Default)]
struct Times(Vec<f64>);

impl Observer for Times {
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        self.0.push(event.t);
    }
}
