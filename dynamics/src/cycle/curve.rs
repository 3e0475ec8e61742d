//! Bifurcation curves: cycles with one defining condition, over two parameters.
//!
//! At folds and flips the matrix of a cycle's equations is singular. A border gives a smooth function that is 0 there, and its gradient
//! (Govaerts 2000). Along a graze, the motion touches a wall without an event, so the equations stay regular.

use std::sync::atomic::Ordering;

use nalgebra::{DMatrix, DVector, RowDVector};

use super::branch::{Along, nearest};
use super::equations::Linearised;
use super::family::{Laws, Slopes};
use super::{
    Branch, BranchEnd, BranchLimits, BranchPoint, CycleError, Extra, Free, Itinerary, Solution, Special,
    SpecialPoint, phase, placed,
};
use crate::machine::{Passage, System, Touched};
use crate::model::Model;
use crate::word::Word;

/// Step along a singular vector for the second derivatives of the equations, in scaled unknowns. Newton's method needs no better ones.
const DIFFERENCE: f64 = 1e-6;

/// Number of times that a border is chosen: the null vectors of one are the border of the next.
const BORDERS: usize = 2;

/// Largest distance of the multiplier that a condition fixes from its value.
const CRITICAL: f64 = 1e-4;

/// Lengths at which a curve goes on beyond a change of its sequence of flights, in scaled unknowns.
const BEYOND: [f64; 4] = [1e-7, 1e-5, 1e-4, 1e-3];

/// Largest number of searches for a curve with the same sequence of flights.
const MOST_TRIALS: usize = 3;

/// Largest distance of a curve's first cycle from its seed, in scaled unknowns.
const MOST_MOVED: f64 = 0.05;

/// Largest distance of a curve's next part, relative to these lengths.
const BESIDE: f64 = 10.0;

/// Largest number of parts of a curve.
const MOST_PARTS: usize = 64;

/// What defines a curve in the plane of two parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// A multiplier is 1: two cycles meet and vanish.
    Fold,
    /// A multiplier is -1: the period doubles. Of half a cycle that is its own mirror image, the symmetry ends: a pitchfork.
    Flip,
    /// The motion touches a wall, or a force or a rate touches 0, without an event; or an impact is at the limit of those after which contact
    /// lasts.
    Touch,
    /// The function [`BranchLimits::value`] is 0.
    Value,
}

/// A cycle from which a curve is followed.
#[derive(Clone, Debug)]
pub struct Seed {
    /// What defines the curve.
    pub condition: Condition,
    /// The cycle's word.
    pub word: Word,
    itinerary: Itinerary,
    /// The last free number is the parameter of a branch.
    solution: Solution,
}

impl Seed {
    /// Returns the start of the curve that crosses a branch at a special point; none if no curve is known there.
    pub fn of(part: &Branch, special: &SpecialPoint) -> Option<Seed> {
        let on_branch = || (part.itinerary.clone(), special.at.solution.clone());
        let (condition, (itinerary, solution)) = match special.kind {
            // Of cycles half as long.
            Special::Flip | Special::Pitchfork if special.touch.is_some() => {
                (Condition::Flip, special.touch.clone()?)
            }
            Special::Fold => (Condition::Fold, on_branch()),
            Special::Flip => (Condition::Flip, on_branch()),
            Special::Grazing | Special::Border => (Condition::Touch, special.touch.clone()?),
            Special::Value => (Condition::Value, on_branch()),
            Special::Pitchfork => return None,
        };
        let (half, rest) = part.word.symbols().split_at(part.word.len() / 2);
        let is_half = special.kind == Special::Flip && special.touch.is_some() && half == rest;
        let word = if is_half { Word::cyclic(half) } else { part.word.clone() };
        Some(Seed { condition, word, itinerary, solution })
    }

    /// Returns what the motion touches, or that an impact is at its limit.
    pub fn touched(&self) -> Option<Touched> {
        self.itinerary.passages.iter().find_map(|passage| passage.touches())
    }

    /// Returns the value of the branch's parameter.
    pub fn value(&self) -> f64 {
        self.solution.values[self.solution.values.len() - 1]
    }

    /// Returns the period of the cycle, in forcing periods.
    pub fn period(&self) -> u32 {
        let length = self.itinerary.passages.last().map_or(0.0, |last| last.turns);
        let factor = if self.itinerary.mirrored { 2.0 } else { 1.0 };
        (factor * length).round() as u32
    }

    /// Returns the number of events apart from touches.
    pub fn events(&self) -> usize {
        let is_event = |passage: &&Passage| passage.is_event() && !passage.is_touch();
        self.itinerary.passages.iter().filter(is_event).count()
    }

