//! Chaos as a lane would call it, on the reference's own motion.
//!
//! Over few periods an exponent and its standard error depend on what the tangent vector is
//! measured in, on the blocks that the error is made of and on where they begin. Lanes have
//! their own rule ([`Averaging`]); applied to the reference's motion, or to one that starts or
//! is rounded as a lane's is, it gives a record's chaos or shows that there was none.

use super::answer::Answer;
use super::averages::UNSURE;
use super::case::Case;
use super::explanation::Explanation;
use super::lane_model::LaneModel;
use super::reading::counts;
use super::rounded::Rounded;
use super::states::unit_roundoff;
use crate::classify::classify;
use crate::flow::Flow;
use crate::gpu::Averaging;
use crate::model::{Law, State};
use crate::orbit::{CHAOS_ERRORS, Class, Scatter};
use crate::reference::{Stop, Trajectory};

/// Lane units in which a fresh tangent vector points nowhere in particular.
const FRESH: [f64; 4] = [0.5; 4];

/// Starts within rounding, and motions rounded at every step, that are tried.
const STARTS: usize = 64;
const RUNS: u64 = 16;

/// And where nothing else gives the record's answer: one or two of a hundred may do as a lane did.
const MOST_RUNS: u64 = 1000;

/// The record says chaotic where the reference, averaged in its own way, decides nothing, or the other way round.
///
/// The reference's own motion, averaged as a lane would, gives the record's answer: neither had
/// the periods to tell what is chaos in the end. Or one that starts within rounding does, or one
/// that is rounded at every step: then what it met on the way was decided by rounding.
pub(super) fn weak_chaos(case: &Case<'_>) -> Option<Explanation> {
    let classes = (classify(case.record), case.truth.class);
    let is_left_open = case.is_lane && classes == (Class::Undecided, Class::Chaotic);
    let left_open = || if is_left_open { AsLane::new(case) } else { None };
    let lane = AsLane::of_weak_chaos(case).or_else(left_open)?;
    let same = |answer: Option<Answer>| answer.is_some_and(|answer| is_the_records(case, &answer));
    if same(lane.answer(case.start)) {
        return Some(Explanation::UndecidedInBudget);
    }
    let nudged = (0..8).map(|k| case.nudged_start(k)).chain(case.scattered_starts(STARTS));
    if nudged.map(|start| lane.answer(start)).any(same) {
        return Some(Explanation::Chaos);
    }
    (0..RUNS).map(|run| lane.rounded(run)).any(same).then_some(Explanation::BelowResolution)
}

/// The same of many more motions that are rounded at every step.
pub(super) fn rare_chaos(case: &Case<'_>) -> Option<Explanation> {
    let lane = AsLane::of_weak_chaos(case)?;
    let same = |answer: Option<Answer>| answer.is_some_and(|answer| is_the_records(case, &answer));
    (RUNS..MOST_RUNS).map(|run| lane.rounded(run)).any(same).then_some(Explanation::BelowResolution)
}

/// Whether an average of few blocks is the record's, its standard error too.
fn is_the_records(case: &Case<'_>, answer: &Answer) -> bool {
    let Some([theirs, error]) = answer.exponent else { return false };
    let (ours, own) = (case.record.lyapunov, case.record.lyapunov_error);
    let is_near = (ours - theirs).abs() <= CHAOS_ERRORS * error.hypot(own);
    let is_as_sure = own <= UNSURE * error && error <= UNSURE * own;
    is_near && is_as_sure && case.is_the_records(answer)
}

/// A motion with one tangent vector that is looked at period by period.
trait Watched {
    fn advance(&mut self) -> Result<(), Stop>;
    /// The tangent vector, and the logarithm of the factor that was taken out of it.
    fn tangent(&self) -> (State, f64);
    fn set_tangent(&mut self, u: State);
    /// Impacts, meshing time and events so far.
    fn counts(&self) -> [f64; 3];
}

impl Watched for Trajectory<'_, 1> {
    fn advance(&mut self) -> Result<(), Stop> {
        self.advance_period(&mut ())
    }

    fn tangent(&self) -> (State, f64) {
        (self.tangents()[0], self.log_scale())
    }

    fn set_tangent(&mut self, u: State) {
        self.set_tangents([u]);
    }

    fn counts(&self) -> [f64; 3] {
        let [impacts, meshing_time] = counts(self);
        [impacts, meshing_time, self.work().events as f64]
    }
}

