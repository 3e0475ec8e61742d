//! One trajectory, read: its class, its cycle and the events on it.
//!
//! [`analyse`] lets a transient pass, watches the strobe states for a recurrence, and has
//! every candidate confirmed twice: Newton must find a stable cycle of that period close
//! by, and the trajectory must be seen to approach it. Recurrence alone proves nothing,
//! since decaying spirals come close to themselves at lags that are no period; on the
//! refined cycle the period is simply its smallest divisor that closes.

mod analysis;
mod approach;
mod budget;
mod cell;
mod instant;
mod itinerary;
mod prospects;
#[cfg(test)]
mod reached;
mod reading;
mod recurrence;
mod trace;

pub use analysis::{
    CHAOS_ERRORS, ESCAPE_GROWTH, SHOWN_PERIODS, analyse, analyse_flow, analyse_over, analyse_until, status_of,
};
pub use approach::{LINEAR, SHOWN_CYCLES};
pub use budget::Budget;
pub use cell::{Measured, NEUTRAL_ORDER, measure, measure_until};
pub use instant::{LONGEST_TIME, state_at};
pub use reading::ON_STROBE_TURNS;
pub use trace::trace;

use crate::model::{Side, State};
use crate::word::Word;

pub use crate::reference::EventKind;

/// One event on a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// What happened.
    pub kind: EventKind,
    /// At which wall.
    pub side: Side,
    /// Time since phase 0 of the cycle (of the first period observed).
    pub t: f64,
    /// Time since the last phase 0, in `[0, T)`.
    pub t_mod_period: f64,
    /// State just before.
    pub before: State,
    /// State just after; equal to `before` where meshing ends.
    pub after: State,
}

/// What kind of motion a cell settles on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// A stable periodic orbit of `period` forcing periods.
    Periodic {
        /// Forcing periods per cycle, at least 1.
        period: u32,
    },
    /// A motion that is not periodic, with a positive Lyapunov exponent over the periods integrated.
    Chaotic,
    /// Neither was shown within the periods allowed.
    Undecided,
    /// The integration ended early; the status says why.
    Failed,
}

impl Class {
    /// The names of all classes, in the order in which they are counted and numbered.
    pub const NAMES: [&'static str; 4] = ["periodic", "chaotic", "undecided", "failed"];

    /// Its place among [`Class::NAMES`], whatever its period.
    pub fn index(self) -> usize {
        match self {
            Class::Periodic { .. } => 0,
            Class::Chaotic => 1,
            Class::Undecided => 2,
            Class::Failed => 3,
        }
    }

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        Class::NAMES[self.index()]
    }
}

/// How a cell's integration ended. Those of `Failed` cells are [failures](Status::is_failure).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// Nothing to remark.
    Ok,
    /// Convergence so slow that the class rests on Newton, or was not reached at all.
    Slow,
    /// An event so near to grazing that the linearisation loses its meaning.
    NearGrazing,
    /// An event lies on the strobe phase.
    StrobeOnEvent,
    /// More events in one period than the cap allows.
    CapEvents,
    /// More steps or root iterations than the cap allows.
    CapRoot,
    /// Too stiff for this engine.
    TooStiff,
    /// The state left the range of finite numbers.
    NonFinite,
    /// Points of the cycle lie closer together than the engine can tell apart: its period may be a divisor.
    BelowResolution,
}

impl Status {
    /// Every status; its position is its code in records and tables.
    pub const ALL: [Status; 9] = [
        Status::Ok,
        Status::Slow,
        Status::NearGrazing,
        Status::StrobeOnEvent,
        Status::CapEvents,
        Status::CapRoot,
        Status::TooStiff,
        Status::NonFinite,
        Status::BelowResolution,
    ];

    /// The name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Status::Ok => "ok",
            Status::Slow => "slow",
            Status::NearGrazing => "near_grazing",
            Status::StrobeOnEvent => "strobe_on_event",
            Status::CapEvents => "cap_events",
            Status::CapRoot => "cap_root",
            Status::TooStiff => "too_stiff",
            Status::NonFinite => "non_finite",
            Status::BelowResolution => "below_resolution",
        }
    }

    /// Whether the integration could not be continued.
    pub fn is_failure(self) -> bool {
        matches!(self, Status::CapEvents | Status::CapRoot | Status::TooStiff | Status::NonFinite)
    }

    /// The number that stands for it in records and tables.
    pub fn code(self) -> u32 {
        self as u32
    }

    /// The status that a number stands for.
    pub fn from_code(code: u32) -> Option<Status> {
        Status::ALL.get(code as usize).copied()
    }
}

/// A trajectory's long-time behaviour.
#[derive(Clone, Debug)]
pub struct Orbit {
    /// What it is.
    pub class: Class,
    /// How the integration ended.
    pub status: Status,
    /// Largest Lyapunov exponent per unit time.
    pub lyapunov: f64,
    /// Its standard error where it is an average; none for periodic orbits.
    pub lyapunov_error: Option<f64>,
    /// Floquet multipliers `(re, im)` of a periodic orbit, largest modulus first.
    pub floquet: Option<Vec<[f64; 2]>>,
    /// Whether a periodic orbit is its own mirror image.
    pub symmetric: Option<bool>,
    /// The cyclic word of a periodic orbit; of the last periods observed otherwise.
    pub word: Word,
    /// Impacts per forcing period; starts of meshing are not counted.
    pub impacts_per_period: f64,
    /// Fraction of the time spent meshing.
    pub mesh_fraction: f64,
    /// State at the phase 0 that precedes the first of `events`.
    pub strobe: State,
    /// The wall the teeth mesh on at that instant, if they do.
    pub strobe_meshing: Option<Side>,
    /// The events of one cycle, or of the last periods observed, in order of time.
    pub events: Vec<Event>,
    /// Forcing periods that `events` and `word` span.
    pub cycle_periods: u32,
    /// The forcing period `T`.
    pub forcing_period: f64,
    /// Forcing periods that the motion was followed for, from its start through all checks of it; searches
    /// beside it are not among them.
    pub periods_run: u64,
}

/// One point of a densely sampled trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time since the phase 0 at which the trace starts.
    pub t: f64,
    /// State.
    pub state: State,
    /// The wall the teeth mesh on, if they do.
    pub meshing: Option<Side>,
}

/// How long to integrate and what to search for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Forcing periods to let pass before anything is observed.
    pub transient_periods: u32,
    /// Forcing periods to observe.
    pub observed_periods: u32,
    /// Longest period, in forcing periods, that is searched for.
    pub max_period: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { transient_periods: 400, observed_periods: 128, max_period: 64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_codes_go_both_ways() {
        for (code, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!(status.code(), code as u32);
            assert_eq!(Status::from_code(code as u32), Some(status));
        }
        assert_eq!(Status::from_code(9), None);
    }
}
