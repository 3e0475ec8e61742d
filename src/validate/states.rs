//! States of lanes after a few periods against the reference's, in units of an error budget.
//!
//! The budget is what rounding alone may amount to, estimated beforehand from the reference's
//! motion: with `u` the unit roundoff, `n_k` the steps and events of the reference in period
//! `k` and `G_k` the growth of tangent vectors from there to the end,
//!
//! ```text
//! budget = 8 u  sum_k  n_k max(1, G_k, G_k+1)
//! ```
//!
//! relative to the size of the motion: a step is a product with seven columns, which rounds by
//! `8 u` at most, and an error made in period `k` grows as its tangents do. `G` is the largest
//! row sum of the derivative of the strobe map, positions in units of their largest value and
//! velocities of theirs. Tangents know nothing of errors that become their square roots where
//! an event grazes; those cells are above the budget and need an explanation. Where the budget
//! comes near the size of the motion, nothing is foreseen and nothing compared.

use super::answer::{Compared, Difference, Field, Value};
use super::case::Case;
use crate::gpu::{Gpu, GpuError, Lane, LaneSettings, Precision};
use crate::model::State;
use crate::orbit::Status;
use crate::plan::Plan;
use crate::record::{Record, valid};
use crate::reference::Trajectory;
use nalgebra::{Matrix4, Vector4};

/// Forcing periods after which states are compared: few enough for chaos to be foreseen.
pub const HORIZON: u32 = 4;

/// Roundings of one product with seven columns, summed.
pub(super) const ROUNDINGS_PER_STEP: f64 = 8.0;

/// Budgets above this share of the motion foresee nothing.
const LARGEST_BUDGET: f64 = 0.1;

/// Where the states of a sample come from.
#[derive(Clone, Debug)]
pub enum StateSource {
    /// The records of lanes that ran [`HORIZON`] periods, one per cell of the sample.
    Lanes(Vec<Record>),
    /// The map's own last strobe states: the reference made them and makes them again.
    Replay,
    /// Nowhere, for this reason.
    None(String),
}

/// Median, 99 % and largest of some errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantiles {
    /// Half of the errors are at most this.
    pub median: f64,
    /// 99 % of them are at most this.
    pub percentile_99: f64,
    /// All of them are at most this.
    pub worst: f64,
}

/// What the comparison of states came to.
#[derive(Clone, Debug, PartialEq)]
pub enum StateCheck {
    /// Lanes were run over [`HORIZON`] periods.
    Lanes {
        /// Cells compared: neither side failed, and the budget is small beside the motion.
        cells: usize,
        /// Cells above the budget; each is a mismatch.
        above_budget: usize,
        /// Errors in units of the budget.
        units: Option<Quantiles>,
        /// Errors as they are: the largest of the four entries.
        absolute: Option<Quantiles>,
    },
    /// The reference replayed itself, over as many periods as the map did.
    Replay {
        /// Cells compared.
        cells: usize,
        /// Cells whose last strobe state is the same to the bit.
        identical: usize,
        /// Errors as they are.
        absolute: Option<Quantiles>,
    },
    /// No states were compared.
    Skipped {
        /// Why.
        reason: String,
    },
}

/// The error of one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Error {
    /// In units of the budget; zero where there is none.
    units: f64,
    absolute: f64,
}

impl Error {
    pub(super) fn compared(self) -> Compared {
        let above = self.units > 1.0;
        let (record, reference) = (Value::Number(self.units), Value::Number(1.0));
        (Field::State, above.then_some(Difference { field: Field::State, record, reference }))
    }
}

/// The errors of a sample.
pub(super) struct Errors(Vec<Error>);

impl FromIterator<Error> for Errors {
    fn from_iter<T: IntoIterator<Item = Error>>(list: T) -> Errors {
        Errors(list.into_iter().collect())
    }
}

impl Errors {
    pub(super) fn check(&self, source: StateSource) -> StateCheck {
        let quantiles = |of: fn(&Error) -> f64| Quantiles::of(self.0.iter().map(of).collect());
        let (cells, absolute) = (self.0.len(), quantiles(|error| error.absolute));
        match source {
            StateSource::Lanes(_) => StateCheck::Lanes {
                cells,
                above_budget: self.0.iter().filter(|error| error.units > 1.0).count(),
                units: quantiles(|error| error.units),
                absolute,
            },
            StateSource::Replay => {
                let identical = self.0.iter().filter(|error| error.absolute == 0.0).count();
                StateCheck::Replay { cells, identical, absolute }
            }
            StateSource::None(reason) => StateCheck::Skipped { reason },
        }
    }
}

impl Quantiles {
    fn of(mut list: Vec<f64>) -> Option<Quantiles> {
        list.sort_by(f64::total_cmp);
        let last = list.len().checked_sub(1)?;
        // The smallest value that the share does not exceed.
        let at = |percent: usize| list[(last * percent).div_ceil(100)];
        Some(Quantiles { median: at(50), percentile_99: at(99), worst: at(100) })
    }
}

/// Runs lanes from where the runs `ids` started over [`HORIZON`] periods: one record per id.
/// `records` are the map's, by run, as for [`Plan::start`].
///
/// # Errors
/// A [`GpuError`].
pub async fn lane_states(
    gpu: &mut Gpu,
    plan: &Plan,
    records: &[Record],
    ids: &[u32],
    steps_per_period: Option<u32>,
) -> Result<Vec<Record>, GpuError> {
    let settings = LaneSettings { steps_per_period, ..LaneSettings::only(HORIZON) };
    run_lanes(gpu, plan, records, ids, &settings).await
}

