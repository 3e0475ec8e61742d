//! Branches of cycles over one parameter, through folds, by pseudo-arclength continuation (Keller 1977).

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, DVector, RowDVector};

use super::equations::Linearised;
use super::{CycleError, Free, Itinerary, Solution, own, phase, placed, solve_scaled};
use crate::machine::System;
use crate::model::Model;
use crate::stability::multipliers;
use crate::word::Word;

/// Largest number of Newton steps after which steps of the branch become longer.
const FEW_STEPS: usize = 4;

/// Cosine of the angle between two tangents above which steps become longer, and below which they are repeated at half the length.
const STRAIGHT: f64 = 0.995;
const BENT: f64 = 0.9;

/// Largest number of steps of a search for a special point, and its accuracy relative to the scales of the unknowns.
const MOST_HALVINGS: usize = 60;
const LOCATED: f64 = 1e-13;

/// Largest number of points in a row at which a search finds no cycle.
const MOST_FAILURES: u32 = 4;

/// Largest product of the distances of multipliers at a flip or a pitchfork, and least product beside it.
const AT_FLIP: f64 = 1e-6;
const LEAST_PRODUCT: f64 = 1e-9;

/// Largest distance of a part's start from that of an equal part, relative to the size of states and to the parameter's range.
const BESIDE_START: f64 = 1e-6;

/// Least number of points of a branch that comes back to where it began.
const LEAST_LOOP: usize = 10;

/// Largest number of parts of a branch.
const MOST_PARTS: usize = 64;

/// Differences of the parameter, relative to its range, at which a branch goes on beyond a change of its sequence of flights.
const BEYOND: [f64; 6] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];

/// Step that shows in which direction events become faster.
const SHORT_STEP: f64 = 1e-6;

/// Limits of a branch. Lengths are relative to the scales of the unknowns, in which the parameter's range has the length 1.
#[derive(Clone, Copy, Debug)]
pub struct BranchLimits<'h> {
    /// First, least and largest length of a step.
    pub steps: [f64; 3],
    /// Largest number of points of a part.
    pub points: usize,
    /// The branch ends when this is raised.
    pub halt: &'h AtomicBool,
}

