//! What a lane cannot tell within its precision, or within its budget.

use super::answer::Answer;
use super::case::{Case, LANE_RESOLUTION};
use super::explanation::Explanation;
use super::states::{ROUNDINGS_PER_STEP, unit_roundoff};
use crate::classify::classify;
use crate::gpu::Constants;
use crate::orbit::{CHAOS_ERRORS, Class};
use crate::record::valid;

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

/// The cycle is symmetric, but rounding over the steps of a lane may make it as unsymmetric as
/// lanes look for; all other fields must be as they are.
pub(super) fn hidden_symmetry(case: &Case<'_>) -> Option<Explanation> {
    let Class::Periodic { period } = case.truth.class else { return None };
    let denied = case.record.valid & valid::SYMMETRIC != 0 && case.record.symmetric == 0;
    let claimed = Answer { symmetric: Some(false), ..case.truth.clone() };
    if !case.is_lane || !denied || case.truth.symmetric != Some(true) || !case.is_the_records(&claimed) {
        return None;
    }
    let constants = Constants::new(&case.pair.oscillator().ok()?, None)?;
    let finest = constants.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
    let steps = f64::from(constants.steps) * finest * f64::from(period);
    let rounding = ROUNDINGS_PER_STEP * unit_roundoff(case.precision) * steps;
    (rounding > LANE_RESOLUTION).then_some(Explanation::BelowResolution)
}