impl Watched for Rounded<'_, 1> {
    fn advance(&mut self) -> Result<(), Stop> {
        self.advance_period(&mut ())
    }

    fn tangent(&self) -> (State, f64) {
        let ([u], log_scale) = self.tangents();
        (u, log_scale)
    }

    fn set_tangent(&mut self, u: State) {
        self.set_tangents([u]);
    }

    fn counts(&self) -> [f64; 3] {
        let [impacts, meshing_time] = counts(self.trajectory());
        [impacts, meshing_time, self.trajectory().work().events as f64]
    }
}

/// What is the same for all motions of a cell.
pub(super) struct AsLane<'c, 'a> {
    case: &'c Case<'a>,
    model: LaneModel,
    averaging: Averaging,
}

impl<'c, 'a> AsLane<'c, 'a> {
    pub(super) fn new(case: &'c Case<'a>) -> Option<Self> {
        let model = LaneModel::new(case)?;
        let averaging = Averaging::new(case.budget.periods(), case.budget.exponent_from());
        Some(AsLane { case, model, averaging })
    }

    /// That of a record which is chaotic where the reference decides nothing.
    fn of_weak_chaos(case: &'c Case<'a>) -> Option<Self> {
        let classes = (classify(case.record), case.truth.class);
        if case.is_lane && classes == (Class::Chaotic, Class::Undecided) { AsLane::new(case) } else { None }
    }

    /// The reference from `start`.
    pub(super) fn answer(&self, start: State) -> Option<Answer> {
        self.answer_of(&self.case.flow, self.case.law, start)
    }

    /// That of a cell that is the same within rounding.
    pub(super) fn answer_of(&self, flow: &Flow, law: Law, start: State) -> Option<Answer> {
        let mut bare = Trajectory::<0>::new(flow, law, start);
        (0..self.averaging.growth_from).try_for_each(|_| bare.advance_period(&mut ())).ok()?;
        self.average(&mut bare.carrying([self.model.constants.to_state(FRESH)]))
    }

    /// The same, rounded at every step of a lane as `seed` decides.
    fn rounded(&self, seed: u64) -> Option<Answer> {
        let start = Trajectory::new(&self.model.flow, self.model.law, self.model.start(self.case.start));
        let fresh = start.carrying([self.model.constants.to_state(FRESH)]);
        let mut rounded = Rounded::new(&fresh, &self.model, seed);
        for _ in 0..self.averaging.growth_from {
            rounded.advance_period(&mut ()).ok()?;
        }
        self.average(&mut rounded)
    }

    /// The logarithm of the tangent vector's growth in the next period; it is given unit length.
    fn growth(&self, motion: &mut impl Watched) -> Result<f64, Stop> {
        motion.advance()?;
        let (u, log_scale) = motion.tangent();
        let u = self.model.constants.to_lane(u);
        let length = u.iter().map(|x| x * x).sum::<f64>().sqrt();
        let next = if length > 0.0 { u.map(|x| x / length) } else { FRESH };
        motion.set_tangent(self.model.constants.to_state(next));
        Ok(length.max(f64::MIN_POSITIVE).ln() + log_scale)
    }

    /// Class, exponent and averages as a lane has them after the record's periods.
    fn average(&self, motion: &mut impl Watched) -> Option<Answer> {
        let Averaging { growth_from, exponent_from, .. } = self.averaging;
        let mut growth = Vec::new();
        let mut met = Vec::new();
        for period in growth_from + 1..=self.case.record.periods_run {
            if period > exponent_from {
                met.push(motion.counts());
            }
            let of_period = self.growth(motion).ok()?;
            if period > exponent_from {
                growth.push(of_period);
            }
        }
        let [mean, error] = self.averaging.estimate(&growth)?;
        met.push(motion.counts());
        let [impacts, meshing, events] =
            [0, 1, 2].map(|i| (met[growth.len()][i] - met[0][i]) / growth.len() as f64);
        let counts: Vec<[f64; 2]> = met.iter().map(|&[impacts, meshing, _]| [impacts, meshing]).collect();
        let (surely, rounding) = (mean - CHAOS_ERRORS * error, unit_roundoff(self.case.precision));
        let grows = surely > 0.0 && self.averaging.outgrows(surely, growth.len(), events, rounding);
        let (period, exponent_periods) = (self.case.flow.period, growth.len() as u32);
        Some(Answer {
            class: if grows { Class::Chaotic } else { Class::Undecided },
            exponent: Some([mean / period, error / period]),
            impacts_per_period: Some(impacts),
            mesh_fraction: Some(meshing / period),
            scatter: Some(Scatter::of(&counts, exponent_periods, period)),
            ..self.case.truth.clone()
        })
    }
}
