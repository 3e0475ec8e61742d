//! The reference, rounded at every step as a lane is.

use super::answer::Answer;
use super::case::Case;
use super::reading::{Met, log_radius};
use super::states::unit_roundoff;
use crate::gpu::{Constants, Precision};
use crate::model::{Side, State};
use crate::random::Random;
use crate::reference::{Observer, Stop, Trajectory};
use crate::stability::UNIT;

/// A motion whose state and tangent vectors, in lane units, are moved at each of a lane's steps by up
/// to a unit roundoff of what is added up there, evenly distributed:
///
/// ```text
/// |d q_i| <= u (|q_i| + sum_j |m_ij p_j|),   p = (z, w, x2, v2, cos, sin, 1),
/// ```
///
/// with the lane's own propagator `1 + m`: every product and every sum is rounded once. An event rounds as
/// a step does, and the roundings of one step add up like a random walk. The propagator's own numbers are
/// rounded, too, in the same way at every step, and `cos` and `sin` are turned from step to step since the
/// last event: `(fl(m) - m) p` and what they drift by are added besides.
pub(super) struct Rounded<'f, 'c, const N: usize> {
    trajectory: Trajectory<'f, N>,
    constants: &'c Constants,
    precision: Precision,
    /// Whether the state is rounded, not the tangent vectors alone.
    state: bool,
    unit: f64,
    random: Random,
    /// Logarithm of the factor that was taken out of the tangent vectors.
    log_scale: f64,
    /// Events until the last rounding.
    events: u64,
    /// `cos` and `sin` of the forcing phase as the lane has them.
    phasor: [f64; 2],
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
        Rounded {
            trajectory,
            constants,
            precision,
            state: true,
            unit,
            random,
            log_scale: 0.0,
            events,
            phasor: [1.0, 0.0],
        }
    }

    /// The same with the tangent vectors alone rounded.
    pub(super) fn of_tangents(self) -> Self {
        Rounded { state: false, ..self }
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
        let is_single = self.precision == Precision::F32;
        let rounded = |x: f64| if is_single { f64::from(x as f32) } else { x };
        let error = |x: f64| rounded(x) - x;
        let events = self.trajectory.work().events;
        self.phasor = if events > self.events || phase == 0.0 {
            [cos, sin].map(rounded)
        } else {
            // Three shears, as lanes do it.
            let [half, sine] = [domain.turn_half, domain.turn_sin].map(rounded);
            let sheared = rounded(self.phasor[0] - rounded(half * self.phasor[1]));
            let turned = rounded(self.phasor[1] + rounded(sine * sheared));
            [rounded(sheared - rounded(half * turned)), turned]
        };
        let drift = [self.phasor[0] - cos, self.phasor[1] - sin];
        // What is added up for an entry, in sizes, and what the propagator's own rounding adds.
        let added = |q: &[f64; 4], forced: [f64; 3], i: usize| {
            let row = &domain.step[7 * i..7 * i + 7];
            let times: [f64; 7] =
                std::array::from_fn(|j| if j < 4 { scales[j] * q[j] } else { forced[j - 4] });
            let sizes: f64 = (0..7).map(|j| (row[j] * times[j]).abs()).sum();
            let drifted = forced[2] * (row[4] * drift[0] + row[5] * drift[1]);
            let errors = drifted + (0..7).map(|j| error(row[j]) * times[j]).sum::<f64>();
            (q[i].abs() + sizes / scales[i], errors / scales[i])
        };
        let unit = self.unit * (1.0 + (events - self.events) as f64).sqrt();
        self.events = events;
        let random = &mut self.random;
        let mut even = || unit * (2.0 * random.unit() - 1.0);
        if self.state {
            let mut q = self.constants.to_lane(self.trajectory.state());
            q[0] -= wall;
            self.trajectory.shake(std::array::from_fn(|i| {
                let (sizes, errors) = added(&q, [cos, sin, 1.0], i);
                let by = even() * sizes + errors;
                if q[i] == 0.0 { 0.0 } else { by / q[i] }
            }));
        }
        let tangents = self.trajectory.tangents().map(|u| self.constants.to_lane(u));
        self.log_scale += self.trajectory.log_scale();
        self.trajectory.set_tangents(tangents.map(|u| {
            self.constants.to_state(std::array::from_fn(|i| {
                let (sizes, errors) = added(&u, [0.0; 3], i);
                u[i] + even() * sizes + errors
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
    let mut rounded = Rounded::new(stands.carrying(UNIT), constants, case.precision, seed);
    let mut events = Vec::new();
    (0..period).try_for_each(|_| rounded.advance_period(&mut events)).ok()?;
    let (tangents, log_scale) = rounded.tangents();
    let met = Met { period, counts: [counts(stands), counts(rounded.trajectory())], events };
    Some(met.answer(case, log_radius(tangents)? + log_scale))
}
