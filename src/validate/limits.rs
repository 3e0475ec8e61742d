//! What a lane cannot tell within its precision, or within its budget.

use super::answer::Answer;
use super::averages::{is_same_error, is_same_exponent};
use super::case::{Case, ELSEWHERE, rounding};
use super::explanation::Explanation;
use super::lane_model::LaneModel;
use super::own_figures::is_open_by_its_figures;
use super::rounded::Rounded;
use super::rounding::moved_by_rounding;
use super::same_cycle::{may_repel, within_reach};
use crate::classify::classify;
use crate::gpu::{Precision, rules};
use crate::model::GearPair;
use crate::orbit::{CHAOS_ERRORS, Class, Status, analyse};
use crate::record::valid;
use crate::reference::Trajectory;
use crate::stability::{StrobeMap, multipliers};

/// A motion this far from where it was a cycle ago has not settled.
const UNSETTLED: f64 = 1e-4;

/// Periods in which motion leaves what repels it, however closely it passes.
const STAYING_PERIODS: u32 = 400;

/// A lane may be so many times as far off its cycle as the reference is: where an approach ends is chance.
const AS_FAR: f64 = 8.0;

/// Motions that are rounded at every step, to see how far off they are.
const ROUNDED_RUNS: u64 = 8;

/// Periods that lanes take to confirm a period: three windows of the longest they look for.
const CONFIRMATION_WINDOWS: u32 = 3;

/// Strobes of a lane at rest, 2^-16 of the motion in single precision, lie within so many times what they scatter by.
const AT_REST: f64 = 4.0;

/// Multipliers below this belong to a cycle that is about to double its period.
const NEAR_FLIP: f64 = -0.8;

/// A lane's scatter is that of one cycle; over several it may come to a few times as much.
const SCATTERS: [f64; 2] = [1.0, 3.0];

/// Starts within rounding that are tried before a transient counts as different: of a map's many
/// transients some are rare.
const SCATTERED_STARTS: usize = 1000;

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
    let periods = case.truth.scatter?.exponent_periods;
    if is_weak
        && is_same_error(case.record, &case.bars, error, periods)
        && (ours - theirs).abs() <= CHAOS_ERRORS * error.hypot(own)
    {
        return Some(Explanation::UndecidedInBudget);
    }
    case.nudged().any(|answer| answer.class == Class::Chaotic).then_some(Explanation::Chaos)
}

/// The same start, and as long as it takes.
pub(super) fn longer(case: &Case<'_>) -> Option<Explanation> {
    let because = match case.truth.class {
        Class::Undecided => Explanation::UndecidedInBudget,
        Class::Chaotic => Explanation::Chaos,
        Class::Periodic { .. } | Class::Failed => return None,
    };
    let answer = case.at_leisure(case.start);
    // Neither side claims anything, and neither can: both are right.
    let silent = answer.class == Class::Undecided && is_spent(case);
    (case.is_the_records(&answer) || silent).then_some(because)
}

/// The record has no period and the reference has one, or the other way round in chaos: the
/// side that decided is right in the end, the other was still on its way.
pub(super) fn late(case: &Case<'_>) -> Option<Explanation> {
    let (ours, from) = (classify(case.record), case.strobe()?);
    let stands = case.standing(from).ok()?;
    match (ours, case.truth.class) {
        (Class::Chaotic, Class::Periodic { period }) => {
            let early = 2 * case.record.periods_run < whole_budget(case);
            let wanders = || case.unrest(&stands, period) > ELSEWHERE;
            let is_transient = || wanders_within_rounding(case, case.record.periods_run, period, ELSEWHERE);
            let settles = || case.at_leisure(from).class == case.truth.class;
            (!early && wanders() && is_transient() && settles()).then_some(Explanation::Chaos)
        }
        _ if !is_spent(case) => None,
        // The reference, too, is still on its way, to a cycle that is reached from here as well.
        (Class::Undecided, Class::Periodic { .. }) if case.truth.status == Status::Slow => {
            let Class::Periodic { period } = case.truth.class else { return None };
            let settles = || case.at_leisure(from).class == case.truth.class;
            let is_own = || is_as_far(case, period, case.unrest(&stands, period));
            is_left_open(case, &stands, &case.truth, period)
                .or_else(|| (is_own() && settles()).then_some(Explanation::UndecidedInBudget))
        }
        (Class::Undecided, Class::Periodic { period }) => {
            let confirming = CONFIRMATION_WINDOWS * case.budget.settings.max_period;
            let began = case.record.periods_run.saturating_sub(confirming);
            let late = wanders_within_rounding(case, began, period, UNSETTLED);
            let on_time = || is_left_open(case, &stands, &case.truth, period);
            if late { Some(Explanation::UndecidedInBudget) } else { on_time() }
        }
        (Class::Undecided, Class::Chaotic) => {
            if leaves_chaos_open(case, &case.truth)? {
                return Some(Explanation::UndecidedInBudget);
            }
            has_left_chaos(case, &stands)
        }
        _ => None,
    }
}

