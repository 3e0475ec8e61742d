//! The reference, rounded at every step as a lane is.

use super::answer::Answer;
use super::case::Case;
use super::lane_model::{LaneModel, in_precision};
use super::reading::{Met, counts, log_radius};
use super::states::unit_roundoff;
use crate::model::{Side, State};
use crate::random::Random;
use crate::record::valid;
use crate::reference::{Observer, Stop, Trajectory};
use crate::stability::UNIT;

/// A step of less than this is part of one: it ends or begins at an event.
const WHOLE: f64 = 1.0 - 1e-9;

/// A motion of the oscillator that a lane's numbers describe ([`LaneModel`]), whose state and tangent vectors,
/// in lane units, are moved at each of a lane's steps and at every event by up to a unit roundoff of what was
/// added up on the way there, evenly distributed:
///
/// ```text
/// |d q_i| <= u (|q_i| + sum_j |m_ij s_ij p_j|),   p = (z, w, x2, v2, cos, sin, 1),
/// ```
///
/// with the lane's own propagator `1 + m` and `s` the share of a step that has passed, its square where
/// an acceleration moves a displacement: every product and every sum is rounded once. What the rounded `m` of
/// whole steps is more than the flow's own moves the motion besides, in the same way at every step, and so do
/// `cos` and `sin`, which are taken from a table and turned to an event, and go on from there step by step.
pub(super) struct Rounded<'m, const N: usize> {
    trajectory: Trajectory<'m, N>,
    model: &'m LaneModel,
    /// Whether the state is rounded, not the tangent vectors alone.
    state: bool,
    unit: f64,
    random: Random,
    /// Tangent vectors round in their own way, so that a motion is the same with and without them.
    of_tangents: Random,
    /// More impacts than this end the motion: nobody wants to know how it goes on.
    most_impacts: u64,
    /// Logarithm of the factor that was taken out of the tangent vectors.
    log_scale: f64,
    /// `cos` and `sin` of the forcing phase as the lane has them.
    phasor: [f64; 2],
    /// And as they are.
    exact: [f64; 2],
}

/// What a stretch of motion begins with, in lane units, the gap measured as the domain does.
struct Begun<const N: usize> {
    domain: usize,
    q: [f64; 4],
    phasor: [f64; 2],
    drift: [f64; 2],
    tangents: [[f64; 4]; N],
}

impl<'m, const N: usize> Rounded<'m, N> {
    /// Goes on from a trajectory at phase 0; `seed` decides every rounding.
    pub(super) fn new(trajectory: &Trajectory<'_, N>, model: &'m LaneModel, seed: u64) -> Self {
        let seed = (seed << 32) + u64::from(model.constants.steps);
        Rounded {
            trajectory: trajectory.onto(&model.flow, model.law),
            model,
            state: true,
            unit: unit_roundoff(model.precision),
            random: Random::new(seed),
            of_tangents: Random::new(!seed),
            most_impacts: u64::MAX,
            log_scale: 0.0,
            phasor: [1.0, 0.0],
            exact: [1.0, 0.0],
        }
    }

    /// The same, but not beyond so many impacts.
    pub(super) fn at_most(self, impacts: u64) -> Self {
        Rounded { most_impacts: impacts, ..self }
    }

    /// The same with the tangent vectors alone rounded.
    pub(super) fn of_tangents(self) -> Self {
        Rounded { state: false, ..self }
    }

    /// One forcing period.
    pub(super) fn advance_period(&mut self, met: &mut impl Observer) -> Result<(), Stop> {
        let period = self.trajectory.flow().period;
        let lane = &self.model.constants.flow;
        let mut then = 0.0;
        while then < period {
            // As a lane does: from the last event in steps of the domain that governs the motion.
            let begun = self.begin();
            let step = lane.h * lane.domains[begun.domain].share;
            let until = if then + (2.0 - WHOLE) * step < period { then + step } else { period };
            self.trajectory.advance_to_event(until, met)?;
            if self.trajectory.work().impacts > self.most_impacts {
                return Err(Stop::CapEvents);
            }
            let now = self.trajectory.time_in_period();
            self.round(&begun, now, (now - then) / step);
            then = now;
        }
        self.trajectory.advance_period(met)?;
        (self.phasor, self.exact) = ([1.0, 0.0], [1.0, 0.0]);
        Ok(())
    }

    fn domain(&self) -> usize {
        match self.trajectory.meshing() {
            None => 0,
            Some(Side::Right) => 1,
            Some(Side::Left) => 2,
        }
    }

    fn wall(&self, domain: usize) -> f64 {
        let [right, left] = self.model.flow.walls;
        [0.0, right, left][domain]
    }

    fn begin(&self) -> Begun<N> {
        let domain = self.domain();
        let constants = &self.model.constants;
        let mut q = constants.to_lane(self.trajectory.state());
        q[0] -= self.wall(domain);
        let phasor = self.exact;
        let drift = [self.phasor[0] - phasor[0], self.phasor[1] - phasor[1]];
        let tangents =
            if N > 0 { self.trajectory.tangents().map(|u| constants.to_lane(u)) } else { [[0.0; 4]; N] };
        Begun { domain, q, phasor, drift, tangents }
    }

