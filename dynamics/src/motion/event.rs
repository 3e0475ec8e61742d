//! Events of a trajectory, reasons for its end, and counters of its work.

use std::ops::AddAssign;

use super::{Slips, Sums};
use crate::model::{Side, State};
use crate::named;

/// Largest number of events in one forcing period.
pub const EVENTS_PER_PERIOD_CAP: u64 = 1_000_000;

/// Largest number of steps in one forcing period, including those that are halved. They take some tenths of a second.
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
    /// A displacement exceeds [`Flow::escape`](super::Flow::escape).
    #[error("the motion grows without bound")]
    Escape,
}

named! {
    /// The kind of an event.
    pub enum EventKind {
        /// A contact after which motion stays free.
        Impact = "impact",
        /// A contact after which the teeth mesh.
        MeshStart = "mesh_start",
        /// Meshing ends and free motion follows.
        MeshEnd = "mesh_end",
    }
}

named! {
    /// The kind of a change of friction.
    pub enum SlipKind {
        /// Sliding ends, and sticking begins.
        Stick = "stick",
        /// Sticking ends, and sliding begins.
        Slip = "slip",
        /// The direction of sliding changes without sticking.
        Reversal = "reversal",
    }
}

/// An event at a wall of a gap.
#[derive(Clone, Copy, Debug)]
pub struct GapEvent {
    /// Index of the gap, 0 if there is one.
    pub gap: usize,
    /// What happened.
    pub kind: EventKind,
    /// The side of the wall.
    pub side: Side,
    /// Symbol of the flight of this gap that ends here: `b'1'..=b'6'` if there is one gap, else [`of_gap`](crate::word::of_gap). None for the
    /// first flight, which comes from no wall.
    pub symbol: Option<u8>,
    /// Number of completed forcing periods.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// Gap and rate of the gap just before the event; for a pair also the other displacement and its velocity.
    pub before: [f64; 4],
    /// These values just after the event.
    pub after: [f64; 4],
    /// Side of this gap's lasting contact after the event, if there is one.
    pub meshing: Option<Side>,
    /// Whether the law of restitution applied.
    pub has_impact: bool,
    /// A code for the kind, the wall, and whether the gap was on the wall. Itineraries are hashed from these codes.
    pub(crate) code: u64,
    /// Whether the event ends an infinite series of impacts, which the trajectory replaced by its limit.
    pub(crate) ends_series: bool,
}

/// A change of the mode of dry friction.
#[derive(Clone, Copy, Debug)]
pub struct SlipEvent {
    /// Index of the element whose mode changed.
    pub element: usize,
    /// What happened.
    pub kind: SlipKind,
    /// Modes of all elements of the model after the event.
    pub slips: Slips,
    /// Symbol `b'7'` if a phase of sticking ends, and `b'0'` if sliding reverses without sticking.
    pub symbol: Option<u8>,
    /// Number of completed forcing periods.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// State, `(x1, v1, x2, v2, ...)`.
    pub at: State,
}

/// Returns the states just before and just after an event. Calling the function computes them.
pub type States<'a> = &'a dyn Fn() -> [State; 2];

/// Receives the events of a motion, in order of time. `()` ignores them, a vector stores those at walls.
pub trait Observer {
    /// Receives one event at a wall.
    fn event(&mut self, event: &GapEvent, states: States<'_>);

    /// Whether a machine must report its events at walls to this observer.
    fn sees_events(&self) -> bool {
        true
    }

    /// Receives one change of a friction mode.
    fn slip(&mut self, _: &SlipEvent) {}

    /// Returns the integrals and extremes to which a machine adds its flights and losses of energy; none if they are not requested. For a
    /// pair they are computed from its events.
    fn sums(&mut self) -> Option<&mut Sums> {
        None
    }
}

impl Observer for () {
    #[inline]
    fn event(&mut self, _: &GapEvent, _: States<'_>) {}

    fn sees_events(&self) -> bool {
        false
    }
}

/// In a page all observers share one copy of the code.
#[cfg(target_arch = "wasm32")]
impl Observer for &mut dyn Observer {
    fn event(&mut self, event: &GapEvent, states: States<'_>) {
        (**self).event(event, states);
    }

    fn sees_events(&self) -> bool {
        (**self).sees_events()
    }

    fn slip(&mut self, event: &SlipEvent) {
        (**self).slip(event);
    }

    fn sums(&mut self) -> Option<&mut Sums> {
        (**self).sums()
    }
}

impl Observer for Vec<GapEvent> {
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        self.push(*event);
    }
}

/// What makes a motion doubtful, in increasing order of rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Remark {
    /// A nonlinear spring was deformed beyond the range of its points.
    OutOfRange,
    /// Two gaps reached their walls at the same time, so that their order in the model decided the motion.
    Tie,
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