/// Whether the record is undecided with the exponent of the chaos that `truth` describes: too weak to be told in its
/// budget, or where the motion lingers at some cycle.
pub(super) fn leaves_chaos_open(case: &Case<'_>, truth: &Answer) -> Option<bool> {
    if classify(case.record) != Class::Undecided || truth.class != Class::Chaotic || !is_spent(case) {
        return Some(false);
    }
    let (exponent, periods) = (truth.exponent?, truth.scatter?.exponent_periods);
    let known = case.record.valid & valid::LYAPUNOV != 0
        && is_same_exponent(case.record, &case.bars, exponent, periods)
        && is_same_error(case.record, &case.bars, exponent[1], periods);
    Some(known && is_open_by_its_figures(case))
}

/// Why a lane could not see its motion settle, if the reference goes on from where it was at last to the cycle that
/// `truth` describes: there was no time left, or rounding hides it.
fn is_left_open(
    case: &Case<'_>,
    stands: &Trajectory<'_>,
    truth: &Answer,
    period: u32,
) -> Option<Explanation> {
    let unrest = case.unrest(stands, period);
    // Or as close as rounding, which the cycle amplifies, lets it come.
    let is_kept_off = case.is_lane && unrest > rest(case.precision);
    let trembles = || is_kept_off && is_shaken(case, stands, period) == Some(true);
    // Or rounding hides from it that the cycle attracts.
    let doubts = || case.is_lane && may_repel(case, stands, truth) == Some(true);
    let because = if trembles() {
        Explanation::BelowResolution
    } else if unrest > UNSETTLED {
        Explanation::UndecidedInBudget
    } else if doubts() {
        Explanation::BelowResolution
    } else {
        return None;
    };
    if unrest > rest(case.precision) && !is_as_far(case, period, unrest) {
        return None;
    }
    let settles = case.at_leisure(stands.state()).class == truth.class;
    settles.then_some(because)
}

/// Whether the reference, after the record's periods, is about as far off its cycle of `period` as `unrest`: from the
/// start, from one that is the same within rounding, or rounded at every step. Where the record says that
/// its motion was is no evidence alone.
fn is_as_far(case: &Case<'_>, period: u32, unrest: f64) -> bool {
    let is_far = |own: &Trajectory<'_>| AS_FAR * case.unrest(own, period) >= unrest;
    let mut starts = std::iter::once(case.start).chain((0..8).map(|k| case.nudged_start(k)));
    starts.any(|start| case.after(start, case.record.periods_run).is_ok_and(|own| is_far(&own)))
        || LaneModel::new(case).filter(|_| case.is_lane).is_some_and(|model| {
            let start: Trajectory<'_> = Trajectory::new(&model.flow, model.law, model.start(case.start));
            (0..ROUNDED_RUNS).any(|run| {
                let mut motion = Rounded::new(&start, &model, run);
                let ran = (0..case.record.periods_run).try_for_each(|_| motion.advance_period(&mut ()));
                ran.is_ok() && is_far(motion.trajectory())
            })
        })
}

/// The reference's own chaos is a transient: in the end it is on a cycle, and the lane was left open near one
/// of that period where the motion stays, which a cycle that repels would not let it.
fn has_left_chaos(case: &Case<'_>, stands: &Trajectory<'_>) -> Option<Explanation> {
    let settled = case.at_leisure(case.start);
    let Class::Periodic { period } = settled.class else { return None };
    let stays = |cycles| case.unrest(stands, cycles * period) < ELSEWHERE;
    let is_near = stays(1) && stays(STAYING_PERIODS.div_ceil(period));
    if is_near { is_left_open(case, stands, &settled, period) } else { None }
}

