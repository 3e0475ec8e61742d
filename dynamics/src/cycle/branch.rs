//! Branches of cycles over one parameter, through folds, by pseudo-arclength continuation (Keller 1977).

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, DVector, RowDVector};

use super::curve::{Condition, Seed};
use super::equations::Linearised;
use super::family::{Laws, Slopes};
use super::{CycleError, Extra, Free, Itinerary, Solution, own, phase, placed, solve_scaled};
use crate::machine::{System, Touched};
use crate::model::Model;
use crate::stability::multipliers;
use crate::word::Word;

/// Largest number of Newton steps after which steps of the branch become longer, and after which its point may be on another branch.
const FEW_STEPS: usize = 5;
const MOST_EASY_STEPS: usize = 7;

/// Cosine of the angle between two tangents above which steps become longer, and below which they are repeated at half the length.
const STRAIGHT: f64 = 0.99;
const BENT: f64 = 0.9;

/// Largest number of steps of a search for a special point, and its accuracy relative to the scales of the unknowns.
const MOST_HALVINGS: usize = 60;
const LOCATED: f64 = 1e-13;
const LOCATED_ON_CURVE: f64 = 1e-10;

/// Accuracy of a special point from which a curve is followed, and of a change of the sequence of flights that no curve explains.
const ROUGHLY_LOCATED: f64 = 1e-5;
const ROUGH_BORDER: f64 = 1e-5;

/// Largest distance of a graze from the last point before it, relative to the parameter's range, beyond that of the first point behind it.
const BESIDE_TOUCH: f64 = 1e-4;

/// Value of a function at a change of its sign, relative to its values beside it, above which it jumps.
const JUMPS: f64 = 1e-3;

/// Largest value of a function that is 0, relative to its change over the scales of the unknowns.
const HAS_VALUE: f64 = 1e-10;

/// Largest number of points in a row at which a search finds no cycle.
const MOST_FAILURES: u32 = 4;

/// Largest product of the distances of multipliers at a flip or a pitchfork, and least product beside it.
const AT_FLIP: f64 = 1e-6;
const LEAST_PRODUCT: f64 = 1e-9;

/// Largest distance of a part's start from that of an equal part, relative to the size of states and to the parameter's range.
const BESIDE_START: f64 = 1e-6;

/// Least number of points of a branch that comes back to where it began.
const LEAST_LOOP: usize = 10;

/// Largest number of parts of a branch, and of one that leads to a curve.
const MOST_PARTS: usize = 64;
const FEW_PARTS: usize = 6;

/// Differences of the parameter, relative to its range, at which a branch goes on beyond a change of its sequence of flights.
const BEYOND: [f64; 6] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];

/// Step that shows in which direction events become faster.
const SHORT_STEP: f64 = 1e-6;

/// A smooth function of a cycle: of its model, and of its states and times.
#[derive(Clone, Copy)]
pub struct CycleFunction<'a>(pub &'a (dyn Fn(&dyn Model, &Solution) -> f64 + Sync));

impl fmt::Debug for CycleFunction<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CycleFunction")
    }
}

/// Limits of a branch. Lengths are relative to the scales of the unknowns, in which the parameter's range has the length 1.
#[derive(Clone, Copy, Debug)]
pub struct BranchLimits<'h> {
    /// First, least and largest length of a step.
    pub steps: [f64; 3],
    /// Largest number of points of a part.
    pub points: usize,
    /// Whether the branch ends at its first special point that a curve crosses. It is located roughly: the curve's equations are exact.
    pub to_curve: bool,
    /// Points at which one of these is 0 are special.
    pub through: &'h [CycleFunction<'h>],
    /// What is 0 on a curve of [`Condition::Value`].
    pub value: Option<CycleFunction<'h>>,
    /// The branch ends when this is raised.
    pub halt: &'h AtomicBool,
}

impl<'h> BranchLimits<'h> {
    /// Returns limits for branches over the whole range of a parameter.
    pub fn new(halt: &'h AtomicBool) -> BranchLimits<'h> {
        BranchLimits {
            steps: [1e-3, 1e-9, 2e-2],
            points: 2000,
            to_curve: false,
            through: &[],
            value: None,
            halt,
        }
    }
}

/// A cycle on a branch.
#[derive(Clone, Debug)]
pub struct BranchPoint {
    /// The cycle.
    pub solution: Solution,
    /// Value of the parameter.
    pub value: f64,
    /// Floquet multipliers `[re, im]` of the map over the itinerary, largest modulus first, without that of a shift in time.
    pub multipliers: Vec<[f64; 2]>,
    /// Length of the branch from its start.
    pub arclength: f64,
    /// Place of the multiplier that a curve keeps at 1 or -1.
    critical: Option<usize>,
    /// Unit tangent in scaled unknowns.
    pub(super) tangent: DVector<f64>,
    /// Rates at which the function of each event falls.
    approaches: Vec<f64>,
}

/// What happens at a special point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Special {
    /// The branch turns back: a multiplier is 1.
    Fold,
    /// A multiplier is -1: the period doubles.
    Flip,
    /// A multiplier is 1, and another branch crosses: of cycles that are not their own mirror images, for example.
    Pitchfork,
    /// An event disappears or begins: its function only touches 0.
    Grazing,
    /// The sequence of flights changes in another way.
    Border,
    /// A given function is 0.
    Value,
}

