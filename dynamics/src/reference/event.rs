//! What a trajectory reports: its events, why it ended, and the work it took.

use std::ops::AddAssign;

use crate::flow::Gap;
use crate::model::Side;

/// Events allowed in one forcing period.
pub const EVENTS_PER_PERIOD_CAP: u64 = 1_000_000;

/// Steps allowed in one forcing period, halved ones included: some tenths of a second.
pub const STEPS_PER_PERIOD_CAP: u64 = 20_000_000;

/// Why a trajectory could not be continued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stop {
    /// More than [`EVENTS_PER_PERIOD_CAP`] events in one period, or than the [`Allowance`](super::Allowance) has.
    #[error("more than {EVENTS_PER_PERIOD_CAP} events in one forcing period, or than one cell is allowed")]
    CapEvents,
    /// A root that does not converge, or more than [`STEPS_PER_PERIOD_CAP`] steps in one period.
    #[error("more than {STEPS_PER_PERIOD_CAP} steps in one forcing period, or a root that does not converge")]
    CapRoot,
    /// More steps in all than the [`Allowance`](super::Allowance) has.
    #[error("too stiff: more steps than one cell is allowed")]
    TooStiff,
    /// The state is not finite any more.
    #[error("the state is not finite any more")]
    NonFinite,
}

/// What an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EventKind {
    /// A contact after which motion stays free.
    Impact,
    /// A contact after which the teeth mesh.
    MeshStart,
    /// Meshing ends and free motion follows.
    MeshEnd,
}

/// An event as the integrator meets it, in gap coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Happening {
    /// What happened.
    pub kind: EventKind,
    /// At which wall.
    pub side: Side,
    /// Symbol `b'1'..=b'6'` of the flight that ends here; none for the first flight of all,
    /// which comes from no wall.
    pub symbol: Option<u8>,
    /// Forcing periods completed before.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// Gap coordinates just before.
    pub before: Gap,
    /// Gap coordinates just after.
    pub after: Gap,
}

/// Is told of every event. `()` ignores them.
pub trait Observer {
    /// Called once per event, in order of time.
    fn event(&mut self, happening: &Happening);
}

impl Observer for () {
    #[inline]
    fn event(&mut self, _: &Happening) {}
}

impl Observer for Vec<Happening> {
    fn event(&mut self, happening: &Happening) {
        self.push(*happening);
    }
}

/// Work done so far: what a change in cost shows up in first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Steps tried, halved ones included.
    pub steps: u64,
    /// Steps that had to be halved.
    pub halvings: u64,
    /// Events: impacts, starts and ends of meshing.
    pub events: u64,
    /// Impacts among them.
    pub impacts: u64,
    /// Iterations on exact Taylor polynomials.
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