/// Periods that a cell may take whatever becomes of it.
pub(super) fn whole_budget(case: &Case<'_>) -> u32 {
    case.budget.settings.transient_periods + case.budget.settings.observed_periods
}

/// Whether a record is undecided and has had all its periods: before, there is no such thing.
pub(super) fn is_spent(case: &Case<'_>) -> bool {
    classify(case.record) == Class::Undecided && case.record.periods_run >= whole_budget(case)
}

/// Whether the reference itself, from the start or from one that is the same within rounding,
/// is off its cycle of `period` by more than `bar` after some periods.
pub(super) fn wanders_within_rounding(case: &Case<'_>, periods: u32, period: u32, bar: f64) -> bool {
    let mut starts = std::iter::once(case.start).chain((0..8).map(|k| case.nudged_start(k)));
    let wanders = |start| case.after(start, periods).is_ok_and(|at| case.unrest(&at, period) > bar);
    starts.any(wanders)
}

/// A flip is near, and rounding, amplified by the cycle, is as large as the alternation.
pub(super) fn flip(case: &Case<'_>) -> Option<Explanation> {
    let (Class::Periodic { period: ours }, Class::Periodic { period }) =
        (classify(case.record), case.truth.class)
    else {
        return None;
    };
    if ours != 2 * period || !case.is_lane {
        return None;
    }
    let from = case.strobe()?;
    let stands = case.standing(from).ok()?;
    let image = StrobeMap::Periods(period).apply(&stands, from).ok()?;
    let [re, im] = *multipliers(&image.derivative())?.first()?;
    let flips = im == 0.0 && re > -1.0 && re < NEAR_FLIP;
    let settles = case.at_leisure(from).class == case.truth.class;
    (flips && is_shaken(case, &stands, period)? && settles).then_some(Explanation::Border)
}

/// Whether rounding, amplified by a cycle that attracts, is as large as the motion's distance
/// from where it was a cycle ago: the sum of what is left of the roundings of all cycles before. One of
/// them is that of every event, or what rounding at every step is seen to do.
pub(super) fn is_shaken(case: &Case<'_>, stands: &Trajectory<'_>, period: u32) -> Option<bool> {
    let image = StrobeMap::Periods(period).apply(stands, stands.state()).ok()?;
    let [re, im] = *multipliers(&image.derivative())?.first()?;
    let radius = re.hypot(im);
    let events = 1.0 + case.truth.impacts_per_period.unwrap_or(0.0) * f64::from(period);
    let of_events = rounding(case.precision) * events * image.derivative().singular_values().max();
    let left = case.unrest(stands, period) * (1.0 - radius);
    Some(
        radius < 1.0 && (left <= of_events || left <= moved_by_rounding(case, stands, &image.state, period)?),
    )
}

/// The lane rests on a cycle that repels, and rounding of its tangents hides that.
pub(super) fn held(case: &Case<'_>) -> Option<Explanation> {
    let Class::Periodic { period } = classify(case.record) else { return None };
    let from = case.strobe()?;
    let stands = case.standing(from).ok()?;
    if !case.is_lane || case.unrest(&stands, period) > UNSETTLED {
        return None;
    }
    let answer = case.read_as_is(&stands, period)?;
    let is_hidden = || within_reach(case, from, &answer) == Some(Explanation::BelowResolution);
    (case.is_least()? && is_hidden()).then_some(Explanation::BelowResolution)
}

