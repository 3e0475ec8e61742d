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

/// A step of less than this is part of one: it ends or begins at an event.
const WHOLE: f64 = 1.0 - 1e-9;

/// A motion whose state and tangent vectors, in lane units, are moved at each of a lane's steps and at
/// every event by up to a unit roundoff of what was added up on the way there, evenly distributed:
///
/// ```text
/// |d q_i| <= u (|q_i| + sum_j |m_ij s_ij p_j|),   p = (z, w, x2, v2, cos, sin, 1),
/// ```
///
/// with the lane's own propagator `1 + m` and `s` the share of a step that has passed, its square where
/// an acceleration moves a displacement: every product and every sum is rounded once. The propagator's own
/// numbers are rounded, too, in the same way at every step, those of accelerations on the way to an event,
/// and `cos` and `sin`, taken from a table and turned to an event, go on from there step by step:
/// `(fl(m) - m) p` and what they drift by are added besides.
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
        Rounded {
            trajectory,
            constants,
            precision,
            state: true,
            unit: unit_roundoff(precision),
            random,
            log_scale: 0.0,
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
        let mut then = 0.0;
        while then < period {
            // As a lane does: from the last event in steps of the domain that governs the motion.
            let domain = self.domain();
            let step = self.constants.flow.h * self.constants.flow.domains[domain].share;
            let until = if then + (2.0 - WHOLE) * step < period { then + step } else { period };
            self.trajectory.advance_to_event(until, met)?;
            let now = self.trajectory.time_in_period();
            self.round(domain, now, (now - then) / step);
            then = now;
        }
        self.trajectory.advance_period(met)?;
        self.phasor = [1.0, 0.0];
        Ok(())
    }

    fn domain(&self) -> usize {
        match self.trajectory.meshing() {
            None => 0,
            Some(Side::Right) => 1,
            Some(Side::Left) => 2,
        }
    }

    /// Rounds at a time since phase 0, after a share of a domain's step.
    fn round(&mut self, domain: usize, now: f64, passed: f64) {
        let flow = &self.constants.flow;
        let wall = |domain: usize| [0.0, flow.walls[0], flow.walls[1]][domain];
        let (from_wall, to_wall) = (wall(domain), wall(self.domain()));
        let domain = &flow.domains[domain];
        // Rates per step of the domain.
        let scales = [1.0, domain.share, 1.0, domain.share];
        let is_single = self.precision == Precision::F32;
        let rounded = |x: f64| if is_single { f64::from(x as f32) } else { x };
        let error = |x: f64| rounded(x) - x;
        let unit = self.unit;
        let random = &mut self.random;
        let mut even = || unit * (2.0 * random.unit() - 1.0);
        let steps = now / flow.h;
        let (sin, cos) = (steps * flow.domains[0].angle).sin_cos();
        self.phasor = if passed < WHOLE {
            // The table, and an angle addition.
            let (turn_sin, turn_cos) = (steps.fract() * flow.domains[0].angle).sin_cos();
            let sizes = |x: f64, other: f64| (2.0 - turn_cos) * x.abs() + (turn_sin * other).abs();
            [rounded(cos + even() * sizes(cos, sin)), rounded(sin + even() * sizes(sin, cos))]
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
            // Accelerations move a displacement by the square of the time.
            let share = |j: usize| if i % 2 == 1 || j == i + 1 { passed } else { passed * passed };
            let times: [f64; 7] =
                std::array::from_fn(|j| share(j) * if j < 4 { scales[j] * q[j] } else { forced[j - 4] });
            let sizes: f64 = (0..7).map(|j| (row[j] * times[j]).abs()).sum();
            let drifted = forced[2] * (share(4) * row[4] * drift[0] + share(5) * row[5] * drift[1]);
            let own = if passed < WHOLE {
                // A careful pass has its numbers from the accelerations.
                let pull = if i < 2 { &domain.gap_row } else { &domain.x_row };
                let along = [q[0], scales[1] * q[1], q[2], scales[3] * q[3], forced[0], forced[2]];
                let acceleration: f64 = pull.iter().zip(along).map(|(x, of)| error(*x) * of).sum();
                acceleration * if i % 2 == 1 { passed } else { 0.5 * passed * passed }
            } else {
                (0..7).map(|j| error(row[j]) * times[j]).sum()
            };
            let errors = drifted + own;
            (sizes / scales[i], errors / scales[i])
        };
        if self.state {
            let mut q = self.constants.to_lane(self.trajectory.state());
            let mut along = q;
            along[0] -= from_wall;
            // What it is once the next domain measures the gap.
            q[0] -= to_wall;
            self.trajectory.shake(std::array::from_fn(|i| {
                let (sizes, errors) = added(&along, [cos, sin, 1.0], i);
                let by = even() * (q[i].abs() + sizes) + errors;
                if q[i] == 0.0 { 0.0 } else { by / q[i] }
            }));
        }
        let tangents = self.trajectory.tangents().map(|u| self.constants.to_lane(u));
        self.log_scale += self.trajectory.log_scale();
        self.trajectory.set_tangents(tangents.map(|u| {
            self.constants.to_state(std::array::from_fn(|i| {
                let (sizes, errors) = added(&u, [0.0; 3], i);
                u[i] + even() * (u[i].abs() + sizes) + errors
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
