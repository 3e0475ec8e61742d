//! Cycles that a lane read before the motion had settled on them.

use super::case::{Case, ELSEWHERE, LANE_RESOLUTION};
use super::explanation::Explanation;
use super::rounding::{is_read_rounded, whole_units};
use crate::classify::classify;
use crate::gpu::rules::{REFINEMENTS, VAIN};
use crate::model::State;
use crate::orbit::Class;
use crate::reference::Trajectory;

/// Forcing periods in which a motion that is about to rest is seen to stay.
const STAYING_PERIODS: u32 = 1024;

/// The record's cycle, read off a motion that is still on its way to it: the reference, read where the
/// lane read, gives the record's answer.
///
/// If the reference itself decides nothing, the motion has to stay there, or to be there as far as the
/// last period of the budget could tell.
pub(super) fn unsettled(case: &Case<'_>) -> Option<Explanation> {
    let Class::Periodic { period } = classify(case.record) else { return None };
    let is_open = case.truth.class == Class::Undecided;
    if case.truth.class != classify(case.record) && !is_open {
        return None;
    }
    let stands = case.standing(case.strobe()?).ok()?;
    // Motions at rest in different places are different motions.
    let is_own = |own: Trajectory<'_>| apart(case, &own.state(), &stands.state()) < ELSEWHERE;
    let is_on_the_way = !is_open || case.after(case.start, case.record.periods_run).is_ok_and(is_own);
    let as_lanes =
        (0..=REFINEMENTS).filter(|_| is_on_the_way).filter_map(|n| case.read_like_a_lane(period, n));
    let mut readings = as_lanes.chain(case.read_as_is(&stands, period));
    let is_rounded = || {
        let own = is_on_the_way && is_read_on_the_way(case, period);
        Some(own || is_read_rounded(case, &stands, period, &case.read_as_is(&stands, period)?)?)
    };
    let is_read =
        readings.any(|answer| case.is_the_records(&answer)) || (is_open && is_rounded() == Some(true));
    if !is_read {
        return None;
    }
    let is_there = !is_open || (case.is_least()? && stays(case, &stands, period));
    is_there.then_some(Explanation::Unsettled)
}

/// Whether the reference, somewhere on its way, reads the record's cycle, exactly or where every step rounds:
/// Newton's method takes periods from a lane, and where it leads nowhere the lane goes on from where it was.
fn is_read_on_the_way(case: &Case<'_>, period: u32) -> bool {
    let Some(last) = case.record.periods_run.checked_sub(period) else { return false };
    (0..=(REFINEMENTS + 1) * VAIN * period).any(|back| {
        let from = last.checked_sub(back).and_then(|periods| case.after(case.start, periods).ok());
        let read = from.as_ref().and_then(|from| case.read_along(from, period));
        let (Some(from), Some(read)) = (from, read) else { return false };
        case.is_the_records(&read) || is_read_rounded(case, &from, 0, &read) == Some(true)
    })
}

/// Whether the reference, from where the record says that the motion was at last, comes to rest on a cycle of
/// `period` close by: one that neither attracts nor repels, as that of a free body, is never decided.
fn stays(case: &Case<'_>, stands: &Trajectory<'_>, period: u32) -> bool {
    let mut ahead = stands.clone();
    let rests = (0..STAYING_PERIODS.next_multiple_of(period)).all(|_| ahead.advance_period(&mut ()).is_ok());
    let [here, there] = [stands.state(), ahead.state()];
    rests && case.unrest(&ahead, period) < LANE_RESOLUTION && apart(case, &here, &there) < ELSEWHERE
}

/// The distance of two states relative to all of the motion, as lanes measure it.
fn apart(case: &Case<'_>, a: &State, b: &State) -> f64 {
    let units = whole_units(case);
    (0..4).map(|i| (a[i] - b[i]).abs() / units[i % 2]).fold(0.0, f64::max)
}
