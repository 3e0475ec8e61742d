//! The class of a motion, its cycle and its events.
//!
//! [`analyse`] integrates a transient and then searches the strobe states for recurrences. Each candidate period is
//! confirmed in two ways: Newton's method must find a stable cycle nearby, and the trajectory must approach that
//! cycle. Recurrence alone is no proof, because a decaying spiral comes close to itself at lags that are not its
//! period. The period of a confirmed cycle is its smallest divisor after which the cycle closes.

mod analysis;
mod approach;
mod budget;
mod cell;
mod history;
mod instant;
mod itinerary;
mod quantities;
mod reading;
mod recurrence;
mod regularity;
mod resolution;
mod run_up;
mod search_filter;
mod section;
#[cfg(test)]
mod tests;
mod trace;
mod unforced;

pub use analysis::{
    CHAOS_ERRORS, ESCAPE_GROWTH, EVENT_PERIODS, LONGEST_WINDOW, NEUTRAL_ORDER, PLAIN_GROWTH, SHARED_GROWTH,
    analyse, analyse_flow, analyse_until, status_of,
};
pub use approach::{BRANCH_CYCLES, LINEAR_TOLERANCE};
pub use budget::Budget;
pub use cell::{LEAST_SERIES, Measurement, RARE_SERIES, measure, measure_at_section, measure_until};
pub use history::{History, Stopped, history};
pub use instant::{LONGEST_TIME, is_reached, state_at};
pub use itinerary::NEAR_STROBE_TURNS;
pub use quantities::{
    Approaches, Displacement, FrictionQuantities, GapQuantities, Quantities, quantities_after, quantities_on,
};
pub use reading::ON_STROBE_TURNS;
pub use regularity::{LARGEST_DIFFERENCE, LEAST_RECURRENCE, LEAST_WINDOW, ROUNDING_OF_AVERAGES};
pub use resolution::rounding_decides;
pub use run_up::run_up;
use section::Section;
pub use trace::trace;

use crate::model::{Side, State};
use crate::motion::{Remark, Slips};
use crate::named;
use crate::word::Word;

pub use crate::motion::{
    DISPLACEMENTS, EventKind, SlipKind, place_of_displacement, place_of_gap, place_of_signal,
};

/// One event on a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// What happened.
    pub kind: EventKind,
    /// Index of the gap, 0 if there is one.
    pub gap: usize,
    /// The wall at which it happened.
    pub side: Side,
    /// Time since phase 0 of the first period of the cycle or window; in a [`History`] since the start.
    pub t: f64,
    /// Time since the last phase 0, in `[0, T)`.
    pub t_mod_period: f64,
    /// State just before the event.
    pub before: State,
    /// State just after the event; equal to `before` where meshing ends.
    pub after: State,
    /// Side of the lasting contact after the event, if there is one.
    pub meshing: Option<Side>,
}

/// One change of friction on a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlipPoint {
    /// What happened.
    pub kind: SlipKind,
    /// Index of the element with dry friction.
    pub element: usize,
    /// Time since phase 0 of the first period of the cycle or window; in a [`History`] since the start.
    pub t: f64,
    /// Time since the last phase 0, in `[0, T)`.
    pub t_mod_period: f64,
    /// State.
    pub state: State,
    /// Modes of all elements after the change.
    pub slips: Slips,
}

/// The class of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// A stable periodic orbit of `period` forcing periods.
    Periodic {
        /// Forcing periods per cycle, at least 1.
        period: u32,
    },
    /// A motion that is not periodic and has a positive Lyapunov exponent.
    Chaotic,
    /// Neither a period nor chaos could be shown within the allowed periods.
    Undecided,
    /// The integration ended early; the status gives the reason.
    Failed,
    /// Regular motion on a torus: neither periodic nor chaotic.
    QuasiPeriodic,
}

impl Class {
    /// Names of all classes, in the order of their indices.
    pub const NAMES: [&'static str; 5] = ["periodic", "chaotic", "undecided", "failed", "quasi-periodic"];

    /// Returns the index of the class in [`Class::NAMES`].
    pub fn index(self) -> usize {
        match self {
            Class::Periodic { .. } => 0,
            Class::Chaotic => 1,
            Class::Undecided => 2,
            Class::Failed => 3,
            Class::QuasiPeriodic => 4,
        }
    }

    /// Returns the name in tables.
    pub fn name(self) -> &'static str {
        Class::NAMES[self.index()]
    }
}

