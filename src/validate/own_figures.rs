//! Would a lane's own rule have called its motion chaos, or left it open, as the record says?
//!
//! A lane calls its motion chaos if its exponent exceeds zero by three standard errors, or by more as long as there is
//! time left, by more than neutral motion grows, and the motion neither rests at a cycle nor lingers at one with
//! a growth that a departure may have (`chaos.wgsl`). So a record of chaos must have such an exponent, and one
//! that decides nothing must fail one of these by its own figures; whether the motion rests or lingers is seen on
//! the reference.

use super::averages::counted;
use super::case::Case;
use super::rounding::whole_units;
use super::states::unit_roundoff;
use crate::classify::classify;
use crate::gpu::Averaging;
use crate::gpu::rules::{DEPARTURE, NEAR, distance, resolved};
use crate::model::State;
use crate::orbit::{CHAOS_ERRORS, Class};
use crate::record::valid;
use crate::reference::Trajectory;

/// A window of lags is so much of the time that has passed.
const WINDOW_SHARE: u32 = 5;

/// Rounding of the record's figures, in single precision.
const ROUNDED: f64 = 1e-5;

/// Whether it would have said the same: records that have a period or no exponent are asked elsewhere.
pub(super) fn agrees_with_its_figures(case: &Case<'_>) -> bool {
    is_chaos_by_its_figures(case) && is_open_by_its_figures(case)
}

fn is_chaos_by_its_figures(case: &Case<'_>) -> bool {
    let record = case.record;
    if classify(record) != Class::Chaotic || !case.is_lane {
        return true;
    }
    let is_early = record.periods_run < case.budget.periods();
    let errors = if is_early { case.budget.chaos_errors() } else { CHAOS_ERRORS };
    record.lyapunov * (1.0 + ROUNDED) > errors * record.lyapunov_error
}

pub(super) fn is_open_by_its_figures(case: &Case<'_>) -> bool {
    let record = case.record;
    if classify(record) != Class::Undecided || record.valid & valid::LYAPUNOV == 0 || !case.is_lane {
        return true;
    }
    let averaging = Averaging::new(case.budget.periods(), case.budget.exponent_from());
    let counted = counted(record, &case.bars) / averaging.block * averaging.block;
    let surely = (record.lyapunov - CHAOS_ERRORS * record.lyapunov_error) * case.flow.period;
    let own = case.after(case.start, record.periods_run);
    let events = own.map_or(0.0, |own| own.work().events as f64 / f64::from(record.periods_run.max(1)));
    let is_weak = !averaging.outgrows(surely, counted as usize, events, unit_roundoff(case.precision));
    let may_depart = surely * f64::from(counted) < DEPARTURE;
    surely.is_nan()
        || surely <= 0.0
        || is_weak
        || stays(case, distance(resolved(case.precision)))
        || (may_depart && stays(case, distance(NEAR)))
}

/// Whether the motion comes back to within `near` at some lag and all its multiples in a window: from where the
/// record says that it was at last, or in the last windows of the cell's own motion.
fn stays(case: &Case<'_>, near: f64) -> bool {
    let periods = case.record.periods_run;
    let window = (periods / WINDOW_SHARE).clamp(2, case.budget.settings.max_period.max(2));
    let units = whole_units(case);
    let from_strobe = case.strobe().and_then(|from| case.standing(from).ok());
    let earlier = [2 * window, window].map(|back| case.after(case.start, periods.saturating_sub(back)).ok());
    from_strobe
        .into_iter()
        .chain(earlier.into_iter().flatten())
        .any(|motion| recurs(motion, window, near, units))
}

fn recurs(mut motion: Trajectory<'_>, window: u32, near: f64, units: [f64; 2]) -> bool {
    let anchor: State = motion.state();
    let mut is_near = vec![true];
    for _ in 0..window {
        if motion.advance_period(&mut ()).is_err() {
            return false;
        }
        let there = motion.state();
        is_near.push((0..4).all(|i| (there[i] - anchor[i]).abs() <= near * units[i % 2]));
    }
    let mut lags = 1..=window as usize / 2;
    lags.any(|lag| (lag..=window as usize).step_by(lag).all(|multiple| is_near[multiple]))
}
