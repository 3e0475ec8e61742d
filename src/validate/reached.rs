//! Does the cell's own start lead to where the record ended?
//!
//! The reference stays on the record's attractor when it is put there: so there is such an attractor, but a lane that
//! set out from another cell's start, or lost its way, would be there as well. Where basins meet, rounding decides,
//! and does so on the reference, too: a start or a parameter that is moved within rounding leads there, or a
//! motion that is rounded at every step, or a step of Newton's method such as lanes take to their cycle.

use super::answer::Answer;
use super::case::{Case, rounding};
use super::lane_model::LaneModel;
use super::rounded::Rounded;
use crate::classify::classify;
use crate::flow::Flow;
use crate::gpu::rules::REACH;
use crate::model::State;
use crate::orbit::{Class, measure};
use crate::reference::Trajectory;

/// Starts within rounding that are tried.
const STARTS: usize = 256;

/// Motions that are rounded at every step.
const RUNS: u64 = 64;

/// Periods in which steps are tried, and of cycles where the record has none.
const STEPPING: u32 = 528;
const SHORT: u32 = 4;

/// Whether the record's motion was at last where the cell's own may be: from there the reference comes to its own
/// attractor, within the budget or in the end, or to one that the cell's start leads to.
pub(super) fn is_where_it_may_be(case: &Case<'_>) -> bool {
    let Some(from) = case.strobe().filter(|_| case.is_lane && classify(case.record) != Class::Failed) else {
        return true;
    };
    let answer = case.at_leisure(from);
    is_alike(&answer, &case.truth)
        || is_alike(&answer, &case.at_leisure(case.start))
        || is_reached(case, &answer)
}

/// Whether the cell's start leads to the attractor that `answer` describes.
fn is_reached(case: &Case<'_>, answer: &Answer) -> bool {
    let is_there =
        |flow: &Flow, law, start| is_alike(&Answer::from(&measure(flow, law, start, &case.budget)), answer);
    let leads = |start: State| is_there(&case.flow, case.law, start);
    (0..8).map(|k| case.nudged_start(k)).any(leads)
        || case.nudged_pairs(rounding(case.precision)).any(|pair| {
            let oscillator = pair.oscillator();
            oscillator.is_ok_and(|oscillator| is_there(&Flow::new(&oscillator), pair.law(), case.start))
        })
        || case.scattered_starts(STARTS).any(leads)
        || ends_of_rounded(case).is_some_and(|mut ends| ends.any(leads))
        || steps_to(case).into_iter().any(leads)
}

/// Whether both are on the same kind of attractor: cycles by their words, up to mirror image.
fn is_alike(a: &Answer, b: &Answer) -> bool {
    let is_same_word = match (&a.word, &b.word) {
        (Some(ours), Some(theirs)) => ours == theirs || *ours == theirs.mirrored(),
        _ => true,
    };
    match a.class {
        Class::Periodic { .. } => a.class == b.class && is_same_word,
        class => class.index() == b.class.index(),
    }
}

/// Where motions that are rounded at every step are after the record's periods.
fn ends_of_rounded<'c>(case: &'c Case<'_>) -> Option<impl Iterator<Item = State> + 'c> {
    let model = LaneModel::new(case).filter(|_| case.is_lane)?;
    Some((0..RUNS).filter_map(move |run| {
        let start: Trajectory<'_> = Trajectory::new(&model.flow, model.law, model.start(case.start));
        let mut motion = Rounded::new(&start, &model, run);
        (0..case.record.periods_run).try_for_each(|_| motion.advance_period(&mut ())).ok()?;
        Some(motion.trajectory().state())
    }))
}

/// Where steps of Newton's method lead from the cell's own motion: for the record's period, or for short ones where it
/// has none.
fn steps_to(case: &Case<'_>) -> Vec<State> {
    let periods = match classify(case.record) {
        Class::Periodic { period } => period..=period,
        _ => 1..=SHORT.min(case.budget.settings.max_period),
    };
    let mut motion = Trajectory::<0>::new(&case.flow, case.law, case.start);
    let mut steps = Vec::new();
    for _ in 0..case.record.periods_run.min(STEPPING) {
        if motion.advance_period(&mut ()).is_err() {
            break;
        }
        let limits = periods.clone().filter_map(|period| case.limit(&motion, period));
        steps.extend(limits.filter(|limit| case.apart(&motion.state(), limit) < REACH));
    }
    steps
}