/// A special point of a branch.
#[derive(Clone, Debug)]
pub struct SpecialPoint {
    /// What happens.
    pub kind: Special,
    /// The cycle.
    pub at: BranchPoint,
    /// What changes the sequence of flights, if that is known.
    pub meets: Option<Touched>,
    /// The cycle at a graze, as one that touches without an event, or at an impact's limit; none if it is not known, and on curves.
    pub(super) touch: Option<(Itinerary, Solution)>,
}

/// Why a branch ends.
#[derive(Clone, Debug, PartialEq)]
pub enum BranchEnd {
    /// The parameter leaves its range.
    Range,
    /// The sequence of flights changes.
    Border,
    /// Newton's method fails even for the shortest step.
    Failed(CycleError),
    /// The branch comes back to where it began.
    Closed,
    /// The branch goes back along itself: the equations are degenerate where it turned.
    TurnsBack,
    /// The number of points is at its limit.
    Points,
    /// A curve crosses the branch.
    Curve,
    /// The computation was halted.
    Halted,
}

/// A part of a branch along which the sequence of flights is the same.
#[derive(Clone, Debug)]
pub struct Branch {
    /// The flights of its cycles.
    pub itinerary: Itinerary,
    /// The word of its cycles.
    pub word: Word,
    /// The cycles, in order.
    pub points: Vec<BranchPoint>,
    /// Special points, in order.
    pub special: Vec<SpecialPoint>,
    /// Why it ends.
    pub end: BranchEnd,
}

impl Branch {
    /// Returns the length of the part.
    pub fn length(&self) -> f64 {
        self.points.last().map_or(0.0, |point| point.arclength)
    }
}

/// What stays the same along a branch.
pub(super) struct Along<'a> {
    pub(super) model: &'a dyn Model,
    pub(super) itinerary: &'a Itinerary,
    pub(super) free: Vec<Free>,
    pub(super) scales: Vec<f64>,
    /// The last free numbers: parameters and their ranges.
    pub(super) parameters: Vec<(usize, [f64; 2])>,
    /// What defines a curve; none on a branch.
    pub(super) condition: Option<Condition>,
    /// Accuracy of special points, relative to the scales of the unknowns.
    accuracy: f64,
    /// What is 0 on a curve of [`Condition::Value`].
    pub(super) value: Option<CycleFunction<'a>>,
    /// All searches end when this is raised.
    pub(super) halt: &'a AtomicBool,
}

/// Follows the branch of a cycle over a parameter within a range, in one direction: towards larger values at first if `rises`.
///
/// # Errors
/// [`CycleError`] if the first cycle has no solution.
pub fn follow(
    model: &dyn Model,
    itinerary: &Itinerary,
    from: &Solution,
    parameter: usize,
    (range, rises): ([f64; 2], bool),
    limits: &BranchLimits<'_>,
) -> Result<Branch, CycleError> {
    let mut start = itinerary.solve(model, from)?;
    start.values = start.values.push(model.value(parameter));
    let mut along = Along::new(model, itinerary, &start, &[(parameter, range)], (None, limits))?;
    if limits.to_curve {
        along.accuracy = ROUGHLY_LOCATED;
    }
    let mut ahead = DVector::zeros(along.scales.len());
    *ahead.as_mut_slice().last_mut().expect("the parameter is an unknown") = if rises { 1.0 } else { -1.0 };
    let word = along.word(&start)?;
    along.trace(along.point(start, &ahead, 0.0, None)?, word, limits)
}

/// Follows the branch that leaves another one at a flip or at a pitchfork, in both directions: at a flip, one of them, because the other has
/// the same cycles half a cycle later.
///
/// # Errors
/// [`CycleError`] if the new branch has no cycles.
pub fn switch(
    model: &dyn Model,
    part: &Branch,
    special: &SpecialPoint,
    parameter: usize,
    range: [f64; 2],
    limits: &BranchLimits<'_>,
) -> Result<Vec<Vec<Branch>>, CycleError> {
    let (itinerary, at, is_flip) = (&part.itinerary, &special.at, special.kind == Special::Flip);
    let before = Along::new(model, itinerary, &at.solution, &[(parameter, range)], (None, limits))?;
    let (_, linearised) = before.point(at.solution.clone(), &at.tangent, 0.0, None)?;
    let size = at.solution.start.len();
    let sign = if is_flip { 1.0 } else { -1.0 };
    let scale = |i: usize, j: usize| before.scales[j] / before.scales[i];
    let singular = DMatrix::from_fn(size, size, |i, j| {
        (linearised.monodromy[(i, j)] + if i == j { sign } else { 0.0 }) * scale(i, j)
    });
    let vectors = singular.svd(false, true).v_t.ok_or(CycleError::Diverges)?;
    let along_start = DVector::from_fn(size, |j, _| vectors[(size - 1, j)] * before.scales[j]);
    // Of a flip, states and times have the opposite sign in the second half.
    let (events, mut doubled, mut start) =
        (linearised.later() * &along_start, itinerary.clone(), at.solution.clone());
    let mut of_events: Vec<f64> = events.iter().copied().collect();
    if is_flip {
        (doubled, start) = itinerary.doubled(&at.solution);
        of_events.extend(events.iter().map(|x| -x));
    }
    let along = Along::new(model, &doubled, &start, &[(parameter, range)], (None, limits))?;
    let mut ahead = DVector::zeros(along.scales.len());
    let entries = along_start.iter().chain(&of_events);
    ahead.iter_mut().zip(entries).zip(&along.scales).for_each(|((ahead, x), scale)| *ahead = x / scale);
    ahead.normalize_mut();
    let arm = |ahead: DVector<f64>| -> Result<Vec<Branch>, CycleError> {
        let mut first = along.point(start.clone(), &ahead, 0.0, None)?;
        // The equations cannot tell the tangents of the two branches apart.
        first.0.tangent = ahead;
        let word = along.word(&first.0.solution)?;
        let mut first = along.trace(first, word, limits)?;
        // The branch begins at the special point.
        first.special.retain(|special| special.at.arclength > limits.steps[0]);
        go_on(model, vec![first], parameter, range, limits)
    };
    let other = (!is_flip).then(|| arm(-&ahead)).transpose()?;
    Ok([arm(ahead)?].into_iter().chain(other).collect())
}