    /// Whether the sequence of flights is half of a cycle that is its own mirror image.
    pub fn is_half(&self) -> bool {
        self.itinerary.mirrored
    }
}

/// Follows a curve over two parameters within their ranges, in one direction or in the other one. `parameter`: the parameter of the branch that
/// the seed lies on.
///
/// # Errors
/// [`CycleError`] if the seed is on no curve.
pub fn curve(
    model: &dyn Model,
    seed: &Seed,
    parameter: usize,
    (parameters, forward): ([(usize, [f64; 2]); 2], bool),
    limits: &BranchLimits<'_>,
) -> Result<Vec<Branch>, CycleError> {
    let own = seed.solution.values.len() - 1;
    let of = |(index, _): (usize, _)| match index == parameter {
        true => seed.solution.values[own],
        false => model.value(index),
    };
    let mut start = seed.solution.clone();
    start.values = start.values.rows(0, own).into_owned().push(of(parameters[0])).push(of(parameters[1]));
    let other = usize::from(parameters[0].0 == parameter);
    let along = Along::new(model, &seed.itinerary, &start, &parameters, (Some(seed.condition), limits))?;
    let solve = |number: usize| {
        let direction = [0, 1].map(|i| if i == number { 1.0 } else { 0.0 });
        Ok((along.solve_across(&start, direction)?, number))
    };
    let (solved, number) = solve(other).or_else(|_: CycleError| solve(1 - other))?;
    let mut ahead = DVector::zeros(along.scales.len());
    ahead[along.scales.len() - 2 + number] = if forward { 1.0 } else { -1.0 };
    let (first, linearised) = along.point(solved, &ahead, 0.0, None)?;
    let moved = along.distance(&first.solution, &start);
    let is_met = seed.condition.is_met(&first.multipliers) && along.is_admissible(&first);
    if !is_met || along.end_of_range(&first).is_some() || moved > MOST_MOVED {
        return Err(CycleError::Diverges);
    }
    let part = along.trace((first, linearised), seed.word.clone(), limits)?;
    Ok(go_on(model, vec![part], parameters, seed.condition, limits))
}

/// Follows a curve on from the end of its last part, where its sequence of flights changes: mostly because an event passes phase 0.
fn go_on(
    model: &dyn Model,
    mut parts: Vec<Branch>,
    parameters: [(usize, [f64; 2]); 2],
    condition: Condition,
    limits: &BranchLimits<'_>,
) -> Vec<Branch> {
    while parts.len() < MOST_PARTS
        && let Some(part) = parts.last()
        && let (BranchEnd::Border, Some(at)) = (&part.end, part.points.last())
        && let Ok(along) =
            Along::new(model, &part.itinerary, &at.solution, &parameters, (Some(condition), limits))
        && let Some((itinerary, solution, ahead)) = along.successor(at)
        && let Ok(along) = Along::new(model, &itinerary, &solution, &parameters, (Some(condition), limits))
        && let Ok((mut first, linearised)) = along.point(solution, &along.towards(&ahead), 0.0, None)
    {
        let way: f64 = (0..2).map(|i| ahead[i] * first.tangent[first.tangent.len() - 2 + i]).sum();
        if way < 0.0 {
            first.tangent *= -1.0;
        }
        let word = part.word.clone();
        let [_, least, largest] = limits.steps;
        let limits = BranchLimits { steps: [0.5 * largest, least, largest], ..*limits };
        let Ok(beyond) = along.trace((first, linearised), word, &limits) else { break };
        // An event that passes phase 0 is nothing special.
        if let Some(part) = parts.last_mut() {
            part.special.pop_if(|last| last.kind == Special::Border && last.meets.is_none());
        }
        parts.push(beyond);
    }
    parts
}

impl Condition {
    /// Returns the multiplier that the condition fixes.
    fn multiplier(self) -> Option<f64> {
        match self {
            Condition::Fold => Some(1.0),
            Condition::Flip => Some(-1.0),
            Condition::Touch | Condition::Value => None,
        }
    }

    /// Returns the place of the multiplier that the condition fixes.
    pub(super) fn critical(self, multipliers: &[[f64; 2]]) -> Option<usize> {
        nearest(multipliers, self.multiplier()?)
    }

    /// Whether a multiplier has the value that the condition fixes.
    pub(super) fn is_met(self, multipliers: &[[f64; 2]]) -> bool {
        self.multiplier()
            .is_none_or(|number| multipliers.iter().any(|[re, im]| (re - number).hypot(*im) <= CRITICAL))
    }

