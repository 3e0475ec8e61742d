//! Integration time of a cell of a map, and the conditions of early stops.

use super::Settings;
use super::analysis::TANGENT_PERIODS;
use crate::motion::Allowance;

/// Period from which a reported exponent accumulates; a shorter transient makes it earlier.
const EXPONENT_FROM: u32 = 100;

/// Period from which the exponent accumulates if it only distinguishes chaos. It may contain more of the transient.
const CLASS_EXPONENT_FROM: u32 = 50;

/// Periods in which the tangent vector turns to the most expanding direction, if the exponent only distinguishes chaos.
const CLASS_TANGENT_PERIODS: u32 = 18;

/// Standard errors by which a reported exponent must exceed zero for an early stop. With five, 3 % of the periods
/// would be saved, and one cell more in 20,000 with transient chaos would count as chaotic.
const EARLY_CHAOS_ERRORS: f64 = 6.0;

/// Standard errors by which an exponent that only distinguishes chaos must exceed zero for an early stop.
const CLASS_CHAOS_ERRORS: f64 = 5.0;

/// Share of the budget, in eighths, after which a cell may stop early as chaotic. Of 20,000 cells, 38 with transient
/// chaos count as chaotic; with half of the budget 33, with all of it 17.
const EARLY_CHAOS_EIGHTHS: u32 = 3;

/// Share of the budget, in eighths, after which a cell may stop early as chaotic if its exponent is not reported.
/// Then 46 cells of 20,000 with transient chaos count as chaotic.
const CLASS_CHAOS_EIGHTHS: u32 = 2;

/// Least number of periods that an exponent is averaged over before an early stop.
const LEAST_AVERAGE_PERIODS: u32 = 32;

/// Steps and events that a cell may take per period of its budget, about a thousand times those of a gear pair. The
/// total of 528 periods takes a processor core some tenths of a second.
const STEPS_PER_PERIOD: u64 = 20_000;
const EVENTS_PER_PERIOD: u64 = 2_000;

/// The integration time of a cell and the quantities to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Periods of transient and observation, and the longest cycle.
    pub settings: Settings,
    /// Whether the cell may stop as soon as its class is certain. Otherwise exactly
    /// `transient_periods + observed_periods` are integrated.
    pub early_stop: bool,
    /// Additional periods for cells that are still undecided; used only with early stops.
    pub undecided_periods: u32,
    /// Further periods for cells that are chaotic after all other periods. A cell whose chaos ends in these periods gets a new class.
    pub confirm_chaos: u32,
    /// Whether aperiodic motion gets an exponent, which costs a tangent vector.
    pub exponent: bool,
    /// Whether the exponent is reported. Otherwise it only distinguishes chaos, and may be less accurate.
    pub shows_exponent: bool,
    /// Whether [`Quantities`](super::Quantities) are measured: on the cycle, or over further observed periods.
    pub quantities: bool,
}

impl Budget {
    /// Returns the forcing periods of transient and observation.
    pub fn periods(&self) -> u32 {
        self.settings.transient_periods.saturating_add(self.settings.observed_periods)
    }

    /// Returns the forcing periods after which every cell ends, except chaotic ones.
    pub fn decided_by(&self) -> u32 {
        let more = if self.early_stop { self.undecided_periods } else { 0 };
        self.periods().saturating_add(more)
    }

    /// Returns the largest number of forcing periods, including those that confirm chaos.
    pub fn longest(&self) -> u32 {
        let more = if self.exponent { self.confirm_chaos } else { 0 };
        self.decided_by().saturating_add(more)
    }

    /// Returns the budget for continuing motion that is undecided after a number of periods. The transient is cut to the periods in which a
    /// new tangent vector turns.
    pub fn after(&self, periods_run: u32) -> Budget {
        let transient_periods = self.settings.transient_periods.min(TANGENT_PERIODS);
        let mut rest = Budget { settings: Settings { transient_periods, ..self.settings }, ..*self };
        rest.undecided_periods = self.decided_by().saturating_sub(periods_run).saturating_sub(rest.periods());
        rest
    }

    /// Returns the work that one cell may take, including searches for cycles.
    pub fn allowance(&self) -> Allowance<'static> {
        let longest = u64::from(self.longest());
        let [steps, events] = [STEPS_PER_PERIOD, EVENTS_PER_PERIOD].map(|share| share * longest);
        Allowance { steps, events, ..Allowance::UNLIMITED }
    }

    /// Returns the period from which the exponent accumulates.
    pub fn exponent_from(&self) -> u32 {
        let from = if self.shows_exponent { EXPONENT_FROM } else { CLASS_EXPONENT_FROM };
        from.min(self.settings.transient_periods)
    }

    /// Returns the period from which a tangent vector is integrated.
    pub(super) fn tangent_from(&self) -> u32 {
        let turning = if self.shows_exponent { TANGENT_PERIODS } else { CLASS_TANGENT_PERIODS };
        self.exponent_from().saturating_sub(turning)
    }

    /// Returns the first period at which a cell may stop early as chaotic.
    pub fn chaos_from(&self) -> u32 {
        let eighths = if self.shows_exponent { EARLY_CHAOS_EIGHTHS } else { CLASS_CHAOS_EIGHTHS };
        let from = (self.periods() / 8 * eighths).max(self.settings.observed_periods);
        from.max(self.exponent_from() + LEAST_AVERAGE_PERIODS)
    }

    /// Returns the standard errors by which the exponent must exceed zero for an early stop as chaotic.
    pub fn chaos_errors(&self) -> f64 {
        if self.shows_exponent { EARLY_CHAOS_ERRORS } else { CLASS_CHAOS_ERRORS }
    }
}
