//! The events of a trajectory over a number of forcing periods, and averages over them.

use super::Event;
use super::itinerary::{Itinerary, Recorder};
use super::quantities::{Meter, Quantities};
use crate::flow::{DomainKind, Flow};
use crate::model::{Side, State};
use crate::reference::{EventKind, FrictionEvent, GapEvent, Observer, Stop, Trajectory};
use crate::word::Word;

/// Largest distance from phase 0, in turns, of an event that lies on the strobe.
pub const ON_STROBE_TURNS: f64 = 1e-9;

/// The events of a trajectory over a number of forcing periods, and averages over them.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub(super) strobe: State,
    pub(super) strobe_meshing: Option<Side>,
    pub(super) events: Vec<Event>,
    /// The itinerary of each period.
    pub(super) itineraries: Vec<Itinerary>,
    pub(super) word: Word,
    pub(super) impacts_per_period: f64,
    pub(super) mesh_fraction: f64,
    /// Measured quantities, if the caller requests them.
    pub(super) quantities: Option<Quantities>,
    /// Whether the motion ends in the domain in which it started. The state alone may recur in another domain.
    pub(super) closes: bool,
    pub(super) near_grazing: bool,
    pub(super) on_strobe: bool,
}

impl Reading {
    /// Advances the trajectory by `periods` forcing periods and collects the events; measures them if `measures`.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub(super) fn take(
        flow: &Flow,
        trajectory: &mut Trajectory<'_, 0>,
        periods: u32,
        measures: bool,
    ) -> Result<Reading, Stop> {
        let (strobe, strobe_meshing) = (trajectory.state(), trajectory.meshing());
        let first = trajectory.clone();
        let start = trajectory.period();
        let (mesh_start, impacts_start) = (trajectory.meshing_time(), trajectory.work().impacts);
        trajectory.clear_near_grazing();
        let mut log = Log {
            events: Vec::new(),
            symbols: Vec::new(),
            start,
            recorders: vec![Recorder::new(flow); periods as usize],
            meter: measures.then(|| Meter::new(flow, &first)),
            times: Vec::new(),
        };
        for _ in 0..periods {
            trajectory.advance_period(&mut log)?;
        }
        let Log { events, symbols, recorders, meter, times, .. } = log;
        let span = f64::from(periods);
        Ok(Reading {
            strobe,
            strobe_meshing,
            word: Word::cyclic(&symbols),
            impacts_per_period: (trajectory.work().impacts - impacts_start) as f64 / span,
            mesh_fraction: (trajectory.meshing_time() - mesh_start) / (span * flow.period),
            quantities: meter.map(|meter| meter.finish(trajectory.period())),
            itineraries: recorders.into_iter().map(|recorder| recorder.itinerary).collect(),
            closes: trajectory.is_in_domain_of(&first),
            near_grazing: trajectory.near_grazing(),
            // Rounding may put an event at phase 0 outside the cycle.
            on_strobe: [&first, &*trajectory].into_iter().any(|end| passes_wall(flow, end))
                || times.iter().any(|t| {
                    let turns = t / flow.period;
                    turns < ON_STROBE_TURNS || 1.0 - turns < ON_STROBE_TURNS
                }),
            events: events.iter().map(|event| in_states(flow, event, start)).collect(),
        })
    }
}

/// Collects the events of a reading.
struct Log<'f> {
    events: Vec<GapEvent>,
    symbols: Vec<u8>,
    /// Number of forcing periods before the reading.
    start: u64,
    /// One recorder for each period.
    recorders: Vec<Recorder>,
    meter: Option<Meter<'f>>,
    /// Times of all events since the last phase 0.
    times: Vec<f64>,
}

impl Observer for Log<'_> {
    fn event(&mut self, event: &GapEvent) {
        self.recorders[(event.period - self.start) as usize].event(event);
        self.meter.iter_mut().for_each(|meter| meter.event(event));
        self.symbols.extend(event.symbol);
        self.times.push(event.t);
        self.events.push(*event);
    }

    fn friction(&mut self, event: &FrictionEvent) {
        self.recorders[(event.period - self.start) as usize].friction(event);
        self.meter.iter_mut().for_each(|meter| meter.friction(event));
        self.symbols.extend(event.symbol);
        self.times.push(event.t);
    }
}

/// Whether free motion is at a wall within `ON_STROBE_TURNS` of the present time.
fn passes_wall(flow: &Flow, trajectory: &Trajectory<'_, 0>) -> bool {
    let q = flow.to_gap(trajectory.state());
    let reach = ON_STROBE_TURNS * flow.period * q[1].abs();
    let between = trajectory.walls();
    let is_near = |side: Side| (q[0] - between[side.index()]).abs() < reach;
    trajectory.domain() == DomainKind::Free && Side::BOTH.into_iter().any(is_near)
}

/// Converts an event to states; `start` is the first period.
pub(super) fn in_states(flow: &Flow, event: &GapEvent, start: u64) -> Event {
    // An event at the end of a period, by rounding, is at phase 0 of the next one.
    let within = if event.t < flow.period { event.t } else { 0.0 };
    let after = if event.kind == EventKind::MeshEnd { event.before } else { event.after };
    Event {
        kind: event.kind,
        side: event.side,
        t: (event.period - start) as f64 * flow.period + event.t,
        t_mod_period: within,
        before: flow.to_state(event.before),
        after: flow.to_state(after),
        meshing: event.meshing_after(),
    }
}
