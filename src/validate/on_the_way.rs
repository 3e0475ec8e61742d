//! What a lane that decides nothing has averaged.
//!
//! Lanes count impacts and meshing from the end of the transient on, or from where exponents begin if they may
//! stop early, and anew wherever a cycle has been read in vain: up to the last strobe, over a number of periods
//! that their record does not tell.

use super::case::{Case, ELSEWHERE, LANE_RESOLUTION};
use super::lane_model::LaneModel;
use super::reading::counts;
use super::rounded::Rounded;
use crate::classify::classify;
use crate::gpu::Precision;
use crate::gpu::rules::{REFINEMENTS, VAIN};
use crate::model::State;
use crate::orbit::Class;
use crate::record::valid;
use crate::reference::{Stop, Trajectory};

/// Motions that are rounded at every step.
const ROUNDED_RUNS: u64 = 8;

/// Starts within rounding whose motions are tried where these end on different places.
const SCATTERED_STARTS: usize = 1000;

/// Periods over which a motion is seen to stay where it is.
const STAYS: u32 = 128;

/// A motion by its impacts and meshing time so far, at every strobe.
struct Course {
    counts: Vec<[f64; 2]>,
    end: State,
}

/// Whether the averages of a record without a period are those of some stretch of the cell's motion that a lane
/// may have counted, as it is or within rounding; records with one are asked elsewhere.
pub(super) fn has_averages_on_the_way(case: &Case<'_>) -> bool {
    let record = case.record;
    if classify(record) != Class::Undecided || record.valid & (valid::IMPACTS | valid::MESH) == 0 {
        return true;
    }
    let Some([shortest, longest]) = lengths(case) else { return false };
    // What single precision does not resolve it may be held anywhere in.
    let lengths =
        if is_unresolved(case) { [1; 2] } else { [shortest, longest].map(|length| length as usize) };
    let of_start = |start| exact(case, Trajectory::new(&case.flow, case.law, start), record.periods_run);
    let nudged = (0..8).map(|k| case.nudged_start(k));
    let mut own: Vec<Course> = std::iter::once(case.start).chain(nudged).filter_map(of_start).collect();
    let ahead = ahead(case, longest);
    if is_met(case, &own, &ahead, lengths) {
        return true;
    }
    if let Some(model) = LaneModel::new(case).filter(|_| case.is_lane) {
        own.extend((0..ROUNDED_RUNS).filter_map(|run| rounded(case, &model, run)));
    }
    if is_met(case, &own, &ahead, lengths) {
        return true;
    }
    // Chaos may mesh once in a thousand periods.
    let starts: Vec<State> = case.scattered_starts(SCATTERED_STARTS).collect();
    is_scattered(case, &own)
        && starts.chunks(SCATTERED_STARTS / 10).any(|starts| {
            own.extend(starts.iter().copied().filter_map(of_start));
            is_met(case, &own, &ahead, lengths)
        })
}

/// Whether they are those of a stretch of the motion that the lane has ahead of it.
pub(super) fn has_averages_ahead(case: &Case<'_>) -> bool {
    lengths(case).is_some_and(|[shortest, longest]| {
        let ahead = ahead(case, longest);
        lies_between(
            case,
            ahead.iter().flat_map(|course| stretches(course, shortest as usize, 0, usize::MAX)),
        )
    })
}

/// The least and the most periods over which the record may have averaged; none if its impacts are not whole over any.
fn lengths(case: &Case<'_>) -> Option<[u32; 2]> {
    let longest = case.record.periods_run.saturating_sub(counted_from(case)).max(1);
    let is_whole = |periods: &u32| {
        let impacts = case.record.impacts_per_period * f64::from(*periods);
        (impacts - impacts.round()).abs() <= case.bars.impacts * f64::from(*periods)
    };
    (1..=longest).find(is_whole).map(|shortest| [shortest, longest])
}

/// Whether all that the motion still does lies within the resolution of a lane: rounding may hold that in any of
/// its periods.
fn is_unresolved(case: &Case<'_>) -> bool {
    let Ok(mut motion) = case.after(case.start, case.record.periods_run) else { return false };
    let there = motion.state();
    let stays =
        |_| motion.advance_period(&mut ()).is_ok() && case.apart(&there, &motion.state()) < LANE_RESOLUTION;
    case.is_lane && case.precision == Precision::F32 && (0..STAYS).all(stays)
}

/// The first period that may count.
fn counted_from(case: &Case<'_>) -> u32 {
    let transient_periods = case.budget.settings.transient_periods;
    if case.budget.early_stop {
        transient_periods.min(case.budget.exponent_from())
    } else {
        transient_periods
    }
}