named! {
    /// How the integration of a cell ended. `Failed` cells have a status that is a [failure](Status::is_failure).
    pub enum Status {
        /// No remarks.
        Ok = "ok",
        /// The motion converges so slowly that its class rests on Newton's method, or it is undecided.
        Slow = "slow",
        /// An event is so near to grazing that the linearisation is not reliable.
        NearGrazing = "near_grazing",
        /// An event lies on the strobe phase.
        StrobeOnEvent = "strobe_on_event",
        /// More events in one period than the cap allows.
        CapEvents = "cap_events",
        /// More steps or root iterations than the cap allows.
        CapRoot = "cap_root",
        /// Too stiff for this engine.
        TooStiff = "too_stiff",
        /// The state is not finite.
        NonFinite = "non_finite",
        /// Rounding decides the period: rounding errors grow to the distance between points of the cycle.
        BelowResolution = "below_resolution",
        /// A Floquet multiplier of the cycle has modulus 1 within its error: perturbations neither decay nor grow.
        Neutral = "neutral",
        /// The motion grows without bound: the oscillator has negative damping or stiffness, and no contact stops it.
        Escape = "escape",
        /// A load that exceeds all friction accelerates the motion for ever along a [rigid-body mode](crate::model::RigidMode) without
        /// dampers.
        Accelerates = "accelerates",
        /// The motion stays on an unstable cycle, from which no perturbation leads it away within the budget.
        UnstableCycle = "unstable_cycle",
        /// Two gaps that affect each other reached their walls at the same time, and their order in the model decided the motion.
        Simultaneous = "simultaneous",
        /// A nonlinear spring or a wall's curve was deformed beyond its range, where its last piece goes on.
        OutOfRange = "out_of_range",
    }
}

impl From<Remark> for Status {
    fn from(remark: Remark) -> Status {
        match remark {
            Remark::OutOfRange => Status::OutOfRange,
            Remark::Tie => Status::Simultaneous,
        }
    }
}

impl Status {
    /// Whether the integration could not be continued.
    pub fn is_failure(self) -> bool {
        matches!(
            self,
            Status::CapEvents | Status::CapRoot | Status::TooStiff | Status::NonFinite | Status::Escape
        )
    }

    /// Returns the code in records and tables.
    pub fn code(self) -> u32 {
        self as u32
    }

    /// Returns the status with this code.
    pub fn from_code(code: u32) -> Option<Status> {
        Status::ALL.get(code as usize).copied()
    }
}

/// The long-time behaviour of a motion.
#[derive(Clone, Debug)]
pub struct Orbit {
    /// Class of the motion.
    pub class: Class,
    /// How the integration ended.
    pub status: Status,
    /// Largest Lyapunov exponent per unit time.
    pub lyapunov: f64,
    /// Standard error of the exponent if it is an average; none for periodic orbits.
    pub lyapunov_error: Option<f64>,
    /// Floquet multipliers `(re, im)` of a periodic orbit, largest modulus first.
    pub floquet: Option<Vec<[f64; 2]>>,
    /// Whether a periodic orbit is its own mirror image.
    pub symmetric: Option<bool>,
    /// Cyclic word of a periodic orbit; for other motion, the word of its last periods.
    pub word: Word,
    /// Impacts per forcing period; starts of meshing are not counted.
    pub impacts_per_period: f64,
    /// Fraction of the time spent meshing.
    pub mesh_fraction: f64,
    /// Quantities over the cycle, or over the observed periods that follow aperiodic motion; none if they are not
    /// requested or the motion cannot be continued.
    pub quantities: Option<Quantities>,
    /// State at the phase 0 that precedes the first of `events`.
    pub strobe: State,
    /// The wall of the lasting contact at that instant, if there is one.
    pub strobe_meshing: Option<Side>,
    /// Events at walls of one cycle, or of the last periods, in order of time.
    pub events: Vec<Event>,
    /// Events of friction of the same periods.
    pub slips: Vec<SlipPoint>,
    /// Forcing periods that `events` and `word` span.
    pub cycle_periods: u32,
    /// The forcing period `T`. For a cycle without force, the time of the cycle.
    pub forcing_period: f64,
    /// Time of a cycle without force; none if the motion is at rest.
    pub cycle_time: Option<f64>,
    /// Forcing periods that the motion itself was integrated, without Newton searches.
    pub periods_run: u64,
}

/// One point of a densely sampled trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time since the phase 0 at which the trace starts.
    pub t: f64,
    /// State.
    pub state: State,
    /// The wall of the lasting contact, if there is one.
    pub meshing: Option<Side>,
}

/// Numbers of forcing periods to integrate, and the longest period to search for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Forcing periods of the transient, which is not observed.
    pub transient_periods: u32,
    /// Forcing periods to observe.
    pub observed_periods: u32,
    /// Longest period to search for, in forcing periods.
    pub max_period: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { transient_periods: 400, observed_periods: 128, max_period: 64 }
    }
}