/// Follows a branch like [`follow`], and on with other sequences of flights where the sequence changes. Returns its parts in order.
///
/// # Errors
/// [`CycleError`] if the first cycle has no solution.
pub fn follow_on(
    model: &dyn Model,
    itinerary: &Itinerary,
    from: &Solution,
    parameter: usize,
    direction: ([f64; 2], bool),
    limits: &BranchLimits<'_>,
) -> Result<Vec<Branch>, CycleError> {
    let first = follow(model, itinerary, from, parameter, direction, limits)?;
    go_on(model, vec![first], parameter, direction.0, limits)
}

/// Follows a branch on from the end of its last part, where its sequence of flights changes.
fn go_on(
    model: &dyn Model,
    mut parts: Vec<Branch>,
    parameter: usize,
    range: [f64; 2],
    limits: &BranchLimits<'_>,
) -> Result<Vec<Branch>, CycleError> {
    let most = if limits.to_curve { FEW_PARTS } else { MOST_PARTS };
    while parts.len() < most
        && let Some(part) = parts.last()
        && let (BranchEnd::Border, Some(at)) = (&part.end, part.points.last())
        && let Some((next, seed, side)) =
            successor(model, &part.itinerary, at, parameter, (range, limits.halt))
    {
        let is_known = |part: &Branch| {
            let first = &part.points[0];
            let apart = (&first.solution.start - &seed.start).amax();
            part.itinerary.is_like(&next)
                && (first.value - at.value - side).abs() <= BESIDE_START * (range[1] - range[0])
                && apart <= BESIDE_START * seed.start.amax()
        };
        if parts.iter().any(is_known) {
            parts.last_mut().expect("there is a part").end = BranchEnd::Closed;
            break;
        }
        let mut moved = model.clone_model();
        moved.assign(parameter, at.value + side);
        let away = side > 0.0;
        // Events that begin at a graze become faster, whether the parameter rises or falls.
        let rises = match next.events() > part.itinerary.events() {
            true => steepens(&*moved, &next, &seed, parameter, (range, limits)).unwrap_or(away),
            false => away,
        };
        let beyond = follow(&*moved, &next, &seed, parameter, (range, rises), limits)?;
        // An event that passes phase 0 changes no word.
        if let Some(part) = parts.last_mut().filter(|part| part.word == beyond.word) {
            part.special.pop_if(|last| last.kind == Special::Border);
        }
        parts.push(beyond);
    }
    Ok(parts)
}

