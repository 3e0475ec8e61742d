//! What a lane cannot tell within its precision, or within its budget.

use super::case::Case;
use super::explanation::Explanation;
use crate::classify::classify;
use crate::orbit::{CHAOS_ERRORS, Class};

/// The record says chaotic where the reference decides nothing within the same budget: it is the
/// same average, which exceeds zero by enough errors on one side and not on the other; or the
/// reference, too, is chaotic from a start or with parameters moved within rounding: then the
/// chaos is a transient that one side has left.
pub(super) fn undecided_chaos(case: &Case<'_>) -> Option<Explanation> {
    if (classify(case.record), case.truth.class) != (Class::Chaotic, Class::Undecided) {
        return None;
    }
    let [theirs, error] = case.truth.exponent?;
    let [ours, own] = [case.record.lyapunov, case.record.lyapunov_error];
    let is_weak = ours <= 2.0 * CHAOS_ERRORS * own;
    if is_weak && (ours - theirs).abs() <= CHAOS_ERRORS * error.hypot(own) {
        return Some(Explanation::UndecidedInBudget);
    }
    case.nudged().any(|answer| answer.class == Class::Chaotic).then_some(Explanation::Chaos)
}
