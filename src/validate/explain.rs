//! Why a record differs from the reference: the checks, in the order in which they are made.
//!
//! Every explanation is a computation on the reference that gives the record's own answer, in
//! every field, or shows that neither answer could be reached. Nothing is explained by a
//! share of cells that is allowed to be wrong.

use super::answer::{Answer, Difference, Field};
use super::averages::is_other_chaos;
use super::case::{Case, ELSEWHERE, LANE_RESOLUTION};
use super::explanation::Explanation;
use super::lane_growth::{rare_chaos, weak_chaos};
use super::limits::{
    flip, held, held_in_chaos, is_shaken, is_spent, late, leaves_chaos_open, longer, rest, scattered,
    undecided_chaos, within_scatter,
};
use super::on_the_way::{has_averages_ahead, has_averages_on_the_way};
use super::own_figures::agrees_with_its_figures;
use super::reached::is_where_it_may_be;
use super::rounding::{self, at_rest, rounded_cycle};
use super::same_cycle::{same_cycle, within_reach};
use super::spread::{are_of_one_class, spread};
use super::unsettled::unsettled;
use crate::classify::{classify, status};
use crate::gpu::{Constants, LaneSettings, Precision};
use crate::model::State;
use crate::orbit::{Class, Status};
use crate::reference::Trajectory;

/// Exponents of a cycle below this per forcing period are those of a bifurcation: motion
/// settles in hundreds of periods.
const NEAR_BIFURCATION: f64 = 0.01;

/// Share of a state error that rounding at the start must make on the reference itself, and that rounding at every step
/// may leave of it.
const SENSITIVE: f64 = 0.1;

/// Lanes in single precision take recurrences this close for rounding: 2^-15 of the motion.
const SINGLE_RESOLUTION: f64 = 3.05e-5;

/// Starts within rounding from which a motion may meet its caps: chaos decides which does.
const SCATTERED_STARTS: usize = 100;

/// And motions that are rounded at every step; more of them where nothing else gives the record's answer: where
/// the strobe cuts a flight is chance, and few cuts slow elastic impacts down so far that there are too many.
const ROUNDED_RUNS: u64 = 8;
const MOST_RUNS: u64 = 1000;

/// The explanation of a cell's differences: of its states and of its answer, if both differ.
pub(super) fn explain(case: &Case<'_>, differences: &[Difference]) -> Option<Explanation> {
    let (states, answers): (Vec<_>, Vec<_>) = differences.iter().partition(|d| d.field == Field::State);
    // No rounding makes a lane go on beyond its periods.
    if answers.iter().any(|difference| difference.field == Field::Periods) {
        return None;
    }
    let of_states = (!states.is_empty()).then(|| explain_states(case));
    let of_answers = (!answers.is_empty()).then(|| explain_answer(case));
    match (of_answers, of_states) {
        // Both need one; the answer's tells more.
        (Some(answer), Some(state)) => state.and(answer),
        (answer, state) => answer.or(state).flatten(),
    }
}

/// Rounding at the start moves the reference itself as far, beyond what tangents foresee; or a motion that is
/// rounded at every step ends where the lane did, which had the last event before its strobe and not after it, or the
/// other way round.
fn explain_states(case: &Case<'_>) -> Option<Explanation> {
    let sensitivity = super::states::sensitivity(case)?;
    let error = super::states::lane_distance(case)?;
    if sensitivity >= SENSITIVE * error {
        return Some(Explanation::NearGrazing);
    }
    rounding::ends_there(case, SENSITIVE * error)?.then_some(Explanation::BelowResolution)
}

