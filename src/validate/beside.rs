//! What a record says that was read beside its cycle.
//!
//! A lane reads multipliers where it stands: near the cycle, or on the way to it where it calls the approach slow.
//! Where the strobe map is bent, or amplifies rounding, they are not the cycle's. What was read is right if the
//! reference reads the same there, and it belongs to the cycle that lies there.

use super::cell::{Cell, FACTOR};
use crate::gpu::rules;
use crate::record::classify::{classify, status};
use crate::record::distance::apart;
use crate::record::{Record, valid};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::orbit::{Class, Status};
use rattlemap_dynamics::reference::{Allowance, GapEvent, Trajectory};
use rattlemap_dynamics::stability::{StrobeMap, refine};

/// A record of a cycle as it would be on the cycle, if the reference confirms its exponent where it stands; none
/// otherwise.
pub(super) fn on_its_cycle(cell: &Cell<'_>, record: &Record) -> Option<Record> {
    let Class::Periodic { period } = classify(record) else { return None };
    let said = valid::STROBE | valid::LYAPUNOV;
    if record.valid & said != said || !record.strobe.iter().all(|x| x.is_finite()) {
        return None;
    }
    let seed = Trajectory::<0>::new(&cell.flow, cell.law, record.strobe)
        .allowing(Allowance::UNLIMITED.until(cell.halt));
    let cycle = refine(&seed, StrobeMap::Periods(period))?;
    let is_slow = status(record) == Status::Slow;
    let reach = if is_slow { rules::recurrence_distance() } else { rules::ON_CYCLE };
    let is_there = cell.apart(&record.strobe, &cycle.state) <= FACTOR * reach;
    let time = f64::from(period) * cell.flow.period;
    let status = if is_slow { Status::Ok.code() } else { record.status };
    // The cycle that was read ends at the strobe; where the multiplier is negative, it began on the other side.
    let turns = cycle.multipliers.first().is_some_and(|[re, _]| *re < 0.0);
    let before = |i: usize| if turns { 2.0 * cycle.state[i] - record.strobe[i] } else { record.strobe[i] };
    let began = std::array::from_fn(before);
    (is_there && may_be_read(cell, began, record.lyapunov * time, period)).then(|| Record {
        lyapunov: cycle.exponent(cell.flow.period),
        status,
        ..*record
    })
}

/// Whether a multiplier, as a logarithm, may be read along the motion from a state: what the reference reads scatters
/// where every period rounds, and the record's reading is one of them.
fn may_be_read(cell: &Cell<'_>, state: State, said: f64, period: u32) -> bool {
    let mut read = cell.multipliers_from(state, period);
    // A multiplier that vanishes is one that is as good as zero.
    let none = cell.bars.none();
    read.iter_mut().filter(|log| **log == f64::NEG_INFINITY).for_each(|log| *log = none);
    if read.is_empty() || !read.iter().all(|log| log.is_finite()) {
        return false;
    }
    let least = read.iter().copied().fold(f64::INFINITY, f64::min);
    let most = read.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // As far again: a few readings do not show all of their range.
    let nearest = said.clamp(least - (most - least), most + (most - least));
    cell.bars.is_same_multiplier(said, nearest, f64::from(period))
}

/// Whether an event of a cycle lies on phase 0, as far as the engine can tell.
pub(super) fn meets_strobe(cell: &Cell<'_>, state: State, period: u32) -> bool {
    let mut trajectory =
        Trajectory::<0>::new(&cell.flow, cell.law, state).allowing(Allowance::UNLIMITED.until(cell.halt));
    let mut met: Vec<GapEvent> = Vec::new();
    if (0..period).any(|_| trajectory.advance_period(&mut met).is_err()) {
        return false;
    }
    let bar = FACTOR * rules::on_strobe(cell.precision);
    met.iter().any(|happening| {
        let turns = happening.t / cell.flow.period;
        apart(turns, turns.round()) < bar
    })
}