    /// Returns the equations of the condition. `gradient`: that of a nearby solution, if it is known.
    pub(super) fn equations(
        self,
        along: &Along<'_>,
        laws: &Laws,
        linearised: &Linearised,
        at: &Solution,
        gradient: Option<&RowDVector<f64>>,
    ) -> Result<Vec<Extra>, CycleError> {
        match self {
            Condition::Touch => return Ok(linearised.touches.clone()),
            Condition::Value => return Ok(along.value_equation(at, gradient).into_iter().collect()),
            Condition::Fold | Condition::Flip => {}
        }
        // The time of a cycle without force is an unknown, too.
        let has_own = along.free.contains(&Free::CycleTime) && self == Condition::Fold;
        let (size, all) = (at.start.len(), linearised.residual.len());
        let count = all + usize::from(has_own);
        let mut matrix = linearised.matrix.columns(0, count).into_owned();
        if self == Condition::Flip {
            (0..size).for_each(|i| matrix[(i, i)] += 2.0);
        }
        if has_own {
            matrix = matrix.insert_row(all, 0.0);
            matrix.set_row(all, &phase(linearised, &along.free).remove(0).0.columns(0, count));
        }
        let mut scaled = DMatrix::from_fn(count, count, |i, j| matrix[(i, j)] * along.scales[j]);
        let sizes: Vec<f64> = scaled.row_iter().map(|row| row.amax().max(f64::MIN_POSITIVE)).collect();
        scaled.row_iter_mut().zip(&sizes).for_each(|(mut row, size)| row /= *size);
        let [left, right, value] = singular(&scaled).ok_or(CycleError::Diverges)?;
        if let Some(gradient) = gradient {
            return Ok(vec![(gradient.clone(), value[0])]);
        }
        let mut step = DVector::zeros(along.scales.len());
        (0..count).for_each(|j| step[j] = right[j] * along.scales[j] * DIFFERENCE);
        let weights = RowDVector::from_fn(all, |_, i| -left[i] / sizes[i]);
        // The gradient is the derivative of the rows along the right null vector.
        let mut moved = at.clone();
        linearised.shift(&mut moved, along.itinerary, &step);
        let there = if has_own {
            let model = placed(along.model, &along.free, &moved.values);
            along.itinerary.linearise(&Laws::new(&*model, &along.free, Slopes::Fast)?, &moved)?
        } else {
            along.itinerary.linearise(laws, &moved)?
        };
        let gradient = weights * (there.matrix - &linearised.matrix) / DIFFERENCE;
        Ok(vec![(gradient, value[0])])
    }
}

/// Returns the approximate left and right null vectors of a matrix that is almost singular, and a smooth function that is 0 where it is singular:
/// the last unknown of the matrix with a border (Govaerts 2000, section 3.3). None if the matrix has two such vectors.
fn singular(matrix: &DMatrix<f64>) -> Option<[DVector<f64>; 3]> {
    let count = matrix.nrows();
    // Any vector that is not orthogonal to the null vectors will do: sums of entries are often 0.
    let mut left = DVector::from_fn(count, |i, _| 1.0 / (1.0 + i as f64));
    let mut right = left.clone();
    let mut found = None;
    for _ in 0..BORDERS {
        let mut bordered = matrix.clone().resize(count + 1, count + 1, 0.0);
        bordered.view_mut((0, count), (count, 1)).copy_from(&left);
        bordered.view_mut((count, 0), (1, count)).copy_from(&right.transpose());
        let mut unit = DVector::zeros(count + 1);
        unit[count] = 1.0;
        let by_left = bordered.transpose().lu().solve(&unit)?;
        let by_right = bordered.lu().solve(&unit)?;
        let value = by_right.rows(count, 1).into_owned();
        let vectors = [by_left, by_right].map(|solved| solved.rows(0, count).into_owned());
        (left, right) = (vectors[0].normalize(), vectors[1].normalize());
        let [of_left, of_right] = vectors;
        found = Some([of_left, of_right, value]);
    }
    found.filter(|found| found.iter().all(|vector| vector.iter().all(|x| x.is_finite())))
}

