//! What rounding at every step of a lane does to a motion, beyond what rounding at its start does.

use super::answer::{Answer, Field};
use super::case::{Case, ELSEWHERE, LANE_RESOLUTION, rounding};
use super::explanation::Explanation;
use super::lane_model::LaneModel;
use super::rounded::{Rounded, read_cycle, read_exponent};
use super::states::{HORIZON, largest};
use crate::classify::{classify, status};
use crate::gpu::LaneSettings;
use crate::model::State;
use crate::orbit::{Class, Status};
use crate::reference::Trajectory;

/// Looks at a period of a motion at rest.
const LOOKS: u32 = 64;

/// Motions that are rounded, each in its own way: of a hundred thousand cells some meet what is rare.
const RUNS: u64 = 1000;

/// And so many where the size of what rounding does is asked for.
const FEW_RUNS: u64 = 8;

/// The record's cycle is the reference's, read where every step rounds: one reading has its word and
/// impacts, and its exponent and averages lie between those that are read.
pub(super) fn rounded_cycle(case: &Case<'_>) -> Option<Explanation> {
    if case.truth.class != classify(case.record) {
        return None;
    }
    let stands = case.standing(case.strobe()?).ok()?;
    let Class::Periodic { period } = case.truth.class else { return None };
    if case.unrest(&stands, period) > ELSEWHERE {
        return None;
    }
    is_read_rounded(case, &stands, period, &case.truth)?.then_some(Explanation::BelowResolution)
}

/// Whether the record's cycle is the one that `truth` describes, read `lead` periods after where a motion
/// stands where every step rounds.
pub(super) fn is_read_rounded(
    case: &Case<'_>,
    stands: &Trajectory<'_>,
    lead: u32,
    truth: &Answer,
) -> Option<bool> {
    let Class::Periodic { period } = classify(case.record) else { return None };
    if !case.is_lane {
        return None;
    }
    let model = LaneModel::new(case)?;
    let compared = truth.compare(case.record, &case.bars);
    let agrees = |field: Field| compared.iter().all(|(of, differs)| *of != field || differs.is_none());
    let mut exponent =
        Between::new(agrees(Field::Exponent), case.record.lyapunov, truth.exponent.map(|[value, _]| value));
    let mut mesh = Between::new(agrees(Field::Mesh), case.record.mesh_fraction, truth.mesh_fraction);
    for run in 0..RUNS {
        let mut before = Rounded::new(stands, &model, run);
        if (0..lead).try_for_each(|_| before.advance_period(&mut ())).is_err() {
            continue;
        }
        let before = before.trajectory();
        let Some(answer) = read_cycle(case, &model, before, (period, truth), !run) else { continue };
        let claimed = Answer {
            exponent: Some([case.record.lyapunov, 0.0]),
            mesh_fraction: Some(case.record.mesh_fraction),
            ..answer.clone()
        };
        if !case.is_the_records(&claimed) {
            continue;
        }
        // Four tangent vectors are most of the work.
        let read = if exponent.is_open() {
            read_exponent(&model, before, period, !run)
        } else {
            Some(case.record.lyapunov)
        };
        // Neutral as it may be, a cycle has multipliers.
        let Some(value) = read else { continue };
        exponent.meets(value);
        answer.mesh_fraction.into_iter().for_each(|value| mesh.meets(value));
        if !exponent.is_open() && !mesh.is_open() {
            return Some(true);
        }
    }
    Some(false)
}

/// Whether a number of the record lies between those that are read.
struct Between {
    ours: f64,
    lies_above: bool,
    lies_below: bool,
}

impl Between {
    /// It does if it is what was first read, within the bars.
    fn new(agrees: bool, ours: f64, first: Option<f64>) -> Between {
        let mut between = Between { ours, lies_above: agrees, lies_below: agrees };
        first.into_iter().for_each(|value| between.meets(value));
        between
    }

    fn meets(&mut self, value: f64) {
        self.lies_above |= value <= self.ours;
        self.lies_below |= value >= self.ours;
    }