/// Runs lanes of a plan's runs: one record per id. `records` are as for [`Plan::start`].
///
/// # Errors
/// A [`GpuError`].
pub async fn run_lanes(
    gpu: &mut Gpu,
    plan: &Plan,
    records: &[Record],
    ids: &[u32],
    settings: &LaneSettings,
) -> Result<Vec<Record>, GpuError> {
    let cells: Vec<_> = ids.iter().map(|&id| plan.cell(id)).collect();
    let numbered = |of: fn(&crate::plan::Cell) -> u32| {
        let mut list: Vec<u32> = cells.iter().map(of).collect();
        list.sort_unstable();
        list.dedup();
        list
    };
    let (flows, laws) = (numbered(|cell| cell.flow), numbered(|cell| cell.law));
    let place = |list: &[u32], index: u32| list.partition_point(|&other| other < index) as u32;
    let lanes: Vec<Lane> = cells
        .iter()
        .map(|cell| Lane {
            flow: place(&flows, cell.flow),
            law: place(&laws, cell.law),
            start: plan.start(cell.id, records),
        })
        .collect();
    let flows: Vec<_> = flows.iter().map(|&flow| plan.oscillator(flow)).collect();
    let laws: Vec<_> = laws.iter().map(|&law| plan.law(law)).collect();
    gpu.run(&flows, &laws, &lanes, settings).await
}

/// The last strobe states of the record and of the replay.
pub(super) fn replay_error(case: &Case<'_>) -> Option<Error> {
    let known = case.record.valid & valid::STROBE != 0;
    known.then(|| Error { units: 0.0, absolute: largest(&case.record.strobe, &case.measured.strobe) })
}

/// The error of a lane after [`HORIZON`] periods; none where either side fails, or rounding
/// may grow to the size of the motion.
pub(super) fn lane_error(case: &Case<'_>) -> Option<Error> {
    let lane = case.lane?;
    if lane.status != Status::Ok.code() || lane.periods_run != HORIZON {
        return None;
    }
    let Foreseen { end, growth_sum, units } = foresee(case)?;
    let budget = ROUNDINGS_PER_STEP * unit_roundoff(case.precision) * growth_sum;
    if budget > LARGEST_BUDGET {
        return None;
    }
    let by = |i: usize| (lane.strobe[i] - end[i]).abs() / units[i % 2];
    let relative = (0..4).map(by).fold(0.0, f64::max);
    Some(Error { units: relative / budget, absolute: largest(&lane.strobe, &end) })
}

/// How far the reference itself ends from where it does when its start moves within rounding.
pub(super) fn sensitivity(case: &Case<'_>) -> Option<f64> {
    let end = case.after(case.start, HORIZON).ok()?.state();
    let moved = (0..8).filter_map(|k| Some(case.after(case.nudged_start(k), HORIZON).ok()?.state()));
    Some(moved.map(|state| largest(&state, &end)).fold(0.0, f64::max))
}

/// How far a lane ends from the reference.
pub(super) fn lane_distance(case: &Case<'_>) -> Option<f64> {
    let lane = case.lane?;
    Some(largest(&lane.strobe, &case.after(case.start, HORIZON).ok()?.state()))
}

/// The largest difference of two states.
pub(super) fn largest(a: &State, b: &State) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

pub(super) fn unit_roundoff(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 0.5 * f64::from(f32::EPSILON),
        Precision::F64 => 0.5 * f64::EPSILON,
    }
}

/// The reference's motion over the horizon.
struct Foreseen {
    end: State,
    /// `sum_k n_k max(1, G_k, G_k+1)`.
    growth_sum: f64,
    /// The motion's size: positions, velocities.
    units: [f64; 2],
}

fn foresee(case: &Case<'_>) -> Option<Foreseen> {
    const UNIT: [State; 4] =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let mut trajectory = Trajectory::new(&case.flow, case.law, case.start).carrying(UNIT);
    let mut periods: Vec<(Matrix4<f64>, f64)> = Vec::new();
    let mut units = case.units(&case.start);
    for _ in 0..HORIZON {
        let before = trajectory.work();
        trajectory.set_tangents(UNIT);
        trajectory.advance_period(&mut ()).ok()?;
        let work = trajectory.work();
        let columns = trajectory.tangents().map(Vector4::from);
        let derivative = Matrix4::from_columns(&columns) * trajectory.log_scale().exp();
        periods.push((derivative, (work.steps - before.steps + work.events - before.events) as f64));
        let here = case.units(&trajectory.state());
        units = [units[0].max(here[0]), units[1].max(here[1])];
    }
    let mut to_end = Matrix4::identity();
    let mut growth_sum = 0.0;
    let mut after = 1.0f64;
    for (derivative, roundings) in periods.iter().rev() {
        to_end *= derivative;
        let from = size(&to_end, units);
        growth_sum += roundings * from.max(after).max(1.0);
        after = from;
    }
    Some(Foreseen { end: trajectory.state(), growth_sum, units })
}

/// Largest row sum of a derivative between states in the given units.
fn size(derivative: &Matrix4<f64>, units: [f64; 2]) -> f64 {
    let entry = |i: usize, j: usize| (derivative[(i, j)] * units[j % 2] / units[i % 2]).abs();
    (0..4).map(|i| (0..4).map(|j| entry(i, j)).sum::<f64>()).fold(0.0, f64::max)
}
