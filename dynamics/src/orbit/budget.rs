//! How long a cell of a map is integrated, and how sure one must be to stop before.

use super::Settings;
use super::analysis::TANGENT_PERIODS;
use crate::reference::Allowance;

/// An exponent that is shown accumulates from this period on, or from the end of a shorter
/// transient.
const SHOWN_EXPONENT_FROM: u32 = 100;

/// One that only tells chaos from the rest may contain more of the transient, and its tangent
/// vector may take fewer periods to turn: by then nearly all cycles have been found.
const EXPONENT_FROM: u32 = 50;
const HASTY_TANGENT_PERIODS: u32 = 18;

/// With early stops chaos is called before the budget is spent if the exponent exceeds zero by
/// this many standard errors (five, where an exponent is shown, save 3 % of the periods, and call a
/// transient chaos in one cell of 20,000 more) ...
const EARLY_CHAOS_ERRORS: f64 = 6.0;
const HASTY_CHAOS_ERRORS: f64 = 5.0;

/// ... after this fraction of the budget, in eighths: of 20,000 cells 38 transients are taken
/// for chaos so, 33 if it is half, 17 if all of it is spent. Without an exponent to show, 46.
const EARLY_CHAOS_FROM: u32 = 3;
const HASTY_CHAOS_FROM: u32 = 2;

/// Periods, at least, over which an exponent is averaged before chaos is called early.
const LEAST_AVERAGED: u32 = 32;

/// Steps and events that a cell may take for each of the periods that it may take: a thousand times what gears take in
/// one. Of 528 periods' worth, a core takes some tenths of a second.
const STEPS_PER_PERIOD: u64 = 20_000;
const EVENTS_PER_PERIOD: u64 = 2_000;

/// How long one cell is integrated, and what for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Periods of transient and observation, and the longest cycle.
    pub settings: Settings,
    /// Whether the cell may stop as soon as its class is certain; otherwise exactly
    /// `transient_periods + observed_periods` are integrated.
    pub early_stop: bool,
    /// Periods beyond these for cells that are undecided by then; with early stops alone.
    pub undecided_periods: u32,
    /// Whether motion that is not periodic gets an exponent. It costs a tangent vector.
    pub exponent: bool,
    /// Whether that exponent is shown; otherwise it need only be sure that it is positive.
    pub shows_exponent: bool,
}

impl Budget {
    /// Forcing periods of a cell that is decided by then.
    pub fn periods(&self) -> u32 {
        self.settings.transient_periods.saturating_add(self.settings.observed_periods)
    }

    /// Forcing periods of a cell that takes longest.
    pub fn longest(&self) -> u32 {
        let more = if self.early_stop { self.undecided_periods } else { 0 };
        self.periods().saturating_add(more)
    }

    /// Work that one cell may take, searches for cycles included.
    pub fn allowance(&self) -> Allowance<'static> {
        let longest = u64::from(self.longest());
        let [steps, events] = [STEPS_PER_PERIOD, EVENTS_PER_PERIOD].map(|share| share * longest);
        Allowance { steps, events, ..Allowance::UNLIMITED }
    }

    /// The period from which the exponent accumulates.
    pub fn exponent_from(&self) -> u32 {
        let from = if self.shows_exponent { SHOWN_EXPONENT_FROM } else { EXPONENT_FROM };
        from.min(self.settings.transient_periods)
    }

    /// The period from which a tangent vector is carried.
    pub(super) fn tangent_from(&self) -> u32 {
        let turning = if self.shows_exponent { TANGENT_PERIODS } else { HASTY_TANGENT_PERIODS };
        self.exponent_from().saturating_sub(turning)
    }

    /// The first period at which chaos may be called, with early stops.
    pub fn chaos_from(&self) -> u32 {
        let eighths = if self.shows_exponent { EARLY_CHAOS_FROM } else { HASTY_CHAOS_FROM };
        let from = (self.periods() / 8 * eighths).max(self.settings.observed_periods);
        from.max(self.exponent_from() + LEAST_AVERAGED)
    }

    /// Standard errors by which the exponent must exceed zero then.
    pub fn chaos_errors(&self) -> f64 {
        if self.shows_exponent { EARLY_CHAOS_ERRORS } else { HASTY_CHAOS_ERRORS }
    }
}
