//! Both sides describe one cycle: may what differs in it be rounding, or the distance at which a
//! lane read it?

use super::answer::{Answer, Difference, Field};
use super::case::{Case, ELSEWHERE, LANE_RESOLUTION, rounding};
use super::explanation::Explanation;
use super::lane_model::LaneModel;
use super::reading::log_radius;
use super::rounded::Rounded;
use super::states::{ROUNDINGS_PER_STEP, unit_roundoff};
use crate::classify::classify;
use crate::gpu::Constants;
use crate::model::State;
use crate::orbit::{Class, analyse};
use crate::random::Random;
use crate::reference::Trajectory;
use crate::stability::UNIT;

/// Periods in which a confirmed cycle is reached well enough to see its symmetry.
const SETTLING_PERIODS: u32 = 400;

/// States about a lane's from which a cycle is read, and monodromy matrices within rounding.
const TRIALS: usize = 32;

/// How often tangents are rounded in a forcing period.
const ROUNDED_PER_PERIOD: u32 = 16;

/// The record describes the reference's cycle, and each field that differs has its own reason.
pub(super) fn same_cycle(case: &Case<'_>) -> Option<Explanation> {
    within_reach(case, case.strobe()?, &case.truth)
}

/// The same for the cycle that `truth` describes, which the reference reaches from `from`.
pub(super) fn within_reach(case: &Case<'_>, from: State, truth: &Answer) -> Option<Explanation> {
    let Class::Periodic { period } = truth.class else { return None };
    if truth.class != classify(case.record) {
        return None;
    }
    let stands = case.standing(from).ok()?;
    let mut claimed = truth.clone();
    let mut because = None;
    let differences = truth.compare(case.record, &case.bars).into_iter().filter_map(|(_, differs)| differs);
    for Difference { field, .. } in differences {
        let reason = match field {
            Field::Symmetric => {
                claimed.symmetric = Some(case.record.symmetric != 0);
                symmetry(case, &stands, truth, period)
            }
            Field::Exponent => {
                claimed.exponent = Some([case.record.lyapunov, 0.0]);
                exponent(case, &stands, truth, period)
            }
            Field::Mesh => {
                claimed.mesh_fraction = Some(case.record.mesh_fraction);
                mesh_fraction(case, &stands, truth, period)
            }
            _ => None,
        };
        because = because.or(Some(reason?));
    }
    // Words and impacts have no such excuse.
    case.is_the_records(&claimed).then_some(because).flatten()
}

fn symmetry(case: &Case<'_>, stands: &Trajectory<'_>, truth: &Answer, period: u32) -> Option<Explanation> {
    if !case.is_lane || period.is_multiple_of(2) {
        return None;
    }
    if case.record.symmetric == 0 {
        return steps_hide_it(case, period)?.then_some(Explanation::BelowResolution);
    }
    // The cycle differs from its mirror image by less than lanes look for.
    debug_assert_eq!(truth.symmetric, Some(false));
    let settled = case.after(stands.state(), SETTLING_PERIODS - SETTLING_PERIODS % period).ok()?;
    let mut opposite = settled.clone();
    // Lanes measure by the largest strobes.
    let mut largest = settled.state().map(f64::abs);
    for _ in 0..period / 2 {
        opposite.advance_period(&mut ()).ok()?;
        largest = std::array::from_fn(|i| largest[i].max(opposite.state()[i].abs()));
    }
    opposite.advance_to(0.5 * case.flow.period, &mut ()).ok()?;
    let (there, here) = (opposite.state(), settled.state());
    let offset: State = std::array::from_fn(|i| here[i] + there[i] + largest[i]);
    let apart = case.apart(&largest, &offset);
    (apart < LANE_RESOLUTION).then_some(Explanation::NearlySymmetric)
}

/// Whether rounding over the steps of a lane may make a cycle as unsymmetric as lanes look for.
fn steps_hide_it(case: &Case<'_>, period: u32) -> Option<bool> {
    let constants = Constants::new(&case.pair.oscillator().ok()?, None)?;
    let finest = constants.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
    let steps = f64::from(constants.steps) * finest * f64::from(period);
    Some(ROUNDINGS_PER_STEP * unit_roundoff(case.precision) * steps > LANE_RESOLUTION)
}

fn exponent(case: &Case<'_>, stands: &Trajectory<'_>, truth: &Answer, period: u32) -> Option<Explanation> {
    let ours = case.record.lyapunov;
    let contains = |values: &[f64]| {
        values.iter().any(|&value| value <= ours) && values.iter().any(|&value| value >= ours)
    };
    let read = |answer: Answer| answer.exponent.map(|[exponent, _]| exponent);
    let about: Vec<f64> = readings(case, stands, truth, period).into_iter().filter_map(read).collect();
    if contains(&about) {
        return Some(Explanation::Unsettled);
    }
    let moved: Vec<f64> = moved_cycles(case, stands, truth).into_iter().filter_map(read).collect();
    if contains(&moved) {
        return Some(Explanation::Border);
    }
    let rounded = rounded_exponents(case, stands, period)?;
    (case.is_lane && contains(&rounded)).then_some(Explanation::BelowResolution)
}

