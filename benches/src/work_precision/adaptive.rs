//! DOP853 of the crate `ode_solvers` with event location. It also judges maps of the reference
//! ([`rattlemap::validate::independent`]).

use super::PERIODS;
use super::cells::{Latest, Subject};
use super::outcome::Outcome;
use rattlemap::validate::independent::dop853::Solver;
use rattlemap::validate::independent::flight::Flight;

/// Integrates a subject with this relative and absolute tolerance.
pub fn integrate(subject: &Subject, tolerance: f64) -> Outcome {
    let oscillator = &subject.oscillator;
    let solver = Solver { omega: oscillator.omega, tolerance };
    let mut flight = Flight::new(oscillator, subject.law, subject.start);
    for _ in 0..PERIODS {
        if solver.advance(&mut flight, 0.0, oscillator.period()).is_none() {
            return Outcome::lost();
        }
    }
    Outcome { state: flight.state(), events: Latest::of(&flight).0 }
}
