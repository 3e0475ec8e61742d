//! Whether rounding decides the period of a cycle.

use nalgebra::DMatrix;

use super::analysis::Analysis;
use super::recurrence::Metric;
use super::{Event, Settings};
use crate::flow::Flow;
use crate::model::{Law, State};
use crate::reference::{Allowance, Stop, Trajectory};
use crate::stability::{Cycle, StrobeMap, UNIT, multiply, refine};

/// Rounding error of the motion between two events, in units of the machine epsilon times the size of the motion.
const ROUNDING: f64 = 4.0;

/// Whether arithmetic with this machine epsilon cannot determine the period of the cycle of `period` forcing periods
/// through `state`. False if Newton's method finds no such cycle.
pub fn rounding_decides(
    flow: &Flow,
    law: Law,
    state: State,
    period: u32,
    epsilon: f64,
    allowance: Allowance<'_>,
) -> bool {
    let settings = Settings::default();
    let analysis = Analysis { allowance, ..Analysis::new(flow, law, &settings) };
    let seed = Trajectory::new(flow, law, state).allowing(allowance);
    let is_decided = refine(&seed, StrobeMap::Periods(period)).map(|cycle| {
        let events = analysis.read(&seed, &cycle)?.events;
        is_below_resolution(&seed, &cycle, &events, epsilon)
    });
    is_decided.is_some_and(|decided| decided.unwrap_or(false))
}

/// Whether so few events cannot amplify rounding errors of f64 enough. On a stable cycle of period 1, errors must grow to the size of
/// the motion, by 1e15, within about one turn. Grazing has a status of its own, and an event that is not near grazing amplifies
/// by at most `1 / GRAZING_SPEED`, 2.5e4. So more than three events are needed.
pub(super) fn too_few_events(period: u32, events: &[Event]) -> bool {
    period == 1 && events.len() <= 3
}

/// Whether rounding scatters the states of a cycle by more than the distance between two strobes, or by the size of the
/// motion. The period is then a result of rounding. `events` are those of the cycle.
///
/// Each part of the cycle, from between two events to between the next two, adds a rounding error in every direction, and
/// the derivative of the motion carries the sum of all earlier errors on. So an error counts with its largest growth up
/// to any later instant, even if it has decayed at the end of the cycle.
///
/// # Errors
/// A [`Stop`] if the cycle cannot be integrated.
pub(super) fn is_below_resolution(
    seed: &Trajectory<'_>,
    cycle: &Cycle,
    events: &[Event],
    epsilon: f64,
) -> Result<bool, Stop> {
    let flow = seed.flow();
    let mut trajectory = seed.at(cycle.state, UNIT);
    let (mut strobes, mut parts) = (vec![cycle.state], Vec::new());
    let mut part = |trajectory: &mut Trajectory<'_, 4>| {
        parts.push(trajectory.unit_images() * trajectory.log_scale().exp());
        trajectory.set_tangents(UNIT);
    };
    let mut times = events.windows(2).map(|pair| 0.5 * (pair[0].t + pair[1].t)).peekable();
    for n in 0..cycle.period {
        let start = f64::from(n) * flow.period;
        while let Some(time) = times.next_if(|time| *time < start + flow.period) {
            trajectory.advance_to(time - start, &mut ())?;
            part(&mut trajectory);
        }
        trajectory.advance_period(&mut ())?;
        part(&mut trajectory);
        strobes.push(trajectory.state());
    }
    strobes.pop();
    let metric = Metric::of(&strobes, flow);
    let size = flow.state_len();
    let units: Vec<f64> = (0..size).map(|i| 1.0 / metric.unit(i)).collect();
    for part in &mut parts {
        for (j, column) in part.as_mut_slice().chunks_exact_mut(size).enumerate() {
            column.iter_mut().zip(&units).for_each(|(x, unit)| *x = *x * unit * units[j].recip());
        }
        // A part that leaves the range of f64 decides nothing.
        if !part.iter().all(|x| x.is_finite()) {
            part.fill(f64::NAN);
        }
    }
    // Covariance of the errors. The second turn includes growth across the end of the cycle.
    let (mut errors, mut largest) = (DMatrix::zeros(size, size), 0.0f64);
    let [mut carried, mut transposed] = [(); 2].map(|()| DMatrix::zeros(size, size));
    let rounding = (ROUNDING * epsilon).powi(2);
    for part in parts.iter().chain(&parts) {
        multiply(part, &errors, &mut carried);
        part.transpose_to(&mut transposed);
        multiply(&carried, &transposed, &mut errors);
        (0..size).for_each(|i| errors[(i, i)] += rounding);
        largest = largest.max(errors.diagonal().max());
    }
    let pairs = strobes.iter().enumerate().flat_map(|(i, a)| strobes[..i].iter().map(move |b| (a, b)));
    let nearest = pairs.map(|(a, b)| metric.distance(a, b)).fold(1.0, f64::min);
    Ok(largest.sqrt() >= nearest)
}
