//! Explanations of mismatches.

use super::Kind;
use super::cell::Cell;
use super::compare::Answer;
use super::near_cycle::{meets_strobe, on_its_cycle};
use crate::record::classify::{classify, status};
use crate::record::{Record, valid};
use rattlemap_dynamics::orbit::{Class, Status};

/// Number of perturbed cells.
const PERTURBED: u64 = 12;

/// Number of perturbed cells in a map of basins. Where basins are mixed on every scale, only one start in a hundred may lead to the
/// record's attractor.
const PERTURBED_IN_BASINS: u64 = 512;

/// Number of perturbed cells if the transient must be as long as the transient of the record.
const MANY_PERTURBED: u64 = 48;

/// Records of lanes that computed the cell again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RepeatedLanes<'a> {
    /// The lane with the map's settings.
    pub(super) again: Option<&'a Record>,
    /// The lane without early stops.
    pub(super) whole: Option<&'a Record>,
    /// The lane without early stops in double precision.
    pub(super) double: Option<&'a Record>,
}

/// Returns the kind of a mismatch between `claim` and `truth`. The claim is the map's record. For a map that the reference computed, it is
/// the second judge's record. The truth is the reference's answer.
pub(super) fn kind(cell: &Cell<'_>, claim: &Record, truth: &Answer, lanes: RepeatedLanes<'_>) -> Kind {
    // NaN and unexpected infinities have no explanation.
    if claim.periods_run > cell.longest() || !cell.is_finite(claim) {
        return Kind::Unexplained;
    }
    // Caps and the resolution are limits of lanes, so only a repeated lane can confirm them.
    let is_reproduced = lanes.again.is_some_and(|again| again.status == claim.status);
    if status(claim).is_failure() {
        return if is_reproduced { Kind::Cap } else { Kind::Unexplained };
    }
    // Two gaps reached their walls together. Neither order is wrong.
    if [claim, &truth.record].iter().any(|record| status(record) == Status::Simultaneous) {
        return Kind::Border;
    }
    // With early stops, a computation may end before it reaches the cap that its judge reaches.
    if matches!(status(&truth.record), Status::TooStiff | Status::CapEvents) {
        let is_own = lanes.again.is_some_and(|again| again.to_bytes() == claim.to_bytes());
        return if is_own { Kind::Budget } else { Kind::Unexplained };
    }
    let is_hidden = |answer: &Answer| is_reproduced && hides_period(cell, claim, answer);
    if is_hidden(truth) {
        return Kind::Border;
    }
    let agrees = |answer: &Answer| cell.bars.agree(claim, answer) || is_hidden(answer);
    let count = if cell.bars.labels.is_some() { PERTURBED_IN_BASINS } else { PERTURBED };
    let ways = [false, true].into_iter().flat_map(|every_period| (0..count).map(move |k| (k, every_period)));
    if ways
        .filter_map(|(k, every_period)| cell.perturbed_truth(k, every_period))
        .any(|answer| agrees(&answer))
    {
        let stays = claim.valid & valid::STROBE != 0
            && claim.strobe().iter().all(|x| x.is_finite())
            && agrees(&cell.starting_at(claim.strobe()));
        return if stays { Kind::Attractor } else { Kind::Border };
    }
    if is_too_short(cell, claim, truth, &agrees) {
        return Kind::Budget;
    }
    if agrees_on_cycle(cell, claim, truth) {
        return if status(claim) == Status::Slow { Kind::Budget } else { Kind::Border };
    }
    // Rounding explains the claim only if a lane without early stops gives the same answer.
    let repeats = |lane: Option<&Record>| lane.is_some_and(|lane| agrees(&Answer::new(lane.clone(), None)));
    let is_right = lanes.double.is_some_and(|double| cell.bars.agree(double, truth));
    let is_rounding = is_right && repeats(lanes.again) && repeats(lanes.whole);
    if is_rounding { Kind::Border } else { Kind::Unexplained }
}

/// Whether the claim has the status `below_resolution` and the answer confirms it. The answer confirms it by the same status, or if
/// rounding in the claim's precision decides the period of the answer's cycle, or if that cycle closes earlier within the effect of
/// rounding.
fn hides_period(cell: &Cell<'_>, claim: &Record, answer: &Answer) -> bool {
    let closes = |answer: &Answer| {
        claim.period.is_multiple_of(answer.record.period.max(1))
            && is_multiple(cell, claim, answer)
            && cell.closes_earlier(answer.record.strobe(), claim.period)
    };
    status(claim) == Status::BelowResolution
        && (status(&answer.record) == Status::BelowResolution
            || cell.rounding_decides(&answer.record)
            || closes(answer))
}