    fn is_open(&self) -> bool {
        !(self.lies_above && self.lies_below)
    }
}

/// How far rounding at every step takes a motion from its `image` after `period` periods, relative to its
/// size.
pub(super) fn moved_by_rounding(
    case: &Case<'_>,
    stands: &Trajectory<'_>,
    image: &State,
    period: u32,
) -> Option<f64> {
    let model = LaneModel::new(case)?;
    let moved = |run| {
        let mut motion = Rounded::new(stands, &model, run);
        (0..period).try_for_each(|_| motion.advance_period(&mut ())).ok()?;
        Some(case.apart(image, &motion.trajectory().state()))
    };
    Some((0..FEW_RUNS).filter_map(moved).fold(0.0, f64::max))
}

/// Whether a motion that is rounded at every step, over the periods after which states are compared, ends within
/// `reach` of the lane.
pub(super) fn ends_there(case: &Case<'_>, reach: f64) -> Option<bool> {
    let (lane, model) = (case.lane?, LaneModel::new(case)?);
    let start: Trajectory<'_> = Trajectory::new(&model.flow, model.law, model.start(case.start));
    let ends_there = |run| {
        let mut motion = Rounded::new(&start, &model, run);
        (0..HORIZON).all(|_| motion.advance_period(&mut ()).is_ok())
            && largest(&lane.strobe, &motion.trajectory().state()) <= reach
    };
    Some((0..RUNS).any(ends_there))
}

/// Units of position and velocity by which lanes measure: of all strobes up to the record's last.
pub(super) fn whole_units(case: &Case<'_>) -> [f64; 2] {
    let mut motion = Trajectory::<0>::new(&case.flow, case.law, case.start);
    let mut units = case.units(&case.start);
    for _ in 0..case.record.periods_run {
        if motion.advance_period(&mut ()).is_err() {
            break;
        }
        let here = case.units(&motion.state());
        units = [units[0].max(here[0]), units[1].max(here[1])];
    }
    units
}

/// The motion rests on a wall: what it still does in a period, its gap and the rate of that too, is less
/// than a lane's numbers hold. Whatever is said of its events is rounding, be it that there are too many.
pub(super) fn at_rest(case: &Case<'_>) -> Option<Explanation> {
    let is_cap = status(case.record) == Status::CapEvents;
    let is_open =
        classify(case.record) == (Class::Periodic { period: 1 }) && case.truth.class == Class::Undecided;
    if !case.is_lane || !(is_cap || is_open) {
        return None;
    }
    let there = case.strobe()?;
    let mut motion = case.after(case.start, case.record.periods_run + 1).ok()?;
    let before = motion.state();
    let [position, velocity] = case.units(&before);
    let least = rounding(case.precision);
    for look in 1..=LOOKS {
        motion.advance_to(case.flow.period * f64::from(look) / f64::from(LOOKS), &mut ()).ok()?;
        let now = case.flow.to_gap(motion.state());
        let wall = [0, 1]
            .map(|side| (now[0] - case.flow.walls[side]).abs())
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        if wall > least * position || now[1].abs() > least * velocity {
            return None;
        }
    }
    (case.apart(&before, &there) < LANE_RESOLUTION).then_some(Explanation::BelowResolution)
}

/// Whether a motion of the cell that is rounded as a lane is has more events in some period up to the
/// record's last than lanes may have.
pub(super) fn needs_more(case: &Case<'_>, seed: u64, caps: &LaneSettings) -> Option<bool> {
    let model = LaneModel::new(case)?;
    let start: Trajectory<'_> = Trajectory::new(&model.flow, model.law, model.start(case.start));
    let mut rounded = Rounded::new(&start, &model, seed);
    for _ in 0..=case.record.periods_run {
        let before = rounded.trajectory().work().events;
        let ended = rounded.advance_period(&mut ());
        if rounded.trajectory().work().events - before > u64::from(caps.events_per_period) {
            return Some(true);
        }
        if ended.is_err() {
            return Some(false);
        }
    }
    Some(false)
}