fn mesh_fraction(
    case: &Case<'_>,
    stands: &Trajectory<'_>,
    truth: &Answer,
    period: u32,
) -> Option<Explanation> {
    let ours = case.record.mesh_fraction;
    let contains = |answers: Vec<Answer>| {
        let fractions: Vec<f64> = answers.into_iter().filter_map(|answer| answer.mesh_fraction).collect();
        fractions.iter().any(|&fraction| fraction <= ours)
            && fractions.iter().any(|&fraction| fraction >= ours)
    };
    if contains(readings(case, stands, truth, period)) {
        return Some(Explanation::Unsettled);
    }
    contains(moved_cycles(case, stands, truth)).then_some(Explanation::Border)
}

/// The same cycle with parameters moved within rounding: a lane's constants are rounded, too.
fn moved_cycles(case: &Case<'_>, stands: &Trajectory<'_>, truth: &Answer) -> Vec<Answer> {
    case.nudged_pairs(rounding(case.precision))
        .map(|pair| Answer::from(&analyse(&pair, stands.state(), &case.budget.settings)))
        .filter(|other| other.class == truth.class && other.word == truth.word)
        .collect()
}

/// The cycle as it is read where the lane was, and as far about that as the cycle itself may be.
fn readings(case: &Case<'_>, stands: &Trajectory<'_>, truth: &Answer, period: u32) -> Vec<Answer> {
    let from = stands.state();
    let span = f64::from(period) * case.flow.period;
    let multiplier = truth.exponent.map_or(0.0, |[exponent, _]| (exponent * span).exp());
    // States `d` apart that shrink by a factor per cycle are `d / (1 - factor)` from their limit, less if
    // they alternate about it.
    let shrinking = case.unrest(stands, period) / (1.0 - multiplier).max(f64::MIN_POSITIVE);
    let by_derivative = case.limit(stands, period).map(|limit| case.apart(&from, &limit));
    let reaches = [Some(shrinking), by_derivative].into_iter().flatten();
    let Some(reach) = reaches.filter(|&reach| reach <= ELSEWHERE).reduce(f64::max) else { return Vec::new() };
    let units = case.units(&from);
    let mut random = Random::new(u64::from(period));
    let mut places = vec![from];
    places.extend((0..TRIALS).map(|_| {
        let mut state = from;
        for (i, x) in state.iter_mut().enumerate() {
            *x += units[i % 2] * reach * (2.0 * random.unit() - 1.0);
        }
        state
    }));
    // Another branch's cycle is another cycle.
    let is_the_same = |answer: &Answer| answer.word == truth.word;
    places
        .into_iter()
        .filter_map(|place| case.read_as_is(&stands.at(place, []), period))
        .filter(is_the_same)
        .collect()
}

/// Exponents of the cycle if its tangents are rounded again and again on the way.
fn rounded_exponents(case: &Case<'_>, stands: &Trajectory<'_>, period: u32) -> Option<Vec<f64>> {
    let error = rounding(case.precision);
    let [position, velocity] = case.units(&stands.state());
    let mut random = Random::new(u64::from(period));
    let span = f64::from(period) * case.flow.period;
    let exponent = |_| {
        let mut cycle = stands.carrying(UNIT);
        let mut log_scale = 0.0;
        for k in 1..=period * ROUNDED_PER_PERIOD {
            match k % ROUNDED_PER_PERIOD {
                0 => cycle.advance_period(&mut ()).ok()?,
                part => {
                    let until = f64::from(part) / f64::from(ROUNDED_PER_PERIOD) * case.flow.period;
                    cycle.advance_to(until, &mut ()).ok()?;
                }
            }
            log_scale += cycle.log_scale();
            cycle.set_tangents(cycle.tangents().map(|u| {
                let size = (u[0].abs().max(u[2].abs()) / position).max(u[1].abs().max(u[3].abs()) / velocity);
                let unit = [position, velocity, position, velocity];
                std::array::from_fn(|i| u[i] + error * size * unit[i] * (2.0 * random.unit() - 1.0))
            }));
        }
        Some((log_radius(cycle.tangents())? + log_scale) / span)
    };
    let model = LaneModel::of_tangents(case)?;
    let at_every_step = |run| {
        let mut cycle = Rounded::new(&stands.carrying(UNIT), &model, run).of_tangents();
        (0..period).try_for_each(|_| cycle.advance_period(&mut ())).ok()?;
        let (tangents, log_scale) = cycle.tangents();
        Some((log_radius(tangents)? + log_scale) / span)
    };
    let few = (0..TRIALS).filter_map(exponent);
    Some(few.chain((0..TRIALS as u64).filter_map(at_every_step)).collect())
}

/// Whether rounding of the tangents leaves open if the cycle that the motion is near attracts.
pub(super) fn may_repel(case: &Case<'_>, stands: &Trajectory<'_>, truth: &Answer) -> Option<bool> {
    let Class::Periodic { period } = truth.class else { return None };
    Some(rounded_exponents(case, stands, period)?.into_iter().any(|exponent| exponent >= 0.0))
}
