//! The motion of an oscillator from event to event, with one interface for both engines.
//!
//! [`Flow`] prepares an oscillator and [`Trajectory`] follows a motion; these two are the only types that know both engines,
//! [`crate::pair`] and [`crate::machine`]. All other code uses these types. The engines use the other modules: events and their observers,
//! reasons for an end, the clock, limits of work.
//!
//! There is no time-stepping error and no event is missed. Every loop has a cap; [`Stop`] lists the reasons why a motion can end.

mod allowance;
mod clock;
mod event;
mod flow;
mod slip;
mod sums;
mod trajectory;

pub use allowance::Allowance;
pub(crate) use clock::Clock;
pub(crate) use event::Remark;
pub use event::{
    EVENTS_PER_PERIOD_CAP, EventKind, GapEvent, Observer, STEPS_PER_PERIOD_CAP, SlipEvent, SlipKind, States,
    Stop, Work,
};
pub use flow::{Engine, Flow};
pub use slip::{Slip, Slips};
pub(crate) use sums::{Contacts, GapSums, Moments, nodes, root, share};
pub use sums::{DISPLACEMENTS, Sums, place_of_displacement, place_of_gap, place_of_signal};
pub(crate) use trajectory::Flights;
pub use trajectory::Trajectory;

/// Approach speeds below this, relative to the scale of length times the rate of free motion, count as near grazing if the load pulls away
/// from the wall. The saltation matrix is proportional to the inverse of the approach speed.
pub const GRAZING_SPEED: f64 = 4e-5;

/// Longest duration of a series of impacts that is replaced by its limit, in radians of the fastest rate of free motion. The error is of
/// third order in the duration.
pub const CLOSING_ANGLE: f64 = 1e-4 * 1.6;

/// Mesh speeds below this, relative to the scale of length times the rate of free motion, count as zero: in f64, a series of impacts does
/// not reach them.
pub const NO_THRESHOLD: f64 = 1e-10;

/// Speeds below this at an event, relative to the scale of length times the rate of free motion, make the linearisation meaningless.
pub const NO_SPEED: f64 = 1e-14;

/// Largest entry of a state that counts as finite.
pub(crate) const HUGE: f64 = 1e150;