/// Whether one side's status says that rounding decides the period: the second judge's claim or the reference's answer. Then the sides do
/// not contradict each other, unless one of them is chaotic.
pub(super) fn is_unresolved(cell: &Cell<'_>, claim: &Record, truth: &Answer) -> bool {
    let sides = [claim, &truth.record];
    let is_open = |record: &Record| matches!(classify(record), Class::Periodic { .. } | Class::Undecided);
    sides.iter().any(|record| status(record) == Status::BelowResolution)
        && sides.iter().all(|record| is_open(record) && cell.is_finite(record))
        && claim.periods_run <= cell.longest()
}

/// Whether a record agrees once its exponent and status are replaced by those of the cycle itself. The error of its averages may be
/// proportional to the distance from the cycle.
fn agrees_on_cycle(cell: &Cell<'_>, claim: &Record, truth: &Answer) -> bool {
    let cycle = &truth.record;
    let is_on_strobe =
        status(claim) == Status::StrobeOnEvent && meets_strobe(cell, cycle.strobe(), cycle.period);
    let status = if is_on_strobe { cycle.status } else { claim.status };
    let claim = Record { status, ..claim.clone() };
    cell.bars.agree(&claim, truth)
        || on_its_cycle(cell, &claim)
            .is_some_and(|(claim, distance)| cell.bars.off_cycle(distance).agree(&claim, truth))
}

/// Whether two cycles agree apart from their status. One of them may repeat the other several times.
fn is_multiple(cell: &Cell<'_>, claim: &Record, answer: &Answer) -> bool {
    let record = &answer.record;
    let (Class::Periodic { period: ours }, Class::Periodic { period: theirs }) =
        (classify(claim), classify(record))
    else {
        return false;
    };
    // The word, pattern and symmetry of a repetition differ from those of the cycle.
    let repeated = if ours == theirs { 0 } else { valid::WORD | valid::PATTERN | valid::SYMMETRIC };
    let valid = claim.valid & !repeated;
    let once = Record { period: theirs, status: record.status, valid, ..claim.clone() };
    (ours % theirs == 0 || theirs % ours == 0) && cell.bars.agree(&once, answer)
}

/// Whether one side gives the other's answer with fewer or more periods, or neither side can decide within the budget.
fn is_too_short(cell: &Cell<'_>, claim: &Record, truth: &Answer, agrees: &dyn Fn(&Answer) -> bool) -> bool {
    // The motion is still approaching its cycle slowly. Lanes and the reference have different limits for this.
    let is_open = |record: &Record| {
        matches!(classify(record), Class::Chaotic | Class::Undecided) || status(record) == Status::Slow
    };
    // An undecided claim contradicts no answer if the motion is too slow to be decided. During a slow approach, a cycle cannot be
    // distinguished from one that has just bifurcated from it.
    let is_undecided = match classify(claim) {
        // The averages of one engine may converge later than those of the other.
        Class::QuasiPeriodic => classify(&truth.record) == Class::Undecided,
        class => class == Class::Undecided,
    };
    let cannot_decide = |answer: &Answer| {
        // Far from the cycle, an exponent over several turns is not accurate.
        let open = match claim.period == answer.record.period {
            true => claim.clone(),
            false => Record { valid: claim.valid & !valid::LYAPUNOV, ..claim.clone() },
        };
        let claims_nothing =
            is_undecided || status(claim) == Status::Slow && is_multiple(cell, &open, answer);
        claims_nothing && !cell.bars.is_decisive(&answer.record)
    };
    let (until, long) = (cell.budget_of(claim.periods_run), cell.long_budget());
    let stopped = || (0..MANY_PERTURBED).filter_map(|k| cell.perturbed_within(k, &until));
    let later = || (0..PERTURBED).filter_map(|k| cell.perturbed_within(k, &long));
    // A search may find a cycle long before the motion has reached it.
    let arrives = || {
        let answer = cell.within(&long);
        let arrived = Record { status: answer.record.status, ..claim.clone() };
        matches!(classify(&answer.record), Class::Periodic { .. }) && cell.bars.agree(&arrived, &answer)
    };
    let approaches = matches!(classify(claim), Class::Periodic { .. }) && status(claim) == Status::Slow;
    cannot_decide(truth)
        || is_open(claim) && stopped().any(|answer| agrees(&answer) || cannot_decide(&answer))
        || is_open(&truth.record) && (approaches && arrives() || later().any(|answer| agrees(&answer)))
}