impl Along<'_> {
    /// Returns the given function, and its gradient by the state at phase 0 and the free numbers: the measured motion follows from these.
    fn value_equation(&self, at: &Solution, gradient: Option<&RowDVector<f64>>) -> Option<Extra> {
        let test = self.value?;
        let value = |at: &Solution| (test.0)(&*placed(self.model, &self.free, &at.values), at);
        let (size, count, here) = (at.start.len(), self.scales.len(), value(at));
        let first = count - self.free.len();
        let slope = |j: usize| {
            if (size..first).contains(&j) {
                return 0.0;
            }
            let h = DIFFERENCE * self.scales[j];
            let moved = |h: f64| {
                let mut moved = at.clone();
                if j < size {
                    moved.start[j] += h
                } else {
                    moved.values[j - first] += h
                }
                value(&moved)
            };
            // At an end of a parameter's range the model has no motion on one side.
            let slopes = [h, -h].map(|h| (moved(h) - here) / h);
            match slopes.map(f64::is_nan) {
                [true, _] => slopes[1],
                [_, true] => slopes[0],
                _ => 0.5 * (slopes[0] + slopes[1]),
            }
        };
        let gradient = gradient.cloned().unwrap_or_else(|| RowDVector::from_fn(count, |_, j| slope(j)));
        Some((gradient, here))
    }

    /// Solves all equations where the scaled parameters only change across a direction.
    fn solve_across(&self, at: &Solution, direction: [f64; 2]) -> Result<Solution, CycleError> {
        let (count, first) = (self.scales.len(), at.values.len() - 2);
        let mut row = RowDVector::zeros(count);
        (0..2).for_each(|i| row[count - 2 + i] = direction[i] / self.scales[count - 2 + i]);
        let centre = [0, 1].map(|i| at.values[first + i]);
        let extra = |laws: &Laws, linearised: &Linearised, at: &Solution, nearby: &[Extra]| {
            let mut all = self.conditions(laws, linearised, at, nearby)?;
            let ahead = (0..2).map(|i| row[count - 2 + i] * (at.values[first + i] - centre[i])).sum();
            all.push((row.clone(), ahead));
            Ok(all)
        };
        let found = self.itinerary.newton(self.model, at.clone(), &self.free, &self.scales, &extra)?;
        Ok(found.solution)
    }

    /// Returns the unit vector of scaled unknowns in the direction of the larger one of two changes of the parameters.
    fn towards(&self, ahead: &[f64; 2]) -> DVector<f64> {
        let mut unit = DVector::zeros(self.scales.len());
        let larger = usize::from(ahead[1].abs() > ahead[0].abs());
        unit[self.scales.len() - 2 + larger] = ahead[larger].signum();
        unit
    }

    /// Whether a cycle has almost the same parameters as a point at a distance from it.
    fn is_beside(&self, at: &BranchPoint, solution: &Solution, distance: f64) -> bool {
        let (values, scales) = (&at.solution.values, self.scales.iter().rev());
        let pairs = values.iter().rev().zip(solution.values.iter().rev()).zip(scales);
        pairs.take(self.parameters.len()).all(|((a, b), scale)| (a - b).abs() <= BESIDE * distance * scale)
    }

    /// Finds the cycle with another sequence of flights at which a curve goes on beyond its end. Returns the direction of the curve, too: the
    /// changes of its scaled parameters.
    fn successor(&self, at: &BranchPoint) -> Option<(Itinerary, Solution, [f64; 2])> {
        let count = at.tangent.len();
        let ahead = [at.tangent[count - 2], at.tangent[count - 1]];
        let laws = Laws::new(&*placed(self.model, &self.free, &at.solution.values), &self.free, Slopes::Fast)
            .ok()?;
        let linearised = self.itinerary.linearise(&laws, &at.solution).ok()?;
        let mut tried: Vec<Itinerary> = Vec::new();
        for length in BEYOND {
            if self.halt.load(Ordering::Relaxed) {
                return None;
            }
            let step = DVector::from_fn(count, |j, _| at.tangent[j] * self.scales[j] * length);
            let mut seed = at.solution.clone();
            linearised.change(&mut seed, self.itinerary, &step);
            let model = placed(self.model, &self.free, &seed.values);
            let Ok(oscillator) = model.oscillator() else { continue };
            let system = System::new(&oscillator);
            let half_periods = self.itinerary.half_periods(&system);
            let at_limit = self.itinerary.beside_limit(&seed, &self.scales);
            for state in at_limit.into_iter().chain(self.itinerary.beside_strobe(&system, &seed)) {
                let Ok((next, mut start)) = Itinerary::of(&*model, &state, half_periods) else { continue };
                start.values = seed.values.clone();
                let Some((next, start)) = self.itinerary.touching(&seed, (next, start)) else { continue };
                let trials = tried.iter().filter(|tried| tried.is_like(&next)).count();
                if next.is_like(self.itinerary) || trials == MOST_TRIALS {
                    continue;
                }
                tried.push(next.clone());
                let limits = BranchLimits { value: self.value, ..BranchLimits::new(self.halt) };
                let kind = (self.condition, &limits);
                let Ok(beyond) = Along::new(self.model, &next, &start, &self.parameters, kind) else {
                    continue;
                };
                if let Ok(solution) = beyond.solve_across(&start, ahead)
                    && self.is_beside(at, &solution, length)
                    && next.is_followed(&*placed(self.model, &self.free, &solution.values), &solution)
                {
                    return Some((next, solution, ahead));
                }
            }
        }
        None
    }
}
