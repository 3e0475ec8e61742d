//! The classical Runge-Kutta method of order 4 with fixed steps, in f64 on one core.

use super::PERIODS;
use super::cells::{Latest, Subject};
use super::field::Equations;
use super::flight::Flight;
use super::outcome::Outcome;
use rattlemap_dynamics::pair::Gap;

/// Number of events in one period above which a lane fails.
const ENDINGS_PER_PERIOD: u32 = 10_000;

/// Returns the state a step of length `h` after `y`, from the cosines of the phase at its start, middle and end.
#[inline(always)]
fn runge_kutta(field: &Equations, y: &Gap, h: f64, cos: [f64; 3]) -> Gap {
    let slope = |y: &Gap, cos: f64| {
        let [a, b] = field.accelerations(y, cos);
        [y[1], a, y[3], b]
    };
    let moved = |by: f64, k: &Gap| -> Gap { std::array::from_fn(|i| y[i] + by * k[i]) };
    let k1 = slope(y, cos[0]);
    let k2 = slope(&moved(0.5 * h, &k1), cos[1]);
    let k3 = slope(&moved(0.5 * h, &k2), cos[1]);
    let k4 = slope(&moved(h, &k3), cos[2]);
    std::array::from_fn(|i| y[i] + h / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i])))
}

/// Integrates a subject with `steps` >= 1 steps per forcing period.
pub fn integrate(subject: &Subject, steps: u32) -> Outcome {
    let grid = Grid::new(subject.oscillator.omega, steps);
    let mut flight = Flight::new(&subject.pair, &subject.start);
    for _ in 0..PERIODS {
        if grid.period(&mut flight).is_none() {
            return Outcome::lost();
        }
    }
    Outcome { state: flight.state(), events: Latest::of(&flight).0 }
}

/// The steps of a period.
struct Grid {
    omega: f64,
    h: f64,
    /// Cosine of the phase at every half step.
    cosines: Vec<f64>,
}

impl Grid {
    fn new(omega: f64, steps: u32) -> Grid {
        let turn = |i: u32| (std::f64::consts::TAU * f64::from(i) / f64::from(2 * steps)).cos();
        let h = std::f64::consts::TAU / omega / f64::from(steps);
        Grid { omega, h, cosines: (0..=2 * steps).map(turn).collect() }
    }

    /// Integrates one forcing period. Returns `None` if the lane fails.
    fn period(&self, flight: &mut Flight) -> Option<()> {
        let mut endings = 0;
        for (n, cosines) in self.cosines.windows(3).step_by(2).enumerate() {
            let start = self.h * n as f64;
            let mut offset = 0.0;
            // One whole step, or parts between events.
            while offset < self.h {
                let (t, rest) = (start + offset, self.h - offset);
                let (field, y) = (flight.field().clone(), flight.q);
                let after = |tau: f64| {
                    let cos = [t, t + 0.5 * tau, t + tau].map(|t| (self.omega * t).cos());
                    runge_kutta(&field, &y, tau, cos)
                };
                let end = if offset == 0.0 {
                    runge_kutta(&field, &y, rest, [cosines[0], cosines[1], cosines[2]])
                } else {
                    after(rest)
                };
                let Some(sighting) = flight.find_ending(true, &y, t, rest, &end, after) else {
                    flight.q = end;
                    flight.leave_wall();
                    break;
                };
                let tau = flight.locate(true, t, sighting, after)?;
                flight.q = after(tau);
                offset += tau;
                flight.act(sighting.ending, start + offset, tau == 0.0);
                endings += 1;
                if endings > ENDINGS_PER_PERIOD {
                    return None;
                }
            }
        }
        flight.q.iter().all(|x| x.is_finite()).then_some(())
    }
}
