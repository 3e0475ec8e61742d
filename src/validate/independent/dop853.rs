//! The integrator DOP853 of the crate `ode_solvers`, with events.
//!
//! The crate has no event location. Therefore each accepted step is searched for an event, a step with an event stops the
//! integration, and the event is located by integrating again from the start of that step.

use std::cell::Cell;

use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, SVector, System};

use super::field::Equations;
use super::flight::{Flight, Sighting};
use rattlemap_dynamics::pair::Gap;

/// Largest number of endings in one interval.
const ENDINGS: u32 = 10_000;

/// Shortest duration for the crate, whose first trial step underflows in a shorter one. For such durations one Euler step
/// is exact.
const SHORTEST: f64 = 1e-12;

/// Largest number of steps of one integration.
const MOST_STEPS: u32 = 100_000;

/// Equations of motion of a state whose last entry is the time: the crate evaluates stage 12 at the wrong time (its table has 0 for
/// `c_12 = 1`), which does not affect an autonomous system.
struct Motion<F, W> {
    /// Writes the derivative of a state.
    field: F,
    /// Receives each step and returns whether to stop there.
    watch: W,
}

impl<const N: usize, F, W> System<f64, SVector<f64, N>> for Motion<F, W>
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

fn gap(y: &[f64; 5]) -> Gap {
    [y[0], y[1], y[2], y[3]]
}

/// Integrates from `start`, whose last entry is the time. `watch` may stop the integration after any step. Returns times since the start
/// and states; none if the crate fails.
pub(super) fn integrate<const N: usize>(
    start: [f64; N],
    duration: f64,
    Integration { tolerance, longest, samples }: Integration,
    field: impl Fn(&[f64; N]) -> [f64; N],
    watch: impl FnMut(f64, &[f64; N]) -> bool,
) -> Option<Vec<(f64, [f64; N])>> {
    let mut solver = Dop853::from_param(
        Motion { field, watch },
        0.0,
        duration,
        samples.unwrap_or(duration),
        SVector::from(start),
        tolerance,
        tolerance,
        0.9,
        0.0,
        0.333,
        6.0,
        duration.min(longest),
        0.0,
        MOST_STEPS,
        // The crate's stiffness test reacts to rounding, so it is disabled.
        u32::MAX,
        if samples.is_some() { OutputType::Dense } else { OutputType::Sparse },
    );
    solver.integrate().ok()?;
    Some(solver.x_out().iter().copied().zip(solver.y_out().iter().map(|y| y.data.0[0])).collect())
}

/// Settings of an integration.
#[derive(Clone, Copy, Debug)]
pub struct Integration {
    /// Relative and absolute tolerance.
    pub tolerance: f64,
    /// Longest step.
    pub longest: f64,
    /// Time between the returned samples; none returns the ends of steps.
    pub samples: Option<f64>,
}

impl Integration {
    /// Integrates from `start` at time `t`. `watch` may stop the integration after any step. Returns times since `t` and
    /// states; none if the crate fails.
    pub fn run(
        &self,
        start: &Gap,
        t: f64,
        duration: f64,
        accelerations: impl Fn(f64, &Gap) -> [f64; 2],
        mut watch: impl FnMut(f64, &Gap) -> bool,
    ) -> Option<Vec<(f64, Gap)>> {
        if duration < SHORTEST {
            let [a, b] = accelerations(t, start);
            let y = start;
            let end =
                [y[0] + duration * y[1], y[1] + duration * a, y[2] + duration * y[3], y[3] + duration * b];
            return Some(vec![(0.0, *start), (duration, end)]);
        }
        let start = [start[0], start[1], start[2], start[3], t];
        let field = |y: &[f64; 5]| {
            let [a, b] = accelerations(y[4], &gap(y));
            [y[1], a, y[3], b, 1.0]
        };
        let solution = integrate(start, duration, *self, field, |x, y| watch(x, &gap(y)))?;
        Some(solution.iter().map(|(x, y)| (*x, gap(y))).collect())
    }
}

/// A step that contains an ending.
#[derive(Clone, Copy)]
struct StepWithEnding {
    /// Time since the start of the flight.
    start: f64,
    y: Gap,
    sighting: Sighting,
}

/// Integrator of motions between walls.
#[derive(Clone, Copy, Debug)]
pub struct Solver {
    /// Excitation frequency.
    pub omega: f64,
    /// Relative and absolute tolerance.
    pub tolerance: f64,
}

impl Solver {
    /// Integrates from one time since phase 0 to another; none if the integration fails. A change of the stage at `until`
    /// is made, one at `from` is not.
    pub fn advance(&self, flight: &mut Flight, from: f64, until: f64) -> Option<()> {
        let mut t = from;
        while let Some((change, stage)) = flight.next_change(t).filter(|(change, _)| *change <= until) {
            self.advance_in_stage(flight, t, change)?;
            flight.change_stage(stage, change);
            t = change;
        }
        if t == until && t > from { Some(()) } else { self.advance_in_stage(flight, t, until) }
    }

    /// Integrates within a stage.
    fn advance_in_stage(&self, flight: &mut Flight, from: f64, until: f64) -> Option<()> {
        let mut t = from;
        for _ in 0..ENDINGS {
            let (found, field, start) = (Cell::new(None), flight.field(), flight.q);
            let mut last = (0.0, start);
            let watch = |x: f64, y: &Gap| {
                let (begun, q) = std::mem::replace(&mut last, (x, *y));
                let after = |tau| self.after(field, q, t + begun, tau).unwrap_or(q);
                let sighting = flight.find_ending(begun == 0.0, &q, t + begun, x - begun, y, after);
                found.set(sighting.map(|sighting| StepWithEnding { start: begun, y: q, sighting }));
                sighting.is_some()
            };
            let end = self.run(field, start, t, until - t, flight.longest_step(), watch)?;
            let Some(StepWithEnding { start, y, sighting }) = found.get() else {
                flight.q = end;
                flight.leave_wall();
                return end.iter().all(|x| x.is_finite()).then_some(());
            };
            let after = |tau| self.after(field, y, t + start, tau).unwrap_or([f64::NAN; 4]);
            let tau = flight.locate(start == 0.0, t + start, sighting, after)?;
            flight.q = after(tau);
            t += start + tau;
            flight.act(sighting.ending, t, start + tau == 0.0);
        }
        None
    }

    /// Returns the state after a time `tau`, ignoring walls.
    fn after(&self, field: &Equations, y: Gap, t: f64, tau: f64) -> Option<Gap> {
        self.run(field, y, t, tau, tau, |_, _| false)
    }

    fn run(
        &self,
        field: &Equations,
        y: Gap,
        t: f64,
        duration: f64,
        longest: f64,
        watch: impl FnMut(f64, &Gap) -> bool,
    ) -> Option<Gap> {
        let integration = Integration { tolerance: self.tolerance, longest, samples: None };
        let field = |t: f64, y: &Gap| {
            let (sin, cos) = (self.omega * t).sin_cos();
            field.accelerations(y, [cos, sin])
        };
        Some(integration.run(&y, t, duration, field, watch)?.last()?.1)
    }
}
