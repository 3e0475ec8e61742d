//! What a record says that was read beside its cycle.
//!
//! A lane reads multipliers where it stands: near the cycle, or on the way to it where it calls the approach slow.
//! Where the strobe map is bent they are not the cycle's. What was read is right if the reference reads the same there,
//! and it belongs to the cycle that lies there.

use super::cell::{Cell, FACTOR};
use super::compare::apart;
use crate::gpu::rules;
use crate::record::classify::{classify, status};
use crate::record::{Record, valid};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::orbit::{Class, Status};
use rattlemap_dynamics::reference::{Happening, Trajectory};
use rattlemap_dynamics::stability::{StrobeMap, multipliers, refine};

/// A record of a cycle as it would be if it had been read on the cycle, if the reference confirms what it says where it
/// stands; none otherwise.
pub(super) fn on_its_cycle(cell: &Cell<'_>, record: &Record) -> Option<Record> {
    let Class::Periodic { period } = classify(record) else { return None };
    let said = valid::STROBE | valid::LYAPUNOV;
    if record.valid & said != said || !record.strobe.iter().all(|x| x.is_finite()) {
        return None;
    }
    let map = StrobeMap::Periods(period);
    let seed = Trajectory::<0>::new(&cell.flow, cell.law, record.strobe);
    let read = multipliers(&map.apply(&seed, record.strobe).ok()?.derivative())?;
    let time = f64::from(period) * cell.flow.period;
    let [re, im] = *read.first()?;
    if !cell.bars.is_same_multiplier(re.hypot(im).ln(), record.lyapunov * time, f64::from(period)) {
        return None;
    }
    let cycle = refine(&seed, map)?;
    let reach = if status(record) == Status::Slow { rules::near() } else { rules::ON_CYCLE };
    if cell.apart(&record.strobe, &cycle.state) > FACTOR * reach {
        return None;
    }
    let ends = status(record) == Status::StrobeOnEvent && meets_strobe(cell, cycle.state, period);
    let status = if ends { Status::Ok.code() } else { record.status };
    Some(Record { lyapunov: cycle.exponent(cell.flow.period), status, ..*record })
}

/// Whether an event of a cycle lies on phase 0, as far as the engine can tell.
fn meets_strobe(cell: &Cell<'_>, state: State, period: u32) -> bool {
    let mut trajectory = Trajectory::<0>::new(&cell.flow, cell.law, state);
    let mut met: Vec<Happening> = Vec::new();
    if (0..period).any(|_| trajectory.advance_period(&mut met).is_err()) {
        return false;
    }
    let bar = FACTOR * rules::on_strobe(cell.precision);
    met.iter().any(|happening| {
        let turns = happening.t / cell.flow.period;
        apart(turns, turns.round()) < bar
    })
}
