//! Reading events off a stretch of a trajectory.

use super::Event;
use super::itinerary::{Itinerary, Recorder};
use crate::flow::Flow;
use crate::model::{Side, State};
use crate::reference::{EventKind, Happening, Stop, Trajectory};
use crate::word::Word;

/// Events closer to phase 0 than this, in turns, count as lying on the strobe.
pub const ON_STROBE_TURNS: f64 = 1e-9;

/// Everything that happens over a number of forcing periods.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub(super) strobe: State,
    pub(super) strobe_meshing: Option<Side>,
    pub(super) events: Vec<Event>,
    /// Of each period.
    pub(super) itineraries: Vec<Itinerary>,
    pub(super) word: Word,
    pub(super) impacts_per_period: f64,
    pub(super) mesh_fraction: f64,
    /// Whether it ends in the domain that it began in: a cycle's state may recur in another.
    pub(super) closes: bool,
    pub(super) near_grazing: bool,
    pub(super) on_strobe: bool,
}

impl Reading {
    /// Reads `periods` forcing periods from here on.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(super) fn take(
        flow: &Flow,
        trajectory: &mut Trajectory<'_, 0>,
        periods: u32,
    ) -> Result<Reading, Stop> {
        let (strobe, strobe_meshing) = (trajectory.state(), trajectory.meshing());
        let begun = trajectory.clone();
        let start = trajectory.period();
        let (mesh_start, impacts_start) = (trajectory.meshing_time(), trajectory.work().impacts);
        trajectory.clear_near_grazing();
        let mut met: Vec<Happening> = Vec::new();
        for _ in 0..periods {
            trajectory.advance_period(&mut met)?;
        }
        let symbols: Vec<u8> = met.iter().filter_map(|happening| happening.symbol).collect();
        let span = f64::from(periods);
        Ok(Reading {
            strobe,
            strobe_meshing,
            word: Word::cyclic(&symbols),
            impacts_per_period: (trajectory.work().impacts - impacts_start) as f64 / span,
            mesh_fraction: (trajectory.meshing_time() - mesh_start) / (span * flow.period),
            itineraries: Recorder::list(flow, &met, start, periods),
            closes: trajectory.is_in_domain_of(&begun),
            near_grazing: trajectory.near_grazing(),
            on_strobe: met.iter().any(|happening| {
                let turns = happening.t / flow.period;
                turns < ON_STROBE_TURNS || 1.0 - turns < ON_STROBE_TURNS
            }),
            events: met.iter().map(|happening| event(flow, happening, start)).collect(),
        })
    }
}

fn event(flow: &Flow, happening: &Happening, start: u64) -> Event {
    // An event within rounding of the next phase 0 belongs to that one.
    let within = if happening.t < flow.period { happening.t } else { 0.0 };
    Event {
        kind: happening.kind,
        side: happening.side,
        t: (happening.period - start) as f64 * flow.period + happening.t,
        t_mod_period: within,
        before: flow.to_state(happening.before),
        after: flow.to_state(if happening.kind == EventKind::MeshEnd {
            happening.before
        } else {
            happening.after
        }),
    }
}