/// Whether rounding decides where the motion is at last.
fn is_scattered(case: &Case<'_>, own: &[Course]) -> bool {
    own.iter().any(|course| case.apart(&own[0].end, &course.end) > ELSEWHERE)
}

fn exact(case: &Case<'_>, mut motion: Trajectory<'_>, periods: u32) -> Option<Course> {
    let state = |motion: &Trajectory<'_>| motion.state();
    course(periods, &mut motion, |motion| motion.advance_period(&mut ()), counts, state, case.flow.period)
}

fn rounded(case: &Case<'_>, model: &LaneModel, run: u64) -> Option<Course> {
    let start: Trajectory<'_> = Trajectory::new(&model.flow, model.law, model.start(case.start));
    let mut motion = Rounded::new(&start, model, run);
    course(
        case.record.periods_run,
        &mut motion,
        |motion| motion.advance_period(&mut ()),
        |motion| counts(motion.trajectory()),
        |motion| motion.trajectory().state(),
        case.flow.period,
    )
}

fn course<M>(
    periods: u32,
    motion: &mut M,
    advance: impl Fn(&mut M) -> Result<(), Stop>,
    counts: impl Fn(&M) -> [f64; 2],
    state: impl Fn(&M) -> State,
    period: f64,
) -> Option<Course> {
    let now = |motion: &M| {
        let [impacts, meshing_time] = counts(motion);
        [impacts, meshing_time / period]
    };
    let mut course = vec![now(motion)];
    for _ in 0..periods {
        advance(motion).ok()?;
        course.push(now(motion));
    }
    Some(Course { counts: course, end: state(motion) })
}

/// The motion from where the lane was at last, and from where the cycle that it may have read there lies.
fn ahead(case: &Case<'_>, periods: u32) -> Vec<Course> {
    let Some(stands) = case.strobe().and_then(|from| case.standing(from).ok()) else { return Vec::new() };
    let limit = match case.truth.class {
        Class::Periodic { period } => case.limit(&stands, period),
        _ => None,
    };
    let limit = limit.filter(|limit| case.apart(&stands.state(), limit) < ELSEWHERE);
    let cycle = limit.map(|limit| stands.at(limit, []));
    [Some(stands), cycle].into_iter().flatten().filter_map(|motion| exact(case, motion, periods)).collect()
}

/// Whether the record's averages lie between those of stretches of one length: of what the lane may have had
/// behind it, or has ahead of it.
fn is_met(case: &Case<'_>, own: &[Course], ahead: &[Course], [shortest, longest]: [usize; 2]) -> bool {
    // Where rounding decides that, any stretch of it is as good, and the shortest scatter most.
    if is_scattered(case, own) {
        let from = counted_from(case) as usize;
        let all = own.iter().map(|course| (course, from)).chain(ahead.iter().map(|course| (course, 0)));
        return lies_between(
            case,
            all.flat_map(|(course, from)| stretches(course, shortest, from, usize::MAX)),
        );
    }
    // Newton's method takes periods, and where it leads nowhere a lane goes on from where it was.
    let period = match case.truth.class {
        Class::Periodic { period } => period,
        _ => case.budget.settings.max_period,
    };
    let behind = ((REFINEMENTS + 1) * VAIN * period) as usize;
    (shortest..=longest).step_by(shortest).any(|length| {
        let latest = |course: &Course| course.counts.len().saturating_sub(1 + length + behind);
        let own = own.iter().flat_map(|course| stretches(course, length, latest(course), usize::MAX));
        lies_between(case, own.chain(ahead.iter().flat_map(|course| stretches(course, length, 0, 1))))
    })
}

/// Averages over stretches of so many periods, of which the first begins `from` periods after the start.
fn stretches(
    course: &Course,
    length: usize,
    from: usize,
    most: usize,
) -> impl Iterator<Item = [f64; 2]> + '_ {
    let begins = (from..course.counts.len().saturating_sub(length)).take(most);
    begins.map(move |begin| {
        let [before, after] = [course.counts[begin], course.counts[begin + length]];
        [0, 1].map(|i| (after[i] - before[i]) / length as f64)
    })
}

/// Whether the record's averages lie between these, within the bars.
fn lies_between(case: &Case<'_>, averages: impl Iterator<Item = [f64; 2]>) -> bool {
    let nothing = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let ranges = averages.fold(nothing, |ranges, average| {
        [0, 1].map(|i| [ranges[i][0].min(average[i]), ranges[i][1].max(average[i])])
    });
    let ours = [
        (valid::IMPACTS, case.record.impacts_per_period, case.bars.impacts),
        (valid::MESH, case.record.mesh_fraction, case.bars.mesh),
    ];
    ours.iter().zip(ranges).all(|(&(bit, ours, bar), [least, most])| {
        case.record.valid & bit == 0 || (least - bar <= ours && ours <= most + bar)
    })
}
