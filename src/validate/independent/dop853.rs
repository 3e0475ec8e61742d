//! DOP853 of the crate `ode_solvers`, with events.
//!
//! The crate can stop at a step, but knows no events. So every accepted step is looked at, a step with an event stops
//! the integration, and the event is located by integrating anew from the start of that step.

use std::cell::Cell;

use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, System, Vector5};

use super::field::Field;
use super::flight::{Flight, Sighting};
use rattlemap_dynamics::flow::Gap;

/// Endings in one stretch beyond which a motion is given up.
const ENDINGS: u32 = 10_000;

/// Durations in which the crate's first trial step underflows; one Euler step is exact there.
const SHORTEST: f64 = 1e-12;

const MOST_STEPS: u32 = 100_000;

/// Accelerations of two degrees of freedom, by time and state `(x1, v1, x2, v2)` in any coordinates. The fifth state is
/// time: this DOP853 takes stage 12 at the wrong one (its table has 0 for `c_12 = 1`), which an autonomous system
/// does not feel.
struct Motion<A, W> {
    accelerations: A,
    /// Told of every step; whether to stop there.
    watch: W,
}

impl<A, W> System<f64, Vector5<f64>> for Motion<A, W>
where
    A: Fn(f64, &Gap) -> [f64; 2],
    W: FnMut(f64, &Gap) -> bool,
{
    fn system(&self, _: f64, y: &Vector5<f64>, dy: &mut Vector5<f64>) {
        let [a, b] = (self.accelerations)(y[4], &state(y));
        *dy = Vector5::new(y[1], a, y[3], b, 1.0);
    }

    fn solout(&mut self, x: f64, y: &Vector5<f64>, _: &Vector5<f64>) -> bool {
        (self.watch)(x, &state(y))
    }
}

fn state(y: &Vector5<f64>) -> Gap {
    [y[0], y[1], y[2], y[3]]
}

/// How the equations are integrated.
#[derive(Clone, Copy, Debug)]
pub struct Integration {
    /// Relative and absolute tolerance.
    pub tolerance: f64,
    /// The longest step.
    pub longest: f64,
    /// Where the solution is told: at such distances, or after every step.
    pub samples: Option<f64>,
}

impl Integration {
    /// The solution from `start` at time `t`, which `watch` may stop after any step: times since `t`, and states. None
    /// where the library gives up.
    pub fn run(
        &self,
        start: &Gap,
        t: f64,
        duration: f64,
        accelerations: impl Fn(f64, &Gap) -> [f64; 2],
        watch: impl FnMut(f64, &Gap) -> bool,
    ) -> Option<Vec<(f64, Gap)>> {
        if duration < SHORTEST {
            let [a, b] = accelerations(t, start);
            let y = start;
            let end =
                [y[0] + duration * y[1], y[1] + duration * a, y[2] + duration * y[3], y[3] + duration * b];
            return Some(vec![(0.0, *start), (duration, end)]);
        }
        let mut solver = Dop853::from_param(
            Motion { accelerations, watch },
            0.0,
            duration,
            self.samples.unwrap_or(duration),
            Vector5::new(start[0], start[1], start[2], start[3], t),
            self.tolerance,
            self.tolerance,
            0.9,
            0.0,
            0.333,
            6.0,
            duration.min(self.longest),
            0.0,
            MOST_STEPS,
            // Its test for stiffness takes rounding for it.
            u32::MAX,
            if self.samples.is_some() { OutputType::Dense } else { OutputType::Sparse },
        );
        solver.integrate().ok()?;
        Some(solver.x_out().iter().copied().zip(solver.y_out().iter().map(state)).collect())
    }
}

/// A step that holds an ending.
#[derive(Clone, Copy)]
struct Seen {
    /// Since the start of the flight.
    start: f64,
    y: Gap,
    sighting: Sighting,
}

/// Motions between walls.
#[derive(Clone, Copy, Debug)]
pub struct Solver {
    /// Excitation frequency.
    pub omega: f64,
    /// Relative and absolute tolerance.
    pub tolerance: f64,
}

impl Solver {
    /// From one time since phase 0 to another; none for a motion that is lost.
    pub fn advance(&self, flight: &mut Flight, from: f64, until: f64) -> Option<()> {
        let mut t = from;
        for _ in 0..ENDINGS {
            let (seen, field, start) = (Cell::new(None), *flight.field(), flight.q);
            let mut last = (0.0, start);
            let watch = |x: f64, y: &Gap| {
                let (begun, q) = std::mem::replace(&mut last, (x, *y));
                let after = |tau| self.after(&field, q, t + begun, tau).unwrap_or(q);
                let sighting = flight.find_ending(begun == 0.0, &q, t + begun, x - begun, y, after);
                seen.set(sighting.map(|sighting| Seen { start: begun, y: q, sighting }));
                sighting.is_some()
            };
            let end = self.run(&field, start, t, until - t, flight.longest_step(), watch)?;
            let Some(Seen { start, y, sighting }) = seen.get() else {
                flight.q = end;
                flight.leave_wall();
                return end.iter().all(|x| x.is_finite()).then_some(());
            };
            let after = |tau| self.after(&field, y, t + start, tau).unwrap_or([f64::NAN; 4]);
            let tau = flight.locate(start == 0.0, t + start, sighting, after)?;
            flight.q = after(tau);
            t += start + tau;
            flight.act(sighting.ending, t, start + tau == 0.0);
        }
        None
    }

    /// The state a time `tau` later, whatever walls are in the way.
    fn after(&self, field: &Field, y: Gap, t: f64, tau: f64) -> Option<Gap> {
        self.run(field, y, t, tau, tau, |_, _| false)
    }

    fn run(
        &self,
        field: &Field,
        y: Gap,
        t: f64,
        duration: f64,
        longest: f64,
        watch: impl FnMut(f64, &Gap) -> bool,
    ) -> Option<Gap> {
        let integration = Integration { tolerance: self.tolerance, longest, samples: None };
        let field = |t: f64, y: &Gap| field.accelerations(y, (self.omega * t).cos());
        Some(integration.run(&y, t, duration, field, watch)?.last()?.1)
    }
}
