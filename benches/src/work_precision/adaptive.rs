//! DOP853 of the crate `ode_solvers` with event location. The same code judges maps of the reference
//! ([`rattlemap::validate::independent`]).
//!
//! The crate has no event location. Therefore each accepted step is searched for an event, a step with an event stops the
//! integration, and the event is located by integrating again from the start of that step.

use std::cell::Cell;

use super::PERIODS;
use super::cells::{Latest, Subject};
use super::field::Equations;
use super::flight::{Flight, Sighting};
use super::outcome::Outcome;
use rattlemap::validate::independent::dop853::Integration;
use rattlemap_dynamics::pair::Gap;

/// Largest number of endings in one period.
const ENDINGS: u32 = 10_000;

/// Integrates a subject with this relative and absolute tolerance.
pub fn integrate(subject: &Subject, tolerance: f64) -> Outcome {
    let solver = Solver { omega: subject.oscillator.omega, tolerance };
    let mut flight = Flight::new(&subject.pair, &subject.start);
    for _ in 0..PERIODS {
        if solver.advance(&mut flight, subject.oscillator.period()).is_none() {
            return Outcome::lost();
        }
    }
    Outcome { state: flight.state(), events: Latest::of(&flight).0 }
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
struct Solver {
    omega: f64,
    tolerance: f64,
}

fn gap(y: &[f64; 5]) -> Gap {
    [y[0], y[1], y[2], y[3]]
}

impl Solver {
    /// Integrates from phase 0 over a time; none if the integration fails.
    fn advance(&self, flight: &mut Flight, until: f64) -> Option<()> {
        let mut t = 0.0;
        for _ in 0..ENDINGS {
            let (found, field, start) = (Cell::new(None), flight.field(), flight.q);
            let mut last = (0.0, start);
            let watch = |x: f64, y: &[f64; 5]| {
                let y = gap(y);
                let (begun, q) = std::mem::replace(&mut last, (x, y));
                let after = |tau| self.after(field, q, t + begun, tau).unwrap_or(q);
                let sighting = flight.find_ending(begun == 0.0, &q, t + begun, x - begun, &y, after);
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
        watch: impl FnMut(f64, &[f64; 5]) -> bool,
    ) -> Option<Gap> {
        let integration = Integration { tolerance: self.tolerance, longest, samples: None };
        let rates = |y: &[f64; 5]| {
            let [a, b] = field.accelerations(&gap(y), (self.omega * y[4]).cos());
            [y[1], a, y[3], b, 1.0]
        };
        let start = [y[0], y[1], y[2], y[3], t];
        integration.run(start, duration, rates, watch)?.last().map(|(_, y)| gap(y))
    }
}
