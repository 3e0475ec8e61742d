//! Events of a trajectory, reasons for its end, and counters of its work.

use std::ops::AddAssign;

use super::machine::{Flight, MachineEvent, SlipEvent};
use super::side_of;
use crate::flow::Gap;
use crate::model::Side;

/// Largest number of events in one forcing period.
pub const EVENTS_PER_PERIOD_CAP: u64 = 1_000_000;

/// Largest number of steps in one forcing period, including those that are halved: some tenths of a second.
pub const STEPS_PER_PERIOD_CAP: u64 = 20_000_000;

/// The reason why a trajectory cannot be continued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stop {
    /// More than [`EVENTS_PER_PERIOD_CAP`] events in one period, or more events than the
    /// [`Allowance`](super::Allowance).
    #[error(
        "more than {EVENTS_PER_PERIOD_CAP} events in one forcing period, or more events than one cell may take"
    )]
    CapEvents,
    /// A root that does not converge, or more than [`STEPS_PER_PERIOD_CAP`] steps in one period.
    #[error("more than {STEPS_PER_PERIOD_CAP} steps in one forcing period, or a root that does not converge")]
    CapRoot,
    /// More steps in total than the [`Allowance`](super::Allowance).
    #[error("too stiff: more steps than one cell may take")]
    TooStiff,
    /// The state is not finite.
    #[error("the state is not finite")]
    NonFinite,
    /// A displacement exceeds [`Flow::escape`](crate::flow::Flow::escape).
    #[error("the motion grows without bound")]
    Escape,
}

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EventKind {
    /// A contact after which motion stays free.
    Impact,
    /// A contact after which the teeth mesh.
    MeshStart,
    /// Meshing ends and free motion follows.
    MeshEnd,
}

/// An event in gap coordinates.
#[derive(Clone, Copy, Debug)]
pub struct GapEvent {
    /// What happened.
    pub kind: EventKind,
    /// The wall at which it happened.
    pub side: Side,
    /// The interval between walls after the event, [`Flow::interval`](crate::flow::Flow).
    pub(crate) interval: i32,
    /// Symbol `b'1'..=b'6'` of the flight that ends here; none for the first flight, which comes from no wall.
    pub symbol: Option<u8>,
    /// Number of completed forcing periods.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// Gap coordinates just before the event.
    pub before: Gap,
    /// Gap coordinates just after the event.
    pub after: Gap,
    /// Whether the event ends an infinite series of impacts, which the trajectory replaced by its limit.
    pub(crate) ends_series: bool,
}

impl GapEvent {
    /// Returns the side of the contact that lasts after the event, if one does.
    pub fn meshing_after(&self) -> Option<Side> {
        match self.kind {
            EventKind::MeshStart => Some(self.side),
            EventKind::Impact | EventKind::MeshEnd => (self.interval != 0).then(|| side_of(self.interval)),
        }
    }
}

/// Receives the events of a trajectory. `()` ignores them, a vector stores those at walls. Machines have events of their own.
pub trait Observer {
    /// Receives one event at a wall. Events come in order of time.
    fn event(&mut self, event: &GapEvent);

    /// Whether events of machines at walls are to be reported.
    fn sees_events(&self) -> bool {
        true
    }

    /// Receives one event of a machine at a wall.
    fn machine_event(&mut self, _: &MachineEvent) {}

    /// Receives one change of a friction mode of a machine, in order of time with the events at walls.
    fn machine_slip(&mut self, _: &SlipEvent) {}

    /// Whether flights and losses of machines are to be reported.
    fn measures(&self) -> bool {
        false
    }

    /// Receives a flight of a machine, within one domain.
    fn machine_flight(&mut self, _: &Flight<'_>) {}

    /// Receives the energy that a machine loses at an instant: in impacts, and in springs of contacts that end.
    fn machine_loss(&mut self, _: f64) {}
}

impl Observer for () {
    #[inline]
    fn event(&mut self, _: &GapEvent) {}

    fn sees_events(&self) -> bool {
        false
    }
}

impl Observer for Vec<GapEvent> {
    fn event(&mut self, event: &GapEvent) {
        self.push(*event);
    }
}

/// Counters of the work of a trajectory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Trial steps, including those that were halved.
    pub steps: u64,
    /// Steps that were halved.
    pub halvings: u64,
    /// Events: impacts, starts and ends of meshing, changes of friction modes.
    pub events: u64,
    /// Impacts alone.
    pub impacts: u64,
    /// Iterations of root searches on Taylor polynomials.
    pub root_iterations: u64,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Work) {
        self.steps += other.steps;
        self.halvings += other.halvings;
        self.events += other.events;
        self.impacts += other.impacts;
        self.root_iterations += other.root_iterations;
    }
}
