//! Whether rounding decides the period of a cycle.

use nalgebra::DMatrix;

use super::analysis::Analysis;
use super::recurrence::Metric;
use super::{Event, Settings};
use crate::model::{Law, STATE, State};
use crate::motion::Flow;
use crate::motion::{Allowance, Stop, Trajectory};
use crate::stability::{Cycle, StrobeMap, UNIT, refine, times};

/// Rounding error of the motion between two events, in units of the machine epsilon times the size of the motion.
const FLIGHT_ROUNDING: f64 = 4.0;

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

/// Whether a cycle has too few events to amplify rounding errors of f64 to the size of the motion. On a stable cycle of period 1, errors
/// must grow to the size of the motion, by 1e15, within about one turn. Grazing has a status of its own, and an event that is not near
/// grazing amplifies by at most `1 / GRAZING_SPEED`, 2.5e4. So more than three events are needed.
pub(super) fn too_few_events(period: u32, events: &[Event]) -> bool {
    period == 1 && events.len() <= 3
}

/// Whether rounding scatters the states of a cycle by more than the distance between two strobes, or by the size of the motion. The period
/// is then a result of rounding. `events` are the events of the cycle.
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
    let rounding = (FLIGHT_ROUNDING * epsilon).powi(2);
    let largest = match flow.state_len() {
        0..=4 => largest_variance::<4>(&parts, &metric, rounding),
        5..=8 => largest_variance::<8>(&parts, &metric, rounding),
        _ => largest_variance::<STATE>(&parts, &metric, rounding),
    };
    let pairs = strobes.iter().enumerate().flat_map(|(i, a)| strobes[..i].iter().map(move |b| (a, b)));
    let nearest = pairs.map(|(a, b)| metric.distance(a, b)).fold(1.0, f64::min);
    Ok(largest.sqrt() >= nearest)
}

/// Returns the largest variance of an error, in the units of the metric, over two turns of a cycle with these derivatives. Each part adds
/// the variance `rounding` in every direction. A matrix has `N` rows or fewer.
fn largest_variance<const N: usize>(parts: &[DMatrix<f64>], metric: &Metric, rounding: f64) -> f64 {
    let units: [f64; N] = std::array::from_fn(|i| 1.0 / metric.unit(i));
    let inverse = units.map(f64::recip);
    let in_units = |part: &DMatrix<f64>| {
        let mut matrix = [[0.0; N]; N];
        for ((column, entries), factor) in
            matrix.iter_mut().zip(part.as_slice().chunks_exact(part.nrows())).zip(inverse)
        {
            column
                .iter_mut()
                .zip(entries)
                .zip(units)
                .for_each(|((x, entry), unit)| *x = entry * unit * factor);
        }
        // Entries beyond the range of f64 make the result NaN, which decides nothing.
        let is_finite = matrix.as_flattened().iter().all(|x| x.is_finite());
        if is_finite { matrix } else { [[f64::NAN; N]; N] }
    };
    let parts: Vec<[[f64; N]; N]> = parts.iter().map(in_units).collect();
    // Covariance of the errors. The second turn includes growth across the end of the cycle.
    let (mut errors, mut largest) = ([[0.0; N]; N], 0.0f64);
    for part in parts.iter().chain(&parts) {
        let carried = times(part, &errors);
        errors = times(&carried, &std::array::from_fn(|j| std::array::from_fn(|i| part[i][j])));
        (0..metric.len()).for_each(|i| {
            errors[i][i] += rounding;
            largest = largest.max(errors[i][i]);
        });
    }
    largest
}