/// Returns whether the slowest event of a cycle becomes faster where the parameter rises; none if that is not known.
fn steepens(
    model: &dyn Model,
    itinerary: &Itinerary,
    from: &Solution,
    parameter: usize,
    (range, limits): ([f64; 2], &BranchLimits<'_>),
) -> Option<bool> {
    let limits = BranchLimits { steps: [SHORT_STEP; 3], points: 2, ..*limits };
    let slowest = |rises: bool| {
        let branch = follow(model, itinerary, from, parameter, (range, rises), &limits).ok()?;
        branch.points.get(1)?.approaches.iter().map(|x| x.abs()).min_by(f64::total_cmp)
    };
    Some(slowest(true)? > slowest(false)?)
}

/// Finds a cycle with another sequence of flights near the end of a part of a branch, at a slightly different value of the parameter. Returns
/// its sequence, the cycle, and the difference of the parameter.
fn successor(
    model: &dyn Model,
    itinerary: &Itinerary,
    at: &BranchPoint,
    parameter: usize,
    (range, halt): ([f64; 2], &AtomicBool),
) -> Option<(Itinerary, Solution, f64)> {
    let (values, own_count) = (&at.solution.values, at.solution.values.len() - 1);
    let mut seed = at.solution.clone();
    seed.values = values.rows(0, own_count).into_owned();
    let free = own(model).ok()?;
    let away = if fold(at) < 0.0 { -1.0 } else { 1.0 };
    let differences =
        BEYOND.into_iter().flat_map(|share| [away, -away].map(|sign| sign * share * (range[1] - range[0])));
    for difference in differences {
        if halt.load(Ordering::Relaxed) {
            return None;
        }
        let mut moved = placed(model, &free, &seed.values);
        moved.assign(parameter, at.value + difference);
        let Ok(oscillator) = moved.oscillator() else { continue };
        let system = System::new(&oscillator);
        let half_periods = itinerary.half_periods(&system);
        // An event may pass phase 0.
        let starts = [seed.state()].into_iter().chain(itinerary.beside_strobe(&system, &seed));
        let run = starts.filter_map(|state| Itinerary::of(&*moved, &state, half_periods).ok());
        let grazing = at.approaches.iter().enumerate().min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let shorter = grazing.and_then(|(nth, _)| itinerary.without(nth, &seed, false));
        for (next, start) in run.chain(shorter) {
            if !next.is_like(itinerary)
                && let Ok(solution) = next.solve(&*moved, &start)
                && next.is_followed(&*placed(&*moved, &free, &solution.values), &solution)
            {
                return Some((next, solution, difference));
            }
        }
    }
    None
}

/// A function that changes its sign at a special point.
type Test = fn(&BranchPoint) -> f64;

/// Returns the component of the tangent along the parameter, which is 0 at a fold.
fn fold(point: &BranchPoint) -> f64 {
    point.tangent[point.tangent.len() - 1]
}

/// Returns a function that is 0 where another branch crosses: the product of the distances of all multipliers from 1, divided by the component
/// of the tangent along the parameter, which is 0 at a fold, too.
fn pitchfork(point: &BranchPoint) -> f64 {
    one(point) / fold(point)
}

/// Returns the product of the distances of the regular multipliers from 1.
fn one(point: &BranchPoint) -> f64 {
    let of = |[re, im]: [f64; 2]| if im == 0.0 { re - 1.0 } else { (re - 1.0).hypot(im) };
    point.regular().map(of).product()
}

/// Returns the product of the distances of the regular multipliers from -1.
fn flip(point: &BranchPoint) -> f64 {
    let of = |[re, im]: [f64; 2]| if im == 0.0 { re + 1.0 } else { (re + 1.0).hypot(im) };
    point.regular().map(of).product()
}

/// Returns the place of the multiplier that is nearest to a number.
pub(super) fn nearest(multipliers: &[[f64; 2]], number: f64) -> Option<usize> {
    let off = |[re, im]: &[f64; 2]| (re - number).hypot(*im);
    multipliers.iter().enumerate().min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map(|(place, _)| place)
}

impl BranchPoint {
    /// Returns the multipliers without the one that a curve keeps at 1 or -1.
    fn regular(&self) -> impl Iterator<Item = [f64; 2]> {
        let kept = move |(place, _): &(usize, &[f64; 2])| Some(*place) != self.critical;
        self.multipliers.iter().enumerate().filter(kept).map(|(_, multiplier)| *multiplier)
    }

    /// Returns the changes of the parameters per arclength, relative to their ranges.
    pub fn heading(&self, parameters: usize) -> &[f64] {
        &self.tangent.as_slice()[self.tangent.len() - parameters..]
    }

    /// Whether the cycle is stable: all multipliers lie within the unit circle, except for the one that a curve keeps at 1 or -1.
    pub fn is_stable(&self) -> bool {
        self.regular().all(|[re, im]| re.hypot(im) < 1.0)
    }
}

impl<'a> Along<'a> {
    /// `start`: a solution with the values of the parameters as its last free numbers.
    pub(super) fn new(
        model: &'a dyn Model,
        itinerary: &'a Itinerary,
        start: &Solution,
        parameters: &[(usize, [f64; 2])],
        (condition, limits): (Option<Condition>, &BranchLimits<'a>),
    ) -> Result<Along<'a>, CycleError> {
        let mut free = own(model)?;
        free.extend(parameters.iter().map(|(index, _)| Free::Parameter(*index)));
        let mut scales = itinerary.scales(model, start, &free)?;
        // Lengths do not grow with the number of events.
        let (size, events) = (start.start.len(), itinerary.events());
        scales[size..size + events].fill((events as f64).sqrt());
        let ranges = parameters.iter().rev().map(|(_, [low, high])| high - low);
        scales.iter_mut().rev().zip(ranges).for_each(|(scale, range)| *scale = range);
        let accuracy = if condition.is_some() { LOCATED_ON_CURVE } else { LOCATED };
        let (parameters, value, halt) = (parameters.to_vec(), limits.value, limits.halt);
        Ok(Along { model, itinerary, free, scales, parameters, condition, accuracy, value, halt })
    }

    /// Follows a branch from a point.
    pub(super) fn trace(
        &self,
        mut now: (BranchPoint, Linearised),
        word: Word,
        limits: &BranchLimits<'_>,
    ) -> Result<Branch, CycleError> {
        let itinerary = self.itinerary.clone();
        let (points, special) = (vec![now.0.clone()], Vec::new());
        let mut branch = Branch { itinerary, word, points, special, end: BranchEnd::Points };
        let ([mut length, least, largest], mut before) = (limits.steps, None);
        while branch.points.len() < limits.points {
            if limits.halt.load(Ordering::Relaxed) {
                branch.end = BranchEnd::Halted;
                break;
            }
            let cosine = |next: &BranchPoint| now.0.tangent.dot(&next.tangent);
            let next = match self.next(&now, before.as_ref(), length) {
                Ok((next, count))
                    if (cosine(&next.0) >= BENT && count <= MOST_EASY_STEPS)
                        || (length <= least && !self.is_of_value()) =>
                {
                    let is_easy = cosine(&next.0) > STRAIGHT && count <= FEW_STEPS;
                    length = if is_easy { largest.min(1.5 * length) } else { length };
                    next
                }
                // A curve of values has no direction at a kink.
                failed if length <= least => {
                    let error = failed.err().unwrap_or(CycleError::Diverges);
                    // The model may not allow values beyond the range.
                    let is_model = matches!(error, CycleError::Model(_)) || self.is_of_value();
                    let is_at_end = is_model && self.is_beside_end(&now.0);
                    branch.end = if is_at_end { BranchEnd::Range } else { BranchEnd::Failed(error) };
                    break;
                }
                _ => {
                    length *= 0.5;
                    continue;
                }
            };
            let border = self.border(&now, &next.0);
            let last = border.as_ref().map_or(&next.0, |border| &border.at);
            branch.special.extend(self.special(&now, last, limits.to_curve));
            branch.special.extend(limits.through.iter().filter_map(|test| self.passed(&now, last, *test)));
            if let Some(border) = border {
                branch.points.push(border.at.clone());
                branch.special.push(border);
                branch.end = BranchEnd::Border;
            }
            if limits.to_curve && branch.special.iter().any(|special| Seed::of(&branch, special).is_some()) {
                branch.end = BranchEnd::Curve;
            }
            if matches!(branch.end, BranchEnd::Border | BranchEnd::Curve) {
                break;
            }
            if let Some(end) = self.end_of_range(&next.0) {
                let (number, end) = end;
                let at_end = |point: &BranchPoint| point.solution.values[number] - end;
                branch.points.extend(self.locate(&now, &next.0, &at_end));
                branch.end = BranchEnd::Range;
                break;
            }
            branch.points.push(next.0.clone());
            if branch.points.len() > LEAST_LOOP
                && self.distance(&next.0.solution, &branch.points[0].solution) < length
            {
                let (first, apart) =
                    (&branch.points[0], self.distance(&next.0.solution, &branch.points[0].solution));
                if next.0.tangent.dot(&first.tangent) > 0.0 {
                    branch.end = BranchEnd::Closed;
                    branch.points.push(BranchPoint { arclength: next.0.arclength + apart, ..first.clone() });
                } else {
                    branch.end = BranchEnd::TurnsBack;
                }
                break;
            }
            before = Some((now.0.solution.clone(), self.slope(&now)));
            now = next;
        }
        Ok(branch)
    }

    /// Returns the distance of two cycles in scaled unknowns.
    pub(super) fn distance(&self, a: &Solution, b: &Solution) -> f64 {
        let apart = a.unknowns(self.itinerary) - b.unknowns(self.itinerary);
        apart.iter().zip(&self.scales).map(|(x, scale)| (x / scale).powi(2)).sum::<f64>().sqrt()
    }

    /// Returns a free number that is out of its range at a point, and the end beyond which it lies.
    pub(super) fn end_of_range(&self, point: &BranchPoint) -> Option<(usize, f64)> {
        let first = self.free.len() - self.parameters.len();
        self.parameters.iter().enumerate().find_map(|(i, (_, [low, high]))| {
            let value = point.solution.values[first + i];
            let end = if value < *low { Some(*low) } else { (value > *high).then_some(*high) };
            Some((first + i, end?))
        })
    }

    /// Whether a parameter is almost at an end of its range.
    fn is_beside_end(&self, point: &BranchPoint) -> bool {
        let values = point.solution.values.iter().rev().zip(self.parameters.iter().rev());
        values
            .into_iter()
            .any(|(value, (_, [low, high]))| (value - low).min(high - value) <= BESIDE_START * (high - low))
    }

    /// Returns where the sequence of flights changes between two points.
    fn border(&self, now: &(BranchPoint, Linearised), next: &BranchPoint) -> Option<SpecialPoint> {
        let grazing = (0..next.approaches.len())
            .filter_map(|event| {
                let at = self.locate(now, next, &|point| point.approaches[event])?;
                let touch = self.itinerary.without(event, &at.solution, true);
                let mut events = self.itinerary.passages.iter().filter(|passage| passage.is_event());
                let meets = events.nth(event)?.touching().and_then(|touch| touch.touches());
                Some(SpecialPoint { kind: Special::Grazing, at, meets, touch })
            })
            .min_by(|a, b| a.at.arclength.total_cmp(&b.at.arclength));
        let border = || {
            if self.is_admissible(next) {
                return None;
            }
            if let Some(at) = self.event_at_strobe(now, next) {
                return Some(SpecialPoint { kind: Special::Border, at, meets: None, touch: None });
            }
            let at = self.last_admissible(now, next);
            let touch = self.touch(next, &at);
            let is_touch =
                touch.as_ref().is_some_and(|(itinerary, solution)| !itinerary.touches(solution).is_empty());
            let kind = if is_touch { Special::Grazing } else { Special::Border };
            let meets = self.itinerary.first_change(&*self.model_at(next), &next.solution);
            Some(SpecialPoint { kind, at, meets, touch })
        };
        grazing.or_else(border).filter(|border| self.end_of_range(&border.at).is_none())
    }

    /// Returns where an event comes to phase 0.
    fn event_at_strobe(&self, now: &(BranchPoint, Linearised), next: &BranchPoint) -> Option<BranchPoint> {
        let passages = &self.itinerary.passages;
        let length = passages.last().map_or(0.0, |last| last.turns);
        let found = (0..passages.len()).filter(|i| passages[*i].is_event()).flat_map(|i| {
            let test = move |end: f64| move |point: &BranchPoint| point.solution.turns[i] - end;
            [0.0, length].into_iter().filter_map(move |end| self.locate(now, next, &test(end)))
        });
        found.min_by(|a, b| a.arclength.total_cmp(&b.arclength)).filter(|at| self.is_admissible(at))
    }

    /// Returns the cycle that touches what the motion of the first cycle that is not admissible reaches.
    fn touch(&self, beyond: &BranchPoint, last: &BranchPoint) -> Option<(Itinerary, Solution)> {
        if self.condition.is_some() {
            return None;
        }
        let seeds = self.itinerary.with_next_touch(&*self.model_at(beyond), &beyond.solution)?;
        seeds.into_iter().find_map(|(itinerary, seed)| {
            let scales = itinerary.scales(self.model, &seed, &self.free).ok()?;
            let extra = |_: &Laws, linearised: &Linearised, _: &Solution, _: &[Extra]| {
                Ok(phase(linearised, &self.free).into_iter().chain(linearised.touches.clone()).collect())
            };
            let solution = itinerary.newton(self.model, seed, &self.free, &scales, &extra).ok()?.solution;
            // Another graze is not the reason why the sequence changes here.
            let (value, [low, high]) = (solution.values[solution.values.len() - 1], self.parameters[0].1);
            let is_beside =
                (value - last.value).abs() <= (beyond.value - last.value).abs() + BESIDE_TOUCH * (high - low);
            (is_beside
                && itinerary.is_followed(&*placed(self.model, &self.free, &solution.values), &solution))
            .then_some((itinerary, solution))
        })
    }

    /// Returns folds, flips and pitchforks between two points. `with_parent`: also where the branch meets one of cycles half as long.
    fn special(
        &self,
        now: &(BranchPoint, Linearised),
        next: &BranchPoint,
        with_parent: bool,
    ) -> Vec<SpecialPoint> {
        let at_flip = AT_FLIP.max(1e3 * self.accuracy);
        let on_branch: [(Special, Test, f64); 3] = [
            (Special::Fold, fold, f64::INFINITY),
            // A multiplier that passes infinity at a graze changes the sign of the products, too.
            (Special::Flip, flip, at_flip),
            (Special::Pitchfork, pitchfork, at_flip),
        ];
        let of_half = if self.itinerary.mirrored { Special::Pitchfork } else { Special::Flip };
        let on_curve: [(Special, Test, f64); 2] = [(Special::Fold, one, at_flip), (of_half, flip, at_flip)];
        let tests = if self.condition.is_some() { &on_curve[..] } else { &on_branch };
        let mut found = Vec::new();
        for &(kind, test, most) in tests {
            // Products that are rounding errors belong to families of cycles.
            let is_clear = most.is_infinite() || test(&now.0).abs().min(test(next).abs()) > LEAST_PRODUCT;
            let at = is_clear.then(|| self.locate(now, next, &test)).flatten();
            let is_there = |at: &BranchPoint| self.end_of_range(at).is_none() && test(at).abs() <= most;
            let Some(at) = at.filter(is_there) else { continue };
            let half = (kind == Special::Fold)
                .then(|| self.itinerary.half(&*self.model_at(&at), &at.solution))
                .flatten();
            let kind = match &half {
                Some((half, _)) if half.mirrored => Special::Pitchfork,
                Some(_) => Special::Flip,
                None => kind,
            };
            if half.is_none() || with_parent {
                found.push(SpecialPoint { kind, at, meets: None, touch: half });
            }
        }
        found.sort_by(|a, b| a.at.arclength.total_cmp(&b.at.arclength));
        found
    }

    /// Returns where a function is 0 between two points.
    fn passed(
        &self,
        now: &(BranchPoint, Linearised),
        next: &BranchPoint,
        test: CycleFunction<'_>,
    ) -> Option<SpecialPoint> {
        let value = |point: &BranchPoint| (test.0)(&*self.model_at(point), &point.solution);
        let (before, after) = (value(&now.0), value(next));
        // A point of the branch where the function is exactly 0 belongs to the positive side.
        let at = match (before == 0.0, after == 0.0) {
            (true, _) if after < 0.0 => now.0.clone(),
            (_, true) if before < 0.0 => next.clone(),
            _ => self.locate(now, next, &value)?,
        };
        // A function that jumps has no zero there.
        let is_zero = value(&at).abs() <= JUMPS * before.abs().max(after.abs());
        (is_zero && self.end_of_range(&at).is_none()).then_some(SpecialPoint {
            kind: Special::Value,
            at,
            meets: None,
            touch: None,
        })
    }

    fn word(&self, solution: &Solution) -> Result<Word, CycleError> {
        self.itinerary.word(&*placed(self.model, &self.free, &solution.values), solution)
    }

    fn model_at(&self, point: &BranchPoint) -> Box<dyn Model> {
        placed(self.model, &self.free, &point.solution.values)
    }

    /// Returns the equations of the phase and of the condition. `nearby`: these equations at a nearby solution, or none.
    pub(super) fn conditions(
        &self,
        laws: &Laws,
        linearised: &Linearised,
        at: &Solution,
        nearby: &[Extra],
    ) -> Result<Vec<Extra>, CycleError> {
        let mut all = phase(linearised, &self.free);
        if let Some(condition) = self.condition {
            let gradient = nearby.get(all.len()).map(|(gradient, _)| gradient);
            all.extend(condition.equations(self, laws, linearised, at, gradient)?);
        }
        Ok(all)
    }

    /// Completes a solution to a point whose tangent continues an earlier one. `nearby`: laws and further equations at a nearby solution.
    pub(super) fn point(
        &self,
        solution: Solution,
        before: &DVector<f64>,
        arclength: f64,
        nearby: Option<&(Laws, Vec<Extra>)>,
    ) -> Result<(BranchPoint, Linearised), CycleError> {
        let model = placed(self.model, &self.free, &solution.values);
        let laws = match nearby {
            Some((laws, _)) => laws.beside(&*model)?,
            None => Laws::new(&*model, &self.free, Slopes::Fast)?,
        };
        let mut linearised = self.itinerary.linearise(&laws, &solution)?;
        let (count, nearby) = (before.len(), nearby.map_or(&[][..], |(_, extra)| extra));
        let row = RowDVector::from_fn(count, |_, j| before[j] / self.scales[j]);
        linearised.extra = self.conditions(&laws, &linearised, &solution, nearby)?;
        let extra: Vec<Extra> = linearised.extra.iter().cloned().chain([(row, 0.0)]).collect();
        let (matrix, mut right) = linearised.with(&extra);
        right.fill(0.0);
        right[count - 1] = 1.0;
        let step = solve_scaled(&matrix, &right, &self.scales).ok_or(CycleError::Diverges)?;
        let tangent = DVector::from_fn(count, |j, _| step[j] / self.scales[j]).normalize();
        let mut multipliers = multipliers(&linearised.monodromy).ok_or(CycleError::Diverges)?;
        if self.free.contains(&Free::CycleTime) {
            // The choice of phase 0 on a cycle without force has the multiplier 1.
            nearest(&multipliers, 1.0).map(|place| multipliers.remove(place));
        }
        let critical = self.condition.and_then(|condition| condition.critical(&multipliers));
        let value = solution.values[solution.values.len() - 1];
        let approaches = linearised.approaches.clone();
        let point = BranchPoint { solution, value, multipliers, arclength, critical, tangent, approaches };
        Ok((point, linearised))
    }

    /// Returns the rates of change of a cycle along its branch.
    fn slope(&self, (at, linearised): &(BranchPoint, Linearised)) -> Solution {
        let direction = DVector::from_fn(at.tangent.len(), |j, _| at.tangent[j] * self.scales[j]);
        linearised.along(&at.solution, &direction)
    }

    /// Returns the point at a distance along the tangent, and the number of Newton steps. `before`: the point before this one, and its slope. A
    /// cubic through both points predicts the next one; without an earlier point, the tangent does.
    fn next(
        &self,
        now: &(BranchPoint, Linearised),
        before: Option<&(Solution, Solution)>,
        length: f64,
    ) -> Result<((BranchPoint, Linearised), usize), CycleError> {
        let (here, slope) = (&now.0.solution, self.slope(now));
        let predicted = match before {
            None => here.plus(&slope, length),
            Some((first, first_slope)) => {
                let apart = self.distance(first, here);
                // Hermite's cubic, as a sum over what it is in both points.
                let t = length / apart;
                let of_first = t * t * (3.0 + 2.0 * t);
                let of_slopes = [t * t * (1.0 + t) * apart, t * (1.0 + t) * (1.0 + t) * apart];
                here.plus(&slope, of_slopes[1])
                    .plus(first_slope, of_slopes[0])
                    .plus(first, of_first)
                    .plus(here, -of_first)
            }
        };
        self.correct(&now.0, predicted, length)
    }

    /// Returns the point across the tangent of an earlier one from a prediction, and the number of Newton steps.
    fn correct(
        &self,
        from: &BranchPoint,
        predicted: Solution,
        length: f64,
    ) -> Result<((BranchPoint, Linearised), usize), CycleError> {
        if self.halt.load(Ordering::Relaxed) {
            return Err(CycleError::Halted);
        }
        let centre = predicted.unknowns(self.itinerary);
        let row = RowDVector::from_fn(centre.len(), |_, j| from.tangent[j] / self.scales[j]);
        let extra = |laws: &Laws, linearised: &Linearised, at: &Solution, nearby: &[Extra]| {
            let ahead = &row * (at.unknowns(self.itinerary) - &centre);
            let mut all = self.conditions(laws, linearised, at, nearby)?;
            all.push((row.clone(), ahead[0]));
            Ok(all)
        };
        let found = self.itinerary.newton(self.model, predicted, &self.free, &self.scales, &extra)?;
        let (solution, length) = (found.solution, from.arclength + length);
        let next = self.point(solution, &from.tangent, length, Some(&found.nearby))?;
        // Where multipliers grow without limit, a matrix may be almost singular in another way.
        let is_critical = self.condition.is_none_or(|condition| condition.is_met(&next.0.multipliers))
            && self.has_value(&next.1);
        if is_critical { Ok((next, found.steps)) } else { Err(CycleError::Diverges) }
    }

    /// Whether a curve of the values of a function is followed.
    fn is_of_value(&self) -> bool {
        self.condition == Some(Condition::Value)
    }

    /// Whether the given function is 0 on a curve of its values. Beyond a kink of the function, its gradient leads elsewhere.
    fn has_value(&self, linearised: &Linearised) -> bool {
        let equation = linearised.extra.last().filter(|_| self.is_of_value());
        equation.is_none_or(|(gradient, value)| {
            let slope = gradient
                .iter()
                .zip(&self.scales)
                .fold(0.0, |most: f64, (x, scale)| most.max((x * scale).abs()));
            value.abs() <= HAS_VALUE * slope
        })
    }

    /// Whether the motion along the cycle has the cycle's sequence of flights.
    pub(super) fn is_admissible(&self, point: &BranchPoint) -> bool {
        self.itinerary.is_followed(&*self.model_at(point), &point.solution)
    }

    /// Returns the point between two points where a test function is 0, by inverse quadratic interpolation and bisection (Chandrupatla 1997);
    /// none if it has the same sign at both.
    fn locate(
        &self,
        from: &(BranchPoint, Linearised),
        to: &BranchPoint,
        test: &dyn Fn(&BranchPoint) -> f64,
    ) -> Option<BranchPoint> {
        let mut latest = (to.arclength - from.0.arclength, test(to), to.solution.clone());
        let mut other = (0.0, test(&from.0), from.0.solution.clone());
        // A function that is not known has no sign.
        if latest.1.is_nan() || other.1.is_nan() || latest.1 * other.1 >= 0.0 {
            return None;
        }
        let (mut found, mut share, mut failures) = (None, 0.5, 0);
        for _ in 0..MOST_HALVINGS {
            let middle = latest.0 + share * (other.0 - latest.0);
            let predicted = latest.2.between(&other.2, share);
            let Ok(((point, _), _)) = self.correct(&from.0, predicted, middle) else {
                // At a pitchfork the equations are singular: there the search goes on from other points.
                failures += 1;
                if failures > MOST_FAILURES {
                    break;
                }
                share = 0.5 + 0.1 * f64::from(failures);
                continue;
            };
            failures = 0;
            let value = test(&point);
            let next = (middle, value, point.solution.clone());
            if found.as_ref().is_none_or(|(best, _): &(f64, BranchPoint)| value.abs() <= *best) {
                found = Some((value.abs(), point));
            }
            let third = if value * latest.1 > 0.0 {
                std::mem::replace(&mut latest, next)
            } else {
                std::mem::replace(&mut other, std::mem::replace(&mut latest, next))
            };
            let least = self.accuracy / (other.0 - latest.0).abs();
            if value == 0.0 || least > 0.5 {
                break;
            }
            let ([a, b, c], [of_a, of_b, of_c]) =
                ([latest.0, other.0, third.0], [latest.1, other.1, third.1]);
            let (xi, phi) = ((a - b) / (c - b), (of_a - of_b) / (of_c - of_b));
            share = match phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
                true => {
                    of_a / (of_b - of_a) * of_c / (of_b - of_c)
                        + (c - a) / (b - a) * of_a / (of_c - of_a) * of_b / (of_c - of_b)
                }
                false => 0.5,
            };
            share = share.clamp(least, 1.0 - least);
        }
        found.map(|(_, point)| point)
    }

    /// Returns the last point at which the cycle is admissible between two points, by bisection.
    fn last_admissible(&self, from: &(BranchPoint, Linearised), to: &BranchPoint) -> BranchPoint {
        let (mut low, mut high, mut found) = (0.0, to.arclength - from.0.arclength, from.0.clone());
        let mut end = to.solution.clone();
        let is_rough = self.accuracy > LOCATED || self.condition.is_some();
        let accuracy = if is_rough { ROUGH_BORDER } else { LOCATED };
        for _ in 0..MOST_HALVINGS {
            let middle = 0.5 * (low + high);
            match self.correct(&from.0, found.solution.between(&end, 0.5), middle) {
                Ok(((point, _), _)) if self.is_admissible(&point) => (low, found) = (middle, point),
                Ok(((point, _), _)) => (high, end) = (middle, point.solution),
                Err(_) => (high, end) = (middle, found.solution.between(&end, 0.5)),
            }
            if high - low <= accuracy {
                break;
            }
        }
        found
    }
}
