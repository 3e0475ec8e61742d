//! The events of a trajectory over a number of forcing periods, and averages over them.

use super::Event;
use super::itinerary::{Itinerary, Recorder};
use super::quantities::{Meter, Quantities};
use crate::flow::{DomainKind, Flow};
use crate::model::{Side, State};
use crate::reference::machine::{Flight, MachineEvent, SlipEvent};
use crate::reference::{EventKind, GapEvent, Observer, Stop, Trajectory};
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
            events: EventLog::new(flow, start),
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
            events: events.events,
        })
    }
}

/// Collects the events of a reading.
struct Log<'f> {
    events: EventLog<'f>,
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
        self.events.event(event);
    }

    fn measures(&self) -> bool {
        self.meter.is_some()
    }

    fn machine_flight(&mut self, flight: &Flight<'_>) {
        self.meter.iter_mut().for_each(|meter| meter.machine_flight(flight));
    }

    fn machine_loss(&mut self, energy: f64) {
        self.meter.iter_mut().for_each(|meter| meter.machine_loss(energy));
    }

    fn machine_event(&mut self, event: &MachineEvent) {
        self.meter.iter_mut().for_each(|meter| meter.machine_event(event));
        self.recorders[(event.period - self.start) as usize].machine_event(event);
        self.symbols.extend(event.symbol);
        self.times.push(event.t);
        self.events.machine_event(event);
    }

    fn machine_slip(&mut self, event: &SlipEvent) {
        self.recorders[(event.period - self.start) as usize].machine_slip(event);
        self.symbols.extend(event.symbol);
        self.times.push(event.t);
    }
}

/// Collects the events at walls, with the states of the model.
pub(super) struct EventLog<'f> {
    flow: &'f Flow,
    /// The first period.
    start: u64,
    pub(super) events: Vec<Event>,
}

impl<'f> EventLog<'f> {
    /// Starts a log of the periods from `start` on.
    pub(super) fn new(flow: &'f Flow, start: u64) -> EventLog<'f> {
        EventLog { flow, start, events: Vec::new() }
    }

    fn push(
        &mut self,
        kind: EventKind,
        side: Side,
        (period, t): (u64, f64),
        states: [State; 2],
        meshing: Option<Side>,
    ) {
        // An event at the end of a period, by rounding, is at phase 0 of the next one.
        let within = if t < self.flow.period { t } else { 0.0 };
        let [before, after] = if kind == EventKind::MeshEnd { [states[0]; 2] } else { states };
        let t = (period - self.start) as f64 * self.flow.period + t;
        self.events.push(Event { kind, gap: 0, side, t, t_mod_period: within, before, after, meshing });
    }
}

impl Observer for EventLog<'_> {
    fn event(&mut self, event: &GapEvent) {
        let states = [event.before, event.after].map(|q| self.flow.to_state(q));
        self.push(event.kind, event.side, (event.period, event.t), states, event.meshing_after());
    }

    fn machine_event(&mut self, event: &MachineEvent) {
        let states = [event.before, event.after];
        self.push(event.kind, event.side, (event.period, event.t), states, event.meshing);
        self.events.iter_mut().last().expect("it was just added").gap = event.gap;
    }
}

/// Whether free motion is at a wall within `ON_STROBE_TURNS` of the present time.
fn passes_wall(flow: &Flow, trajectory: &Trajectory<'_, 0>) -> bool {
    if let Some(passes) = trajectory.machine_passes_wall(ON_STROBE_TURNS * flow.period) {
        return passes;
    }
    let q = flow.to_gap(trajectory.state());
    let reach = ON_STROBE_TURNS * flow.period * q[1].abs();
    let between = trajectory.walls();
    let is_near = |side: Side| (q[0] - between[side.index()]).abs() < reach;
    trajectory.domain() == DomainKind::Free && Side::BOTH.into_iter().any(is_near)
}