/// The lane decides nothing because rounding holds it on a cycle that repels, amid the chaos that the reference sees:
/// the cycle closes as nearly as lanes tell strobes apart at rest, and the record's growth and averages are its own.
pub(super) fn held_in_chaos(case: &Case<'_>) -> Option<Explanation> {
    let is_open = (Class::Undecided, Class::Chaotic) == (classify(case.record), case.truth.class);
    if !case.is_lane || !is_open || !is_spent(case) {
        return None;
    }
    let stands = case.standing(case.strobe()?).ok()?;
    let rests = |period: &u32| case.unrest(&stands, *period) <= AT_REST * rest(case.precision);
    let period = (1..=case.budget.settings.max_period).find(rests)?;
    let read = case.read_as_is(&stands, period)?;
    let [growth, _] = read.exponent?;
    let (record, bars) = (case.record, &case.bars);
    let is_its_own = |bit, ours: f64, theirs: Option<f64>, bar: f64| {
        record.valid & bit == 0 || theirs.is_some_and(|theirs| (ours - theirs).abs() <= bar)
    };
    let is_held = record.valid & valid::LYAPUNOV != 0
        && growth > 0.0
        && bars.is_same_multiplier(record.lyapunov, growth, f64::from(period))
        && is_its_own(valid::IMPACTS, record.impacts_per_period, read.impacts_per_period, bars.impacts)
        && is_its_own(valid::MESH, record.mesh_fraction, read.mesh_fraction, bars.mesh);
    is_held.then_some(Explanation::BelowResolution)
}

/// Chaos on the way to a cycle: how long it lasts is decided by rounding, and among many starts
/// that are the same within rounding one takes as long as the record's did, or as short.
pub(super) fn scattered(case: &Case<'_>) -> Option<Explanation> {
    let one_is_chaotic = [classify(case.record), case.truth.class].contains(&Class::Chaotic);
    if !one_is_chaotic || matches!(case.truth.class, Class::Undecided | Class::Failed) {
        return None;
    }
    case.scattered(SCATTERED_STARTS).any(|answer| case.is_the_records(&answer)).then_some(Explanation::Chaos)
}

/// A border as near as rounding makes the lane's strobes scatter: where parameters move by so little, the
/// reference has the record's cycle, with averages between those that it meets there; or, where the lane
/// decides nothing, other cycles than its own.
pub(super) fn within_scatter(case: &Case<'_>) -> Option<Explanation> {
    let (from, ours) = (case.strobe()?, classify(case.record));
    let period = match (ours, case.truth.class) {
        (Class::Periodic { period }, _) => period,
        (Class::Undecided, Class::Periodic { period }) if is_spent(case) => period,
        _ => return None,
    };
    let scatter = case.unrest(&case.standing(from).ok()?, period);
    // What rounding cannot do to the lane is no scatter.
    if !case.is_lane || !is_shaken(case, &case.standing(from).ok()?, period)? {
        return None;
    }
    // The cheaper question first.
    if !case.has_its_averages()? {
        return None;
    }
    let answer = |pair: GearPair| Answer::from(&analyse(&pair, from, &case.budget.settings));
    let answers: Vec<Answer> =
        SCATTERS.iter().flat_map(|times| case.nudged_pairs(times * scatter)).map(answer).collect();
    if ours == Class::Undecided {
        let is_another = |answer: &Answer| answer.class != case.truth.class || answer.word != case.truth.word;
        return answers.iter().any(is_another).then_some(Explanation::BelowResolution);
    }
    let lies_between = |ours: f64, of: fn(&Answer) -> Option<f64>| {
        let known = || answers.iter().chain([&case.truth]).filter_map(of);
        known().any(|theirs| theirs <= ours) && known().any(|theirs| theirs >= ours)
    };
    let claims = |answer: &Answer| {
        let exponent = Some([case.record.lyapunov, 0.0]);
        let mesh_fraction = Some(case.record.mesh_fraction);
        case.is_the_records(&Answer { exponent, mesh_fraction, ..answer.clone() })
    };
    let is_between = lies_between(case.record.lyapunov, |answer| answer.exponent.map(|[value, _]| value))
        && lies_between(case.record.mesh_fraction, |answer| answer.mesh_fraction);
    let is_border = answers.iter().any(|answer| case.is_the_records(answer))
        || (is_between && answers.iter().any(claims));
    is_border.then_some(Explanation::Border)
}

/// A motion this close to where it was a cycle ago rests on it as nearly as lanes can that amplify no
/// rounding: in single precision what strobes scatter by; recurrences in double precision are told apart
/// no further than this.
pub(super) fn rest(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => rules::noise(precision),
        Precision::F64 => rules::distance(rules::resolved(precision)),
    }
}