    /// Rounds at a time since phase 0, after a share of a domain's step.
    fn round(&mut self, begun: &Begun<N>, now: f64, passed: f64) {
        let LaneModel { constants, precision, excess, .. } = self.model;
        let (from_wall, to_wall) = (self.wall(begun.domain), self.wall(self.domain()));
        let (domain, excess) = (&constants.flow.domains[begun.domain], &excess[begun.domain]);
        // Rates per step of the domain.
        let scales = [1.0, domain.share, 1.0, domain.share];
        let rounded = |x: f64| in_precision(*precision, x);
        let unit = self.unit;
        let (random, of_tangents) = (&mut self.random, &mut self.of_tangents);
        let mut even = || unit * (2.0 * random.unit() - 1.0);
        let is_whole = passed >= WHOLE;
        let (steps, free) = (now / constants.flow.h, &constants.flow.domains[0]);
        let (sin, cos) = (steps * free.angle).sin_cos();
        self.exact = [cos, sin];
        self.phasor = if is_whole {
            // Three shears, as lanes do it.
            let [half, sine] = [domain.turn_half, domain.turn_sin].map(rounded);
            let sheared = rounded(self.phasor[0] - rounded(half * self.phasor[1]));
            let turned = rounded(self.phasor[1] + rounded(sine * sheared));
            [rounded(sheared - rounded(half * turned)), turned]
        } else {
            // The table, and an angle addition.
            let (turn_sin, turn_cos) = (steps.fract() * free.angle).sin_cos();
            let sizes = |x: f64, other: f64| (2.0 - turn_cos) * x.abs() + (turn_sin * other).abs();
            [rounded(cos + even() * sizes(cos, sin)), rounded(sin + even() * sizes(sin, cos))]
        };
        let drift = if is_whole { begun.drift } else { [self.phasor[0] - cos, self.phasor[1] - sin] };
        // Accelerations move a displacement by the square of the time.
        let share = |i: usize, j: usize| if i % 2 == 1 || j == i + 1 { passed } else { passed * passed };
        // What is added up for an entry, in sizes, and what the lane's numbers add to it.
        let sizes = |q: &[f64; 4], forced: [f64; 3], i: usize| {
            let row = &domain.step[7 * i..7 * i + 7];
            let sizes =
                (0..7).map(|j| row[j] * share(i, j) * if j < 4 { scales[j] * q[j] } else { forced[j - 4] });
            sizes.map(f64::abs).sum::<f64>() / scales[i]
        };
        let beyond = |q: &[f64; 4], forced: [f64; 3], i: usize| {
            let row = &domain.step[7 * i..7 * i + 7];
            let drifted = forced[2] * (share(i, 4) * row[4] * drift[0] + share(i, 5) * row[5] * drift[1]);
            let excess = |j: usize| excess[7 * i + j] * if j < 4 { scales[j] * q[j] } else { forced[j - 4] };
            let own = if is_whole { (0..7).map(excess).sum() } else { 0.0 };
            (drifted + own) / scales[i]
        };
        if self.state {
            let mut q = constants.to_lane(self.trajectory.state());
            let mut along = q;
            along[0] -= from_wall;
            // What it is once the next domain measures the gap.
            q[0] -= to_wall;
            let [cos_then, sin_then] = begun.phasor;
            self.trajectory.shake(std::array::from_fn(|i| {
                let sizes = q[i].abs() + sizes(&along, [cos, sin, 1.0], i);
                let by = even() * sizes + beyond(&begun.q, [cos_then, sin_then, 1.0], i);
                if q[i] == 0.0 { 0.0 } else { by / q[i] }
            }));
        }
        if N == 0 {
            return;
        }
        let mut even = || unit * (2.0 * of_tangents.unit() - 1.0);
        let tangents = self.trajectory.tangents().map(|u| constants.to_lane(u));
        self.log_scale += self.trajectory.log_scale();
        self.trajectory.set_tangents(std::array::from_fn(|n| {
            let u = tangents[n];
            constants.to_state(std::array::from_fn(|i| {
                let sizes = u[i].abs() + sizes(&u, [0.0; 3], i);
                u[i] + even() * sizes + beyond(&begun.tangents[n], [0.0; 3], i)
            }))
        }));
    }

    /// Tangent vectors, but for the exponential of the logarithm that is returned with them.
    pub(super) fn tangents(&self) -> ([State; N], f64) {
        (self.trajectory.tangents(), self.log_scale)
    }

    /// Other tangent vectors from here on.
    pub(super) fn set_tangents(&mut self, tangents: [State; N]) {
        self.log_scale = 0.0;
        self.trajectory.set_tangents(tangents);
    }

    /// The trajectory as it stands.
    pub(super) fn trajectory(&self) -> &Trajectory<'m, N> {
        &self.trajectory
    }
}

/// A cycle of `period` as a lane would read it from where a motion stands, but for its exponent; none if it
/// has more impacts than the record says.
pub(super) fn read_cycle(
    case: &Case<'_>,
    model: &LaneModel,
    stands: &Trajectory<'_>,
    (period, truth): (u32, &Answer),
    seed: u64,
) -> Option<Answer> {
    let mut most = u64::MAX;
    if case.record.valid & valid::IMPACTS != 0 {
        let impacts = case.record.impacts_per_period * f64::from(period);
        most = stands.work().impacts + impacts.round() as u64;
    }
    let mut rounded = Rounded::new(stands, model, seed).at_most(most);
    let mut events = Vec::new();
    (0..period).try_for_each(|_| rounded.advance_period(&mut events)).ok()?;
    let met = Met { period, counts: [counts(stands), counts(rounded.trajectory())], events };
    Some(Answer { exponent: None, ..met.answer(case, truth, 0.0) })
}

/// And its exponent.
pub(super) fn read_exponent(
    model: &LaneModel,
    stands: &Trajectory<'_>,
    period: u32,
    seed: u64,
) -> Option<f64> {
    let mut rounded = Rounded::new(&stands.carrying(UNIT), model, seed);
    (0..period).try_for_each(|_| rounded.advance_period(&mut ())).ok()?;
    let (tangents, log_scale) = rounded.tangents();
    Some((log_radius(tangents)? + log_scale) / (f64::from(period) * model.flow.period))
}
