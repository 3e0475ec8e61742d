//! Branches of the cycles of a bifurcation diagram, with their unstable parts.

use std::sync::atomic::AtomicBool;

use crate::map::bifurcation::Column;
use rattlemap_dynamics::cycle::{
    Branch, BranchEnd, BranchLimits, BranchPoint, CycleError, Itinerary, Special, follow_on, switch,
};
use rattlemap_dynamics::model::{Model, ModelError, State, Timing};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, quantities_on};
use rattlemap_dynamics::word::Word;

/// Largest distance of a column's state from a branch that goes through it, relative to the largest state of the branch's part there.
const ON_BRANCH: f64 = 0.02;

/// Largest relative difference of the times of the same cycle without force.
const SAME_TIME: f64 = 1e-3;

/// Largest rounding error of a value, relative to it, and of a velocity at rest, relative to displacements.
const ROUNDING: f64 = 1e-9;

/// Longest cycles, in forcing periods, that are followed from flips, and largest number of branches from one cycle.
const LONGEST: u32 = 16;
const MOST_BRANCHES: usize = 64;

/// A cycle on a branch.
#[derive(Clone, Debug)]
pub struct BranchRow {
    /// Number of the branch, from 1.
    pub branch: usize,
    /// Length from the first row of the branch, in scaled unknowns.
    pub arclength: f64,
    /// Whether the cycle is stable.
    pub stable: bool,
    /// Floquet multipliers, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// Value, word, state and quantities of the cycle.
    pub column: Column,
    /// What is special; none of an ordinary row.
    pub special: Option<Special>,
}

/// All branches of a diagram.
#[derive(Clone, Debug, Default)]
pub struct Branches {
    /// The cycles, branch by branch, in order.
    pub rows: Vec<BranchRow>,
    /// Why a branch ends within the range of the axis: its number, the value of the axis, and the reason.
    pub ends: Vec<(usize, f64, String)>,
}

/// Follows the branches of all cycles that the columns of a diagram have found, within the range of its axis. `name` is the axis' parameter.
///
/// # Errors
/// [`ModelError`] if a cell's model is not valid.
pub fn branches(
    cells: &[(f64, Box<dyn Model>)],
    columns: &[Column],
    name: &str,
    halt: &AtomicBool,
) -> Result<Branches, ModelError> {
    let values = || cells.iter().map(|cell| cell.0);
    let range = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
    let mut all = Branches::default();
    if cells.len() < 2 {
        return Ok(all);
    }
    let (mut count, limits) = (0, BranchLimits::new(halt));
    for column in columns {
        let (Class::Periodic { period }, Some(state)) = (column.class, column.state) else { continue };
        let Some((_, model)) = cells.iter().find(|cell| cell.0 == column.value) else { continue };
        let model = model.on_cycle(column.cycle_time());
        let parameter = model.index(name)?;
        if all.pass_through(column.value, period, (column.word.as_ref(), column.cycle_time()), &state) {
            continue;
        }
        let Some(arms) = arms(&*model, &state, (period, parameter), range, halt) else { continue };
        // Branches, and those that leave them at flips and pitchforks.
        let mut found = vec![(period, arms)];
        while let Some((period, arms)) = found.pop() {
            count += 1;
            all.add(count, &*model, (parameter, period), &arms)?;
            for part in arms.iter().flatten() {
                for special in &part.special {
                    let periods = match special.kind {
                        Special::Flip => 2 * period,
                        Special::Pitchfork => period,
                        Special::Fold | Special::Grazing | Special::Border | Special::Value => continue,
                    };
                    if periods > LONGEST || count + found.len() >= MOST_BRANCHES {
                        continue;
                    }
                    let leaving =
                        switch(&*model, part, special, parameter, range, &limits).unwrap_or_default();
                    let is_new = |arm: &Vec<Branch>| {
                        let first = &arm[0];
                        let middle = &first.points[first.points.len() / 2];
                        let name = (
                            Some(&first.word),
                            middle.solution.values().get(1).map(|_| middle.solution.values()[0]),
                        );
                        !all.pass_through(middle.value, periods, name, &middle.solution.state())
                    };
                    let mut arms = leaving.into_iter().filter(is_new);
                    let arms = [arms.next().unwrap_or_default(), arms.next().unwrap_or_default()];
                    if !arms[0].is_empty() {
                        found.push((periods, arms));
                    }
                }
            }
        }
    }
    Ok(all)
}

/// Follows the branch of a cycle in both directions; none if the equations have no solution.
fn arms(
    model: &dyn Model,
    state: &State,
    (period, parameter): (u32, usize),
    range: [f64; 2],
    halt: &AtomicBool,
) -> Option<[Vec<Branch>; 2]> {
    let (itinerary, seed) = Itinerary::of(model, state, 2 * period).ok()?;
    let limits = BranchLimits::new(halt);
    let arm = |rises: bool| follow_on(model, &itinerary, &seed, parameter, (range, rises), &limits);
    let (falling, rising) = rayon::join(|| arm(false), || arm(true));
    Some([falling.ok()?, rising.ok()?])
}