fn explain_answer(case: &Case<'_>) -> Option<Explanation> {
    const CHECKS: [fn(&Case<'_>) -> Option<Explanation>; 21] = [
        engine_cap,
        longer,
        other_attractor,
        within_rounding,
        resolution,
        unsettled,
        same_cycle,
        weak_chaos,
        undecided_chaos,
        late,
        bifurcation,
        flip,
        grazing,
        held,
        held_in_chaos,
        within_scatter,
        rounded_cycle,
        at_rest,
        scattered,
        rare_chaos,
        rare_cap,
    ];
    // A record without a period claims averages all the same.
    let is_there = || classify(case.record) == Class::Chaotic || is_where_it_may_be(case);
    let is_claimed = || agrees_with_its_figures(case) && has_averages_on_the_way(case) && is_there();
    if are_of_one_class(case) {
        return spread(case).or_else(|| another_of_its_class(case)).filter(|_| is_claimed());
    }
    CHECKS.iter().find_map(|check| check(case)).filter(|_| is_claimed())
}

fn engine_cap(case: &Case<'_>) -> Option<Explanation> {
    if !case.is_lane {
        return None;
    }
    let caps = LaneSettings::default();
    let beyond = match status(case.record) {
        Status::TooStiff => {
            let constants = Constants::new(&case.pair.oscillator().ok()?, None);
            constants.is_none_or(|constants| {
                let finest = constants.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
                f64::from(constants.steps) * finest > f64::from(caps.passes_per_period)
            })
        }
        Status::CapEvents => {
            let starts = std::iter::once(case.start).chain((0..8).map(|k| case.nudged_start(k)));
            starts.chain(case.scattered_starts(SCATTERED_STARTS)).any(|start| needs_more(case, start, &caps))
                || (0..ROUNDED_RUNS).any(|run| rounding::needs_more(case, run, &caps) == Some(true))
        }
        _ => false,
    };
    beyond.then_some(Explanation::EngineCap)
}

/// The same of many more motions that are rounded at every step.
fn rare_cap(case: &Case<'_>) -> Option<Explanation> {
    let caps = LaneSettings::default();
    let is_beyond = |run| rounding::needs_more(case, run, &caps) == Some(true);
    let ended = case.is_lane && status(case.record) == Status::CapEvents;
    (ended && (ROUNDED_RUNS..MOST_RUNS).any(is_beyond)).then_some(Explanation::EngineCap)
}

/// Whether the reference from a start has more events in some period up to the record's last than lanes
/// may have.
fn needs_more(case: &Case<'_>, start: State, caps: &LaneSettings) -> bool {
    let mut trajectory = Trajectory::new(&case.flow, case.law, start);
    for _ in 0..=case.record.periods_run {
        let before = trajectory.work().events;
        let ended = trajectory.advance_period(&mut ());
        if trajectory.work().events - before > u64::from(caps.events_per_period) {
            return true;
        }
        if ended.is_err() {
            return false;
        }
    }
    false
}

fn other_attractor(case: &Case<'_>) -> Option<Explanation> {
    let from = case.strobe()?;
    let answer = case.at_leisure(from);
    // A cycle that is read before it has settled has averages of its own.
    let read = || match classify(case.record) {
        Class::Periodic { period } if answer.class == classify(case.record) => {
            case.read_as_is(&case.standing(from).ok()?, period)
        }
        _ => None,
    };
    let is_left_open = || {
        let is_too_weak = leaves_chaos_open(case, &answer)?;
        Some(is_too_weak && has_averages_ahead(case))
    };
    let same = case.is_the_records(&answer)
        || read().is_some_and(|answer| case.is_the_records(&answer))
        || within_reach(case, from, &answer).is_some()
        || unresolved(case, from, &answer) == Some(true)
        || read_rounded(case, from, &answer) == Some(true)
        || is_left_open() == Some(true);
    match classify(case.record) {
        Class::Undecided => same.then_some(Explanation::UndecidedInBudget),
        // Of chaos nothing else asks where it is.
        Class::Chaotic => (same && is_where_it_may_be(case)).then_some(Explanation::CoexistingAttractor),
        _ => same.then_some(Explanation::CoexistingAttractor),
    }
}

/// The same of motion that is on no cycle: other chaos, not the same averaged anew.
fn another_of_its_class(case: &Case<'_>) -> Option<Explanation> {
    let is_other = || Some(is_other_chaos(&case.truth, &case.at_leisure(case.strobe()?)));
    (case.truth.class != Class::Chaotic || is_other() == Some(true)).then(|| other_attractor(case))?
}

/// Whether it is the record's cycle, read where every step rounds.
fn read_rounded(case: &Case<'_>, from: State, answer: &Answer) -> Option<bool> {
    let Class::Periodic { period } = answer.class else { return None };
    let stands = case.standing(from).ok()?;
    let is_another = answer.class == classify(case.record) && answer.word != case.truth.word;
    if !is_another || case.unrest(&stands, period) > ELSEWHERE {
        return None;
    }
    rounding::is_read_rounded(case, &stands, period, answer)
}

/// Whether the cycle has a multiple of the record's period, and lanes cannot tell it from the record's.
fn unresolved(case: &Case<'_>, from: State, answer: &Answer) -> Option<bool> {
    let (Class::Periodic { period }, Class::Periodic { period: theirs }) =
        (classify(case.record), answer.class)
    else {
        return None;
    };
    let stands = case.standing(from).ok()?;
    let divides = period < theirs && theirs.is_multiple_of(period);
    if !divides || case.unrest(&stands, period) > LANE_RESOLUTION {
        return None;
    }
    let read = case.read_as_is(&stands, period)?;
    Some(case.is_the_records(&read) || within_reach(case, from, &read).is_some())
}

fn within_rounding(case: &Case<'_>) -> Option<Explanation> {
    let chaotic = classify(case.record) == Class::Chaotic && case.truth.class == Class::Chaotic;
    let because = if chaotic { Explanation::Chaos } else { Explanation::Border };
    case.nudged().any(|answer| case.is_the_records(&answer)).then_some(because)
}

/// Lanes do not tell the cycle from one of a shorter period.
fn resolution(case: &Case<'_>) -> Option<Explanation> {
    let (Class::Periodic { period }, Class::Periodic { period: theirs }) =
        (classify(case.record), case.truth.class)
    else {
        return None;
    };
    let stands = case.standing(case.strobe()?).ok()?;
    let divides = period < theirs && theirs.is_multiple_of(period);
    let hides = divides && case.unrest(&stands, period) < LANE_RESOLUTION;
    // Or rounding keeps the lane off its cycle in a pattern of its own.
    let multiplies = period > theirs && period.is_multiple_of(theirs);
    let unrest = case.unrest(&stands, theirs);
    let is_shaken_off = || {
        let image = case.after_cycle(&stands, theirs)?;
        Some(rounding::moved_by_rounding(case, &stands, &image, theirs)? >= rest(case.precision))
    };
    let is_kept_off =
        unrest < LANE_RESOLUTION && (unrest >= rest(case.precision) || (multiplies && is_shaken_off()?));
    let scatters = multiplies && is_kept_off && is_shaken(case, &stands, theirs)? && {
        let read = case.read_as_is(&stands, period)?;
        case.is_the_records(&read) || rounding::is_read_rounded(case, &stands, period, &read)?
    };
    // Or the lane's cycle leaves out a point of this one that lies nearer to the next than rounding.
    let is_rounded = case.precision == Precision::F32 && case.unrest(&stands, period) < SINGLE_RESOLUTION;
    let leaves_out = !divides && !multiplies && is_rounded && {
        let read = case.read_along(&stands, period)?;
        case.is_the_records(&read)
    };
    (hides || scatters || leaves_out).then_some(Explanation::BelowResolution)
}

fn bifurcation(case: &Case<'_>) -> Option<Explanation> {
    let [exponent, error] = case.truth.exponent?;
    // Of a motion that is on no cycle yet the average may be zero by chance.
    let is_near = (exponent.abs() + error) * case.flow.period < NEAR_BIFURCATION;
    (is_near && recurs(case)? && case.has_its_averages()?).then_some(Explanation::Border)
}

/// The reference meets the graze: what the record says of itself is no evidence.
fn grazing(case: &Case<'_>) -> Option<Explanation> {
    (case.truth.status == Status::NearGrazing && recurs(case)? && case.is_least()?)
        .then_some(Explanation::NearGrazing)
}

/// Whether the motion comes back after the record's period; a record without one claims none.
fn recurs(case: &Case<'_>) -> Option<bool> {
    let stands = case.standing(case.strobe()?).ok()?;
    match classify(case.record) {
        Class::Periodic { period } => {
            // What a motion passes through at a bifurcation is its cycle, or twice or half of it.
            let related = match case.truth.class {
                Class::Periodic { period: p } => [p, 2 * p].contains(&period) || 2 * period == p,
                _ => true,
            };
            Some(related && case.unrest(&stands, period) < ELSEWHERE)
        }
        Class::Undecided => Some(is_spent(case)),
        Class::Chaotic | Class::Failed => Some(false),
    }
}
