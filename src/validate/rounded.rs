//! The reference, rounded at every step as a lane is.

use super::states::unit_roundoff;
use crate::gpu::{Constants, Precision};
use crate::model::State;
use crate::random::Random;
use crate::reference::{Stop, Trajectory};

/// A motion whose state and tangent vectors, in lane units, are moved by up to a unit roundoff,
/// evenly distributed, at each of a lane's steps.
///
/// A lane stores its numbers at least once per step, so this is the least that rounding does to them.
pub(super) struct Rounded<'f, 'c, const N: usize> {
    trajectory: Trajectory<'f, N>,
    constants: &'c Constants,
    unit: f64,
    random: Random,
    /// Logarithm of the factor that was taken out of the tangent vectors.
    log_scale: f64,
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
        Rounded { trajectory, constants, unit: unit_roundoff(precision), random, log_scale: 0.0 }
    }

    /// One forcing period.
    pub(super) fn advance_period(&mut self) -> Result<(), Stop> {
        let (period, steps) = (self.trajectory.flow().period, self.constants.steps);
        for step in 1..steps {
            self.trajectory.advance_to(period * (f64::from(step) / f64::from(steps)), &mut ())?;
            self.round();
        }
        self.trajectory.advance_period(&mut ())?;
        self.round();
        Ok(())
    }

    fn round(&mut self) {
        let (unit, random) = (self.unit, &mut self.random);
        let mut share = || unit * (2.0 * random.unit() - 1.0);
        self.trajectory.shake(std::array::from_fn(|_| share()));
        let tangents = self.trajectory.tangents();
        let rounded = tangents.map(|u| self.constants.to_lane(u).map(|x| x * (1.0 + share())));
        self.log_scale += self.trajectory.log_scale();
        self.trajectory.set_tangents(rounded.map(|u| self.constants.to_state(u)));
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