impl Branches {
    /// Whether a branch passes through a cycle with a word, and without force a time: then the state at phase 0 says nothing.
    fn pass_through(
        &self,
        value: f64,
        period: u32,
        (word, time): (Option<&Word>, Option<f64>),
        state: &State,
    ) -> bool {
        self.rows.windows(2).any(|pair| {
            let [a, b] = [&pair[0], &pair[1]];
            let (Some(from), Some(to)) = (a.column.state, b.column.state) else { return false };
            let (low, high) = (a.column.value.min(b.column.value), a.column.value.max(b.column.value));
            let slack = ROUNDING * value.abs();
            if a.branch != b.branch
                || a.column.word.as_ref() != word
                || a.column.class != (Class::Periodic { period })
                || !(low - slack..=high + slack).contains(&value)
            {
                return false;
            }
            let share =
                if high > low { (value - a.column.value) / (b.column.value - a.column.value) } else { 0.0 };
            let size = |first: usize| {
                from.iter().chain(&to).skip(first).step_by(2).fold(0.0, |most: f64, x| most.max(x.abs()))
            };
            if let Some(time) = time {
                let [Some(first), Some(last)] = [a, b].map(|row| row.column.cycle_time()) else {
                    return false;
                };
                return (first + share * (last - first) - time).abs() <= SAME_TIME * time;
            }
            let (displacement, velocity) = (size(0), size(1));
            // At rest, velocities are rounding errors.
            let sizes = [displacement, velocity.max(ROUNDING * displacement)];
            (0..state.len()).all(|i| {
                let on = from[i] + share * (to[i] - from[i]);
                (on - state[i]).abs() <= ON_BRANCH * sizes[i % 2]
            })
        })
    }

    /// Adds a branch from its two arms, the falling one reversed.
    fn add(
        &mut self,
        branch: usize,
        model: &dyn Model,
        (parameter, period): (usize, u32),
        arms: &[Vec<Branch>; 2],
    ) -> Result<(), ModelError> {
        let mut length = 0.0;
        let start = self.rows.len();
        for (arm, reversed) in arms.iter().zip([true, false]) {
            let mut rows = Vec::new();
            for part in arm {
                let mut points: Vec<(&BranchPoint, Option<Special>)> =
                    part.points.iter().map(|point| (point, None)).collect();
                points.extend(part.special.iter().map(|special| (&special.at, Some(special.kind))));
                points.sort_by(|a, b| {
                    a.0.arclength.total_cmp(&b.0.arclength).then(a.1.is_some().cmp(&b.1.is_some()))
                });
                let end = part.points.last().map_or(0.0, |point| point.arclength);
                for (point, special) in points {
                    rows.push(row(
                        branch,
                        length + point.arclength,
                        model,
                        (parameter, period),
                        &part.word,
                        point,
                        special,
                    )?);
                }
                length += end;
            }
            if reversed {
                rows.iter_mut().for_each(|row| row.arclength = length - row.arclength);
                rows.reverse();
            }
            if let Some((part, point)) = arm.last().and_then(|part| Some((part, part.points.last()?))) {
                let reason = match &part.end {
                    BranchEnd::Range | BranchEnd::Closed | BranchEnd::Curve => None,
                    BranchEnd::TurnsBack => Some("it goes back along itself".to_owned()),
                    BranchEnd::Border => {
                        Some("no cycle goes on where its sequence of flights changes".to_owned())
                    }
                    BranchEnd::Failed(CycleError::Diverges) => {
                        Some("Newton's method fails at the shortest step".to_owned())
                    }
                    BranchEnd::Failed(error) => Some(error.to_string()),
                    BranchEnd::Points => Some("the number of points is at its limit".to_owned()),
                    BranchEnd::Halted => Some("interrupted".to_owned()),
                };
                self.ends.extend(reason.map(|reason| (branch, point.value, reason)));
            }
            // The cycle of the column is the first one of both arms.
            self.rows.extend(rows.into_iter().skip(usize::from(!reversed)));
        }
        self.rows[start..].sort_by(|a, b| a.arclength.total_cmp(&b.arclength));
        Ok(())
    }
}

fn row(
    branch: usize,
    arclength: f64,
    model: &dyn Model,
    (parameter, period): (usize, u32),
    word: &Word,
    point: &BranchPoint,
    special: Option<Special>,
) -> Result<BranchRow, ModelError> {
    let mut model = model.clone_model();
    model.assign(parameter, point.value);
    if let [time, _] = point.solution.values() {
        model.set_cycle_time(*time);
    }
    let cycle = (period, word, point.solution.state(), &point.multipliers[..]);
    let column = measured(&*model, point.value, cycle)?;
    let (stable, multipliers) = (point.is_stable(), point.multipliers.clone());
    Ok(BranchRow { branch, arclength, stable, multipliers, column, special })
}

/// Measures a cycle, stable or not, from its period, word, state at phase 0 and multipliers. The model has the time of a cycle without force.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub fn measured(
    model: &dyn Model,
    value: f64,
    (period, word, state, multipliers): (u32, &Word, State, &[[f64; 2]]),
) -> Result<Column, ModelError> {
    let flow = Flow::of(model)?;
    let quantities = quantities_on(&flow, model.law(), state, period);
    let times = (period, flow.period, (flow.timing == Timing::Cycle).then_some(flow.period));
    Ok(Column::on_branch(value, times, word.clone(), state, quantities.as_ref(), multipliers))
}
