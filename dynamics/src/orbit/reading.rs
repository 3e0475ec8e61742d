//! The events of a trajectory over a number of forcing periods, and averages over them.

use super::itinerary::{Itinerary, Recorder};
use super::quantities::{Meter, Quantities};
use super::{Event, SlipPoint};
use crate::model::{Side, State};
use crate::motion::{
    EventKind, Flow, GapEvent, Observer, Remark, SlipEvent, States, Stop, Sums, Trajectory, share,
};
use crate::word::Word;

/// Largest distance from phase 0, in turns, of an event that lies on the strobe.
pub const ON_STROBE_TURNS: f64 = 1e-9;

/// The events of a trajectory over a number of forcing periods, and averages over them.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub(super) strobe: State,
    pub(super) strobe_meshing: Option<Side>,
    pub(super) events: Vec<Event>,
    pub(super) slips: Vec<SlipPoint>,
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
    pub(super) remark: Option<Remark>,
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
        trajectory.forget_shifts();
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
            meter: measures.then(|| Meter::new(&first, periods)).transpose()?,
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
            mesh_fraction: share(trajectory.meshing_time() - mesh_start, span * flow.period),
            quantities: meter.map(|meter| meter.finish(trajectory.period())),
            itineraries: recorders.into_iter().map(|recorder| recorder.itinerary).collect(),
            closes: trajectory.is_in_domain_of(&first),
            near_grazing: trajectory.near_grazing(),
            remark: trajectory.remark(),
            // Rounding may put an event at phase 0 outside the cycle.
            on_strobe: [&first, &*trajectory]
                .into_iter()
                .any(|end| end.passes_wall(ON_STROBE_TURNS * flow.period))
                || times.iter().any(|t| {
                    let turns = t / flow.period;
                    turns < ON_STROBE_TURNS || 1.0 - turns < ON_STROBE_TURNS
                }),
            events: events.events,
            slips: events.slips,
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
    fn event(&mut self, event: &GapEvent, states: States<'_>) {
        self.recorders[(event.period - self.start) as usize].event(event, states);
        self.meter.iter_mut().for_each(|meter| meter.event(event, states));
        self.symbols.extend(event.symbol);
        self.times.push(event.t);
        self.events.event(event, states);
    }

    fn slip(&mut self, event: &SlipEvent) {
        self.recorders[(event.period - self.start) as usize].slip(event);
        self.symbols.extend(event.symbol);
        self.times.push(event.t);
        self.events.slip(event);
    }

    fn sums(&mut self) -> Option<&mut Sums> {
        self.meter.as_mut().and_then(Meter::sums)
    }
}

/// Collects the events at walls and those of friction, with the states of the model.
pub(super) struct EventLog<'f> {
    flow: &'f Flow,
    /// The first period.
    start: u64,
    pub(super) events: Vec<Event>,
    pub(super) slips: Vec<SlipPoint>,
}

impl<'f> EventLog<'f> {
    /// Starts a log of the periods from `start` on.
    pub(super) fn new(flow: &'f Flow, start: u64) -> EventLog<'f> {
        EventLog { flow, start, events: Vec::new(), slips: Vec::new() }
    }

    /// Returns the time of an event since the start, and since the last phase 0. An event that rounding puts at the end of a period lies
    /// at phase 0 of the next period.
    fn times(&self, period: u64, t: f64) -> [f64; 2] {
        let t_mod_period = if t < self.flow.period { t } else { 0.0 };
        [(period - self.start) as f64 * self.flow.period + t, t_mod_period]
    }
}

impl Observer for EventLog<'_> {
    fn event(&mut self, event: &GapEvent, states: States<'_>) {
        let GapEvent { gap, kind, side, meshing, .. } = *event;
        let [before, after] = states();
        let after = if kind == EventKind::MeshEnd { before } else { after };
        let [t, t_mod_period] = self.times(event.period, event.t);
        self.events.push(Event { kind, gap, side, t, t_mod_period, before, after, meshing });
    }

    fn slip(&mut self, event: &SlipEvent) {
        let SlipEvent { element, kind, at, slips, .. } = *event;
        let [t, t_mod_period] = self.times(event.period, event.t);
        self.slips.push(SlipPoint { kind, element, t, t_mod_period, state: at, slips });
    }
}
