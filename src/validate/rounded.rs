//! The reference, rounded at every step as a lane is.

use nalgebra::Matrix4;

use super::answer::Answer;
use super::case::Case;
use super::states::unit_roundoff;
use crate::gpu::{Constants, Precision};
use crate::model::{Side, State};
use crate::orbit::Class;
use crate::random::Random;
use crate::reference::{Happening, Observer, Stop, Trajectory};
use crate::stability::{UNIT, multipliers};
use crate::word::Word;

/// A motion whose state and tangent vectors, in lane units, are moved at each of a lane's steps by up
/// to a unit roundoff of what is added up there, evenly distributed:
///
/// ```text
/// |d q_i| <= u (|q_i| + sum_j |m_ij p_j|),   p = (z, w, x2, v2, cos, sin, 1),
/// ```
///
/// with the lane's own propagator `1 + m`: every product and every sum is rounded once. An event rounds as
/// a step does, and the roundings of one step add up like a random walk.
pub(super) struct Rounded<'f, 'c, const N: usize> {
    trajectory: Trajectory<'f, N>,
    constants: &'c Constants,
    unit: f64,
    random: Random,
    /// Logarithm of the factor that was taken out of the tangent vectors.
    log_scale: f64,
    /// Events until the last rounding.
    events: u64,
}

impl<'f, 'c, const N: usize> Rounded<'f, 'c, N> {
    /// Goes on from a trajectory at phase 0; `seed` decides every rounding.
    pub(super) fn new(
        trajectory: Trajectory<'f, N>,
        constants: &'c Constants,
        precision: Precision,
        seed: u64,
    ) -> Self {
        let random = Random::new((seed << 32) + u64::from(constants.steps));
        let (unit, events) = (unit_roundoff(precision), trajectory.work().events);
        Rounded { trajectory, constants, unit, random, log_scale: 0.0, events }
    }

    /// One forcing period.
    pub(super) fn advance_period(&mut self, met: &mut impl Observer) -> Result<(), Stop> {
        let period = self.trajectory.flow().period;
        let steps = f64::from(self.constants.steps);
        let mut step = 0.0;
        loop {
            // As a lane does: in steps of the domain that governs the motion.
            step += self.constants.flow.domains[self.domain()].share;
            if step >= steps {
                break;
            }
            self.trajectory.advance_to(period * (step / steps), met)?;
            self.round(step / steps);
        }
        self.trajectory.advance_period(met)?;
        self.round(0.0);
        Ok(())
    }

    fn domain(&self) -> usize {
        match self.trajectory.meshing() {
            None => 0,
            Some(Side::Right) => 1,
            Some(Side::Left) => 2,
        }
    }

    /// Rounds at a phase, in turns.
    fn round(&mut self, phase: f64) {
        let domain = &self.constants.flow.domains[self.domain()];
        let wall = [0.0, self.constants.flow.walls[0], self.constants.flow.walls[1]][self.domain()];
        let (sin, cos) = (std::f64::consts::TAU * phase).sin_cos();
        // Rates per step of the domain.
        let scales = [1.0, domain.share, 1.0, domain.share];
        let added = |q: &[f64; 4], forced: [f64; 3], i: usize| {
            let row = &domain.step[7 * i..7 * i + 7];
            let of_state: f64 = (0..4).map(|j| (row[j] * scales[j] * q[j]).abs()).sum();
            let of_force: f64 = (0..3).map(|j| (row[4 + j] * forced[j]).abs()).sum();
            q[i].abs() + (of_state + of_force) / scales[i]
        };
        let events = self.trajectory.work().events;
        let unit = self.unit * (1.0 + (events - self.events) as f64).sqrt();
        self.events = events;
        let random = &mut self.random;
        let mut even = || unit * (2.0 * random.unit() - 1.0);
        let mut q = self.constants.to_lane(self.trajectory.state());
        q[0] -= wall;
        let shares = std::array::from_fn(|i| {
            let by = even() * added(&q, [cos, sin, 1.0], i);
            if q[i] == 0.0 { 0.0 } else { by / q[i] }
        });
        self.trajectory.shake(shares);
        let tangents = self.trajectory.tangents().map(|u| self.constants.to_lane(u));
        self.log_scale += self.trajectory.log_scale();
        self.trajectory.set_tangents(tangents.map(|u| {
            self.constants.to_state(std::array::from_fn(|i| u[i] + even() * added(&u, [0.0; 3], i)))
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
    pub(super) fn trajectory(&self) -> &Trajectory<'f, N> {
        &self.trajectory
    }
}

/// Impacts and meshing time of a motion so far.
pub(super) fn counts<const N: usize>(trajectory: &Trajectory<'_, N>) -> [f64; 2] {
    [trajectory.work().impacts as f64, trajectory.meshing_time()]
}

/// A cycle of `period` as a lane would read it from where a motion stands.
pub(super) fn read_cycle(
    case: &Case<'_>,
    constants: &Constants,
    stands: &Trajectory<'_>,
    period: u32,
    seed: u64,
) -> Option<Answer> {
    let span = f64::from(period) * case.flow.period;
    let mut rounded = Rounded::new(stands.carrying(UNIT), constants, case.precision, seed);
    let before = counts(rounded.trajectory());
    let mut met: Vec<Happening> = Vec::new();
    (0..period).try_for_each(|_| rounded.advance_period(&mut met)).ok()?;
    let (tangents, log_scale) = rounded.tangents();
    let [re, im] = *multipliers(&Matrix4::from_fn(|i, j| tangents[j][i]))?.first()?;
    let after = counts(rounded.trajectory());
    let symbols: Vec<u8> = met.iter().filter_map(|happening| happening.symbol).collect();
    let impacts = after[0] - before[0];
    Some(Answer {
        class: Class::Periodic { period },
        exponent: Some([(re.hypot(im).ln() + log_scale) / span, 0.0]),
        impacts_per_period: Some(impacts / f64::from(period)),
        mesh_fraction: Some((after[1] - before[1]) / span),
        // Every impact has a twin on a cycle that is its own mirror image.
        symmetric: if impacts % 2.0 == 1.0 { Some(false) } else { case.truth.symmetric },
        word: Some(Word::cyclic(&symbols)),
        ..case.truth.clone()
    })
}