impl<'h> BranchLimits<'h> {
    /// Returns limits for branches over the whole range of a parameter.
    pub fn new(halt: &'h AtomicBool) -> BranchLimits<'h> {
        BranchLimits { steps: [1e-3, 1e-9, 2e-2], points: 2000, halt }
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
    /// Unit tangent in scaled unknowns.
    tangent: DVector<f64>,
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
    /// An event disappears: its function only touches 0.
    Grazing,
    /// A new event begins, or the sequence of flights changes in another way.
    Border,
}

/// A special point of a branch.
#[derive(Clone, Debug)]
pub struct SpecialPoint {
    /// What happens.
    pub kind: Special,
    /// The cycle.
    pub at: BranchPoint,
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
    /// The number of points is at its limit.
    Points,
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

/// What stays the same along a branch.
struct Along<'a> {
    model: &'a dyn Model,
    itinerary: &'a Itinerary,
    free: Vec<Free>,
    scales: Vec<f64>,
    range: [f64; 2],
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
    let along = Along::new(model, itinerary, &start, parameter, range)?;
    let mut ahead = DVector::zeros(along.scales.len());
    *ahead.as_mut_slice().last_mut().expect("the parameter is an unknown") = if rises { 1.0 } else { -1.0 };
    along.trace(along.point(start, &ahead, 0.0)?, limits)
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
    let before = Along::new(model, itinerary, &at.solution, parameter, range)?;
    let (_, linearised) = before.point(at.solution.clone(), &at.tangent, 0.0)?;
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
    let along = Along::new(model, &doubled, &start, parameter, range)?;
    let mut ahead = DVector::zeros(along.scales.len());
    let entries = along_start.iter().chain(&of_events);
    ahead.iter_mut().zip(entries).zip(&along.scales).for_each(|((ahead, x), scale)| *ahead = x / scale);
    ahead.normalize_mut();
    let arm = |ahead: DVector<f64>| -> Result<Vec<Branch>, CycleError> {
        let mut first = along.point(start.clone(), &ahead, 0.0)?;
        // The equations cannot tell the tangents of the two branches apart.
        first.0.tangent = ahead;
        let mut first = along.trace(first, limits)?;
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
    while parts.len() < MOST_PARTS
        && let Some(part) = parts.last()
        && let (BranchEnd::Border, Some(at)) = (&part.end, part.points.last())
        && let Some((next, seed, side)) = successor(model, &part.itinerary, at, parameter, range)
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
    range: [f64; 2],
) -> Option<(Itinerary, Solution, f64)> {
    let (values, own_count) = (&at.solution.values, at.solution.values.len() - 1);
    let mut seed = at.solution.clone();
    seed.values = values.rows(0, own_count).into_owned();
    let free = own(model).ok()?;
    let away = if fold(at) < 0.0 { -1.0 } else { 1.0 };
    let differences =
        BEYOND.into_iter().flat_map(|share| [away, -away].map(|sign| sign * share * (range[1] - range[0])));
    for difference in differences {
        let mut moved = placed(model, &free, &seed.values);
        moved.assign(parameter, at.value + difference);
        let Ok(oscillator) = moved.oscillator() else { continue };
        let system = System::new(&oscillator);
        let half_periods = itinerary.half_periods(&system);
        // An event may pass phase 0.
        let starts = [seed.state()].into_iter().chain(itinerary.beside_strobe(&system, &seed));
        let run = starts.filter_map(|state| Itinerary::of(&*moved, &state, half_periods).ok());
        let grazing = at.approaches.iter().enumerate().min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let shorter = grazing.and_then(|(nth, _)| itinerary.without(nth, &seed));
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
    let of = |[re, im]: &[f64; 2]| if *im == 0.0 { re - 1.0 } else { (re - 1.0).hypot(*im) };
    point.multipliers.iter().map(of).product::<f64>() / fold(point)
}

/// Returns the product of the distances of all multipliers from -1.
fn flip(point: &BranchPoint) -> f64 {
    let of = |[re, im]: &[f64; 2]| if *im == 0.0 { re + 1.0 } else { (re + 1.0).hypot(*im) };
    point.multipliers.iter().map(of).product()
}

impl BranchPoint {
    /// Whether the cycle is stable: all multipliers lie within the unit circle.
    pub fn is_stable(&self) -> bool {
        self.multipliers.iter().all(|[re, im]| re.hypot(*im) < 1.0)
    }
}

impl<'a> Along<'a> {
    /// `start`: a solution with the value of the parameter as its last free number.
    fn new(
        model: &'a dyn Model,
        itinerary: &'a Itinerary,
        start: &Solution,
        parameter: usize,
        range: [f64; 2],
    ) -> Result<Along<'a>, CycleError> {
        let mut free = own(model)?;
        free.push(Free::Parameter(parameter));
        let mut scales = itinerary.scales(model, start, &free)?;
        *scales.last_mut().expect("the parameter is an unknown") = range[1] - range[0];
        Ok(Along { model, itinerary, free, scales, range })
    }

    /// Follows a branch from a point.
    fn trace(
        &self,
        mut now: (BranchPoint, Linearised),
        limits: &BranchLimits<'_>,
    ) -> Result<Branch, CycleError> {
        let (itinerary, word) =
            (self.itinerary.clone(), self.itinerary.word(self.model_at(&now.0).as_ref(), &now.0.solution)?);
        let (points, special) = (vec![now.0.clone()], Vec::new());
        let mut branch = Branch { itinerary, word, points, special, end: BranchEnd::Points };
        let [mut length, least, largest] = limits.steps;
        while branch.points.len() < limits.points {
            if limits.halt.load(Ordering::Relaxed) {
                branch.end = BranchEnd::Halted;
                break;
            }
            let cosine = |next: &BranchPoint| now.0.tangent.dot(&next.tangent);
            let next = match self.next(&now, length) {
                Ok((next, count)) if cosine(&next.0) >= BENT || length <= least => {
                    let is_easy = cosine(&next.0) > STRAIGHT && count <= FEW_STEPS;
                    length = if is_easy { largest.min(1.5 * length) } else { length };
                    next
                }
                Err(error) if length <= least => {
                    branch.end = BranchEnd::Failed(error);
                    break;
                }
                _ => {
                    length *= 0.5;
                    continue;
                }
            };
            let border = self.border(&now, &next.0);
            branch.special.extend(self.special(&now, &next.0, border.as_ref().map(|(_, at)| at.arclength)));
            if let Some((kind, at)) = border {
                branch.points.push(at.clone());
                branch.special.push(SpecialPoint { kind, at });
                branch.end = BranchEnd::Border;
                break;
            }
            if let Some(end) = self.end_of_range(&next.0) {
                let at_end = |point: &BranchPoint| point.value - end;
                branch.points.extend(self.locate(&now, &next.0, &at_end));
                branch.end = BranchEnd::Range;
                break;
            }
            branch.points.push(next.0.clone());
            if branch.points.len() > LEAST_LOOP && self.distance(&next.0, &branch.points[0]) < length {
                branch.end = BranchEnd::Closed;
                break;
            }
            now = next;
        }
        Ok(branch)
    }

    /// Returns the distance of two cycles in scaled unknowns.
    fn distance(&self, a: &BranchPoint, b: &BranchPoint) -> f64 {
        let apart = a.solution.unknowns(self.itinerary) - b.solution.unknowns(self.itinerary);
        apart.iter().zip(&self.scales).map(|(x, scale)| (x / scale).powi(2)).sum::<f64>().sqrt()
    }

    /// Returns the end of the parameter's range beyond which a point lies.
    fn end_of_range(&self, point: &BranchPoint) -> Option<f64> {
        let [low, high] = self.range;
        if point.value < low { Some(low) } else { (point.value > high).then_some(high) }
    }

    /// Returns where the sequence of flights changes between two points.
    fn border(&self, now: &(BranchPoint, Linearised), next: &BranchPoint) -> Option<(Special, BranchPoint)> {
        let grazing = (0..next.approaches.len())
            .filter_map(|event| self.locate(now, next, &|point| point.approaches[event]))
            .min_by(|a, b| a.arclength.total_cmp(&b.arclength))
            .map(|at| (Special::Grazing, at));
        let border =
            || (!self.is_admissible(next)).then(|| (Special::Border, self.last_admissible(now, next)));
        grazing.or_else(border).filter(|(_, at)| self.end_of_range(at).is_none())
    }

    /// Returns folds, flips and pitchforks between two points, up to a given arclength.
    fn special(
        &self,
        now: &(BranchPoint, Linearised),
        next: &BranchPoint,
        end: Option<f64>,
    ) -> Vec<SpecialPoint> {
        let tests: [(Special, Test, f64); 3] = [
            (Special::Fold, fold, f64::INFINITY),
            // A multiplier that passes infinity at a graze changes the sign of the products, too.
            (Special::Flip, flip, AT_FLIP),
            (Special::Pitchfork, pitchfork, AT_FLIP),
        ];
        let mut found = Vec::new();
        for (kind, test, most) in tests {
            // Products that are rounding errors belong to families of cycles.
            let is_clear = kind == Special::Fold || test(&now.0).abs().min(test(next).abs()) > LEAST_PRODUCT;
            let at = is_clear.then(|| self.locate(now, next, &test)).flatten();
            let is_there = |at: &BranchPoint| {
                self.end_of_range(at).is_none()
                    && test(at).abs() <= most
                    && end.is_none_or(|end| at.arclength < end)
            };
            found.extend(at.filter(is_there).map(|at| SpecialPoint { kind, at }));
        }
        found.sort_by(|a, b| a.at.arclength.total_cmp(&b.at.arclength));
        found
    }

    fn model_at(&self, point: &BranchPoint) -> Box<dyn Model> {
        placed(self.model, &self.free, &point.solution.values)
    }

    /// Completes a solution to a point whose tangent continues an earlier one.
    fn point(
        &self,
        solution: Solution,
        before: &DVector<f64>,
        arclength: f64,
    ) -> Result<(BranchPoint, Linearised), CycleError> {
        let model = placed(self.model, &self.free, &solution.values);
        let linearised = self.itinerary.linearise(&*model, &solution, &self.free)?;
        let count = before.len();
        let row = RowDVector::from_fn(count, |_, j| before[j] / self.scales[j]);
        let mut extra = phase(&linearised, &self.free);
        extra.push((row, 0.0));
        let (matrix, mut right) = linearised.with(&extra);
        right.fill(0.0);
        right[count - 1] = 1.0;
        let step = solve_scaled(&matrix, &right, &self.scales).ok_or(CycleError::Diverges)?;
        let tangent = DVector::from_fn(count, |j, _| step[j] / self.scales[j]).normalize();
        let mut multipliers = multipliers(&linearised.monodromy).ok_or(CycleError::Diverges)?;
        if self.free.contains(&Free::CycleTime) {
            // The choice of phase 0 on a cycle without force has the multiplier 1.
            let off = |[re, im]: &[f64; 2]| (re - 1.0).hypot(*im);
            let nearest = multipliers.iter().enumerate().min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
            nearest.map(|(place, _)| place).map(|place| multipliers.remove(place));
        }
        let value = solution.values[solution.values.len() - 1];
        let approaches = linearised.approaches.clone();
        Ok((BranchPoint { solution, value, multipliers, arclength, tangent, approaches }, linearised))
    }

    /// Returns the point at a distance along the tangent, and the number of Newton steps.
    fn next(
        &self,
        (from, linearised): &(BranchPoint, Linearised),
        length: f64,
    ) -> Result<((BranchPoint, Linearised), usize), CycleError> {
        let mut predicted = from.solution.clone();
        let scaled = |j: usize| from.tangent[j] * self.scales[j];
        let step = DVector::from_fn(from.tangent.len(), |j, _| scaled(j) * length);
        linearised.change(&mut predicted, self.itinerary, &step);
        let centre = predicted.unknowns(self.itinerary);
        let row = RowDVector::from_fn(step.len(), |_, j| from.tangent[j] / self.scales[j]);
        let extra = |linearised: &Linearised, at: &Solution| {
            let ahead = &row * (at.unknowns(self.itinerary) - &centre);
            let mut all = phase(linearised, &self.free);
            all.push((row.clone(), ahead[0]));
            all
        };
        let (solution, count) =
            self.itinerary.newton(self.model, predicted, &self.free, &self.scales, &extra)?;
        Ok((self.point(solution, &from.tangent, from.arclength + length)?, count))
    }

    /// Whether the motion along the cycle has the cycle's sequence of flights.
    fn is_admissible(&self, point: &BranchPoint) -> bool {
        self.itinerary.is_followed(&*self.model_at(point), &point.solution)
    }

    /// Returns the point between two points where a test function is 0, by false position and bisection; none if it has the same sign at both.
    fn locate(
        &self,
        from: &(BranchPoint, Linearised),
        to: &BranchPoint,
        test: &dyn Fn(&BranchPoint) -> f64,
    ) -> Option<BranchPoint> {
        let length = to.arclength - from.0.arclength;
        let (mut low, mut high) = ((0.0, test(&from.0)), (length, test(to)));
        let mut found = None;
        let (opposite, mut failures) = (low.1 * high.1 < 0.0, 0);
        for nth in (0..MOST_HALVINGS).take_while(|_| opposite) {
            // At a pitchfork the equations are singular: there the search goes on from other points.
            let share = match failures {
                0 if nth % 3 == 2 => 0.5,
                0 => low.1 / (low.1 - high.1),
                _ => 0.5 + 0.1 * f64::from(failures),
            };
            let middle = low.0 + share.clamp(1e-3, 1.0 - 1e-3) * (high.0 - low.0);
            let Ok(((point, _), _)) = self.next(from, middle) else {
                failures += 1;
                if failures > MOST_FAILURES {
                    break;
                }
                continue;
            };
            let value = test(&point);
            if value * low.1 > 0.0 {
                low = (middle, value)
            } else {
                high = (middle, value)
            }
            (found, failures) = (Some(point), 0);
            if value == 0.0 || high.0 - low.0 <= LOCATED {
                break;
            }
        }
        found
    }

    /// Returns the last point at which the cycle is admissible between two points, by bisection.
    fn last_admissible(&self, from: &(BranchPoint, Linearised), to: &BranchPoint) -> BranchPoint {
        let (mut low, mut high, mut found) = (0.0, to.arclength - from.0.arclength, from.0.clone());
        for _ in 0..MOST_HALVINGS {
            let middle = 0.5 * (low + high);
            match self.next(from, middle) {
                Ok(((point, _), _)) if self.is_admissible(&point) => (low, found) = (middle, point),
                _ => high = middle,
            }
            if high - low <= LOCATED {
                break;
            }
        }
        found
    }
}
