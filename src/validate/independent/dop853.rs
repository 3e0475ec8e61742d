//! The integrator DOP853 of the crate `ode_solvers`. The crate has no event location, so the caller may watch each accepted step, stop
//! there, and integrate again from the start of that step.

use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, SVector, System};

/// Shortest duration that the crate integrates; in shorter ones its first trial step underflows. For shorter durations one Euler step is
/// exact within rounding.
const SHORTEST: f64 = 1e-12;

/// Largest number of steps of one integration.
const MOST_STEPS: u32 = 100_000;

/// Equations of motion of a state whose last entry is the time: the crate evaluates stage 12 at the wrong time (its table has 0 for `c_12 =
/// 1`), which has no effect on an autonomous system.
struct WatchedField<F, W> {
    /// Writes the derivative of a state.
    field: F,
    /// Receives each step and returns whether to stop there.
    watch: W,
}

impl<const N: usize, F, W> System<f64, SVector<f64, N>> for WatchedField<F, W>
where
    F: Fn(&[f64; N]) -> [f64; N],
    W: FnMut(f64, &[f64; N]) -> bool,
{
    fn system(&self, _: f64, y: &SVector<f64, N>, dy: &mut SVector<f64, N>) {
        dy.data.0[0] = (self.field)(&y.data.0[0]);
    }

    fn solout(&mut self, x: f64, y: &SVector<f64, N>, _: &SVector<f64, N>) -> bool {
        (self.watch)(x, &y.data.0[0])
    }
}

/// Settings of an integration.
#[derive(Clone, Copy, Debug)]
pub struct Integration {
    /// Relative and absolute tolerance.
    pub tolerance: f64,
    /// Longest step.
    pub longest: f64,
    /// Time between the returned samples. If none, the ends of steps are returned.
    pub samples: Option<f64>,
}

impl Integration {
    /// Integrates `y' = field(y)` from `start`, whose last entry is the time. `watch` receives the end of each step and may stop there.
    /// Returns times since the start and states; none if the crate fails.
    pub fn run<const N: usize>(
        &self,
        start: [f64; N],
        duration: f64,
        field: impl Fn(&[f64; N]) -> [f64; N],
        watch: impl FnMut(f64, &[f64; N]) -> bool,
    ) -> Option<Vec<(f64, [f64; N])>> {
        if duration < SHORTEST {
            let rate = field(&start);
            let end = std::array::from_fn(|i| start[i] + duration * rate[i]);
            return Some(vec![(0.0, start), (duration, end)]);
        }
        let mut solver = Dop853::from_param(
            WatchedField { field, watch },
            0.0,
            duration,
            self.samples.unwrap_or(duration),
            SVector::from(start),
            self.tolerance,
            self.tolerance,
            0.9,
            0.0,
            0.333,
            6.0,
            duration.min(self.longest),
            0.0,
            MOST_STEPS,
            // The crate's stiffness test reacts to rounding, so it is disabled.
            u32::MAX,
            if self.samples.is_some() { OutputType::Dense } else { OutputType::Sparse },
        );
        solver.integrate().ok()?;
        Some(solver.x_out().iter().copied().zip(solver.y_out().iter().map(|y| y.data.0[0])).collect())
    }
}
