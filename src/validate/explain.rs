//! Why a record differs from what its cell's start reaches.

use super::Kind;
use super::beside::{meets_strobe, on_its_cycle};
use super::cell::Cell;
use super::compare::Answer;
use crate::record::classify::{classify, status};
use crate::record::{Record, valid};
use rattlemap_dynamics::orbit::{Class, Status};

/// Cells, at random, that are the same within the resolution.
const MOVED: u64 = 12;

/// As many more in a map of basins: where these are mixed on every scale, an attractor may take one start in a hundred.
const MOVED_IN_BASINS: u64 = 512;

/// More of them where a transient has to last as long by chance.
const MANY_MOVED: u64 = 48;

/// What lanes on a device say of a cell when they run it again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lanes<'a> {
    /// The same lane.
    pub(super) again: Option<&'a Record>,
    /// The same lane over the whole budget.
    pub(super) whole: Option<&'a Record>,
    /// That in double precision.
    pub(super) double: Option<&'a Record>,
}

/// The kind of a mismatch. `claim` is what differs from `truth`, the reference's answer: the map's record, or what
/// judges a map of the reference itself.
pub(super) fn kind(cell: &Cell<'_>, claim: &Record, truth: &Answer, lanes: Lanes<'_>) -> Kind {
    // Such numbers are no engine's answer: there is nothing to explain.
    if claim.periods_run > cell.longest() || !cell.is_finite(claim) {
        return Kind::Unexplained;
    }
    // Caps and resolution are the lanes' own; the reference cannot tell whether they were met.
    let is_reproduced = lanes.again.is_some_and(|again| again.status == claim.status);
    if status(claim).is_failure() {
        return if is_reproduced { Kind::Cap } else { Kind::Unexplained };
    }
    // Early stops spare a costly cell what its judge has no allowance for.
    if matches!(status(&truth.record), Status::TooStiff | Status::CapEvents) {
        let is_own = lanes.again.is_some_and(|again| bytemuck::bytes_of(again) == bytemuck::bytes_of(claim));
        return if is_own { Kind::Budget } else { Kind::Unexplained };
    }
    let is_hidden = |answer: &Answer| is_reproduced && hides_period(cell, claim, answer);
    if is_hidden(truth) {
        return Kind::Border;
    }
    let agrees = |answer: &Answer| cell.bars.agree(claim, answer) || is_hidden(answer);
    let moved = if cell.bars.labels.is_some() { MOVED_IN_BASINS } else { MOVED };
    let ways = [false, true].into_iter().flat_map(|shaken| (0..moved).map(move |k| (k, shaken)));
    if ways.filter_map(|(k, shaken)| cell.moved_truth(k, shaken)).any(|answer| agrees(&answer)) {
        let stays = claim.valid & valid::STROBE != 0
            && claim.strobe.iter().all(|x| x.is_finite())
            && agrees(&cell.starting_at(claim.strobe));
        return if stays { Kind::Attractor } else { Kind::Border };
    }
    if is_too_short(cell, claim, truth, &agrees) {
        return Kind::Budget;
    }
    if is_same_beside(cell, claim, truth) {
        return if status(claim) == Status::Slow { Kind::Budget } else { Kind::Border };
    }
    // What a lane says because it stopped early is no rounding.
    let says = |lane: Option<&Record>| lane.is_some_and(|lane| agrees(&Answer::new(*lane, None)));
    let is_right = lanes.double.is_some_and(|double| cell.bars.agree(double, truth));
    let is_rounding = is_right && says(lanes.again) && says(lanes.whole);
    if is_rounding { Kind::Border } else { Kind::Unexplained }
}

/// Whether a lane says that points of its cycle lie closer together than it can tell, and so they do: the answer's
/// cycle is the same or closes earlier, within what the resolution makes of it.
fn hides_period(cell: &Cell<'_>, claim: &Record, answer: &Answer) -> bool {
    status(claim) == Status::BelowResolution
        && claim.period.is_multiple_of(answer.record.period.max(1))
        && is_multiple(cell, claim, answer)
        && cell.closes_earlier(answer.record.strobe, claim.period)
}

/// Whether a record says the same of its cycle, but for what it was to be read on the cycle for.
fn is_same_beside(cell: &Cell<'_>, claim: &Record, truth: &Answer) -> bool {
    let cycle = &truth.record;
    let is_on_strobe =
        status(claim) == Status::StrobeOnEvent && meets_strobe(cell, cycle.strobe, cycle.period);
    let status = if is_on_strobe { cycle.status } else { claim.status };
    let claim = Record { status, ..*claim };
    let agrees = |claim: &Record| cell.bars.agree(claim, truth);
    agrees(&claim) || on_its_cycle(cell, &claim).is_some_and(|claim| agrees(&claim))
}

/// Whether two cycles are the same but for status and how often one repeats the other.
fn is_multiple(cell: &Cell<'_>, claim: &Record, answer: &Answer) -> bool {
    let record = &answer.record;
    let (Class::Periodic { period: ours }, Class::Periodic { period: theirs }) =
        (classify(claim), classify(record))
    else {
        return false;
    };
    // A multiple has neither word, pattern nor symmetry of what it repeats.
    let repeated = if ours == theirs { 0 } else { valid::WORD | valid::PATTERN | valid::SYMMETRIC };
    let valid = claim.valid & !repeated;
    let once = Record { period: theirs, status: record.status, valid, ..*claim };
    (ours % theirs == 0 || theirs % ours == 0) && cell.bars.agree(&once, answer)
}

/// Whether one side would say what the other does with fewer or with more periods, or neither can tell within them.
fn is_too_short(cell: &Cell<'_>, claim: &Record, truth: &Answer, agrees: &dyn Fn(&Answer) -> bool) -> bool {
    // An approach that is called slow is not over. Where it is, lanes and the reference draw the line elsewhere.
    let is_open = |record: &Record| {
        matches!(classify(record), Class::Chaotic | Class::Undecided) || status(record) == Status::Slow
    };
    // What is left open claims nothing; nobody could have told where the motion is as slow. Nor could one tell a cycle
    // there from one that has just split off it.
    let is_undecided = classify(claim) == Class::Undecided;
    let is_untold = |answer: &Answer| {
        let claims_nothing =
            is_undecided || status(claim) == Status::Slow && is_multiple(cell, claim, answer);
        claims_nothing && !cell.bars.is_told(&answer.record)
    };
    let stopped = || (0..MANY_MOVED).filter_map(|k| cell.moved_after(k, claim.periods_run));
    let later = || (0..MOVED).filter_map(|k| cell.moved_at_leisure(k));
    is_untold(truth)
        || is_open(claim) && stopped().any(|answer| agrees(&answer) || is_untold(&answer))
        || is_open(&truth.record) && later().any(|answer| agrees(&answer))
}
