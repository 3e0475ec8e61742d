//! DOP853 of the crate `ode_solvers` with event location: the adaptive library that also
//! checks the reference in the tests.
//!
//! The crate can stop at a step, but knows no events. So every accepted step is looked at, a
//! step with an event stops the integration, and the event is located by integrating anew from
//! the start of that step.

use std::cell::Cell;

use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, System, Vector5};

use super::PERIODS;
use super::cells::Subject;
use super::flight::{Field, Flight, Sighting};
use super::outcome::Outcome;
use crate::flow::Gap;

/// Endings in one period beyond which a lane is given up.
const ENDINGS_PER_PERIOD: u32 = 10_000;

/// Durations in which the crate's first trial step underflows; one Euler step is exact there.
const SHORTEST: f64 = 1e-12;

/// Integrates a subject at a relative and absolute tolerance.
pub fn integrate(subject: &Subject, tolerance: f64) -> Outcome {
    let oscillator = &subject.oscillator;
    let solver = Solver { omega: oscillator.omega, period: oscillator.period(), tolerance };
    let mut flight = Flight::new(&subject.oscillator, subject.law, subject.start);
    for _ in 0..PERIODS {
        if solver.period(&mut flight).is_none() {
            return Outcome::lost();
        }
    }
    Outcome { state: flight.state(), events: flight.latest.0 }
}

struct Solver {
    omega: f64,
    period: f64,
    tolerance: f64,
}

/// A step of the crate that holds an ending.
#[derive(Clone, Copy)]
struct Seen {
    /// Since the start of the flight.
    start: f64,
    y: Gap,
    sighting: Sighting,
}

/// The equations from a time since phase 0 on. The fifth state is time: this DOP853 takes
/// stage 12 at the wrong one, which an autonomous system does not feel.
struct Motion<'a> {
    field: &'a Field,
    omega: f64,
    /// Who looks for endings; none while one is being located.
    watch: Option<Watch<'a>>,
}

struct Watch<'a> {
    solver: &'a Solver,
    flight: &'a Flight,
    /// Time since phase 0 at the start of the flight.
    t: f64,
    last: (f64, Gap),
    seen: &'a Cell<Option<Seen>>,
}

impl System<f64, Vector5<f64>> for Motion<'_> {
    fn system(&self, _: f64, y: &Vector5<f64>, dy: &mut Vector5<f64>) {
        let [a, b] = self.field.accelerations(&state(y), (self.omega * y[4]).cos());
        *dy = Vector5::new(y[1], a, y[3], b, 1.0);
    }

    fn solout(&mut self, x: f64, y: &Vector5<f64>, _: &Vector5<f64>) -> bool {
        let Some(watch) = &mut self.watch else { return false };
        let (start, from) = std::mem::replace(&mut watch.last, (x, state(y)));
        let t = watch.t + start;
        let after = |tau| watch.solver.after(self.field, from, t, tau).unwrap_or(from);
        let sighting = watch.flight.look(start == 0.0, &from, t, x - start, &state(y), after);
        watch.seen.set(sighting.map(|sighting| Seen { start, y: from, sighting }));
        sighting.is_some()
    }
}

fn state(y: &Vector5<f64>) -> Gap {
    [y[0], y[1], y[2], y[3]]
}

impl Solver {
    /// One forcing period; none for a lane that is lost.
    fn period(&self, flight: &mut Flight) -> Option<()> {
        let mut t = 0.0;
        for _ in 0..ENDINGS_PER_PERIOD {
            let seen = Cell::new(None);
            let field = *flight.field();
            let watch = Watch { solver: self, flight, t, last: (0.0, flight.q), seen: &seen };
            let end = self.run(&field, flight.q, t, self.period - t, Some(watch))?;
            let Some(Seen { start, y, sighting }) = seen.get() else {
                flight.q = end;
                flight.depart();
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
        self.run(field, y, t, tau, None)
    }

    fn run(&self, field: &Field, y: Gap, t: f64, duration: f64, watch: Option<Watch<'_>>) -> Option<Gap> {
        if duration < SHORTEST {
            let [a, b] = field.accelerations(&y, (self.omega * t).cos());
            return Some([
                y[0] + duration * y[1],
                y[1] + duration * a,
                y[2] + duration * y[3],
                y[3] + duration * b,
            ]);
        }
        let longest = watch.as_ref().map_or(duration, |watch| duration.min(watch.flight.longest_step()));
        let motion = Motion { field, omega: self.omega, watch };
        let start = Vector5::new(y[0], y[1], y[2], y[3], t);
        let mut solver = Dop853::from_param(
            motion,
            0.0,
            duration,
            duration,
            start,
            self.tolerance,
            self.tolerance,
            0.9,
            0.0,
            0.333,
            6.0,
            longest,
            0.0,
            100_000,
            // Its test for stiffness takes rounding for it.
            u32::MAX,
            OutputType::Sparse,
        );
        solver.integrate().ok()?;
        solver.y_out().last().map(state)
    }
}
