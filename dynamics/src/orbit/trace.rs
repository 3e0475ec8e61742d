//! Densely sampled trajectories for figures.

use super::Sample;
use super::instant::at_present;
use crate::model::{Model, ModelError, Side, State};
use crate::motion::Flow;
use crate::motion::{Stop, Trajectory};

/// Samples a trajectory evenly over `periods` forcing periods, including the first and the last instant. It starts
/// from `start` at phase 0, in lasting contact with the wall `meshing` or in free motion. If the trajectory cannot be
/// continued, the samples up to that point are returned. A sample at the time of an event has the state after it.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub fn trace(
    model: &dyn Model,
    start: State,
    meshing: Option<Side>,
    periods: u32,
    samples_per_period: usize,
) -> Result<Vec<Sample>, ModelError> {
    let flow = Flow::of(model)?;
    if periods == 0 {
        return Ok(Vec::new());
    }
    let mut trajectory = Trajectory::meshing_from(&flow, model.law(), start, meshing);
    let mut samples = vec![sample(&trajectory, 0.0)];
    for _ in 0..periods {
        if sample_period(&mut trajectory, samples_per_period, &mut samples).is_err() {
            break;
        }
    }
    Ok(samples)
}

/// Advances the trajectory by one forcing period and appends its samples, the last one at the end of the period.
pub(super) fn sample_period(
    trajectory: &mut Trajectory<'_, 0>,
    samples_per_period: usize,
    samples: &mut Vec<Sample>,
) -> Result<(), Stop> {
    let (before, period) = (trajectory.period() as f64, trajectory.flow().period);
    for i in 1..=samples_per_period {
        let share = i as f64 / samples_per_period as f64;
        if i == samples_per_period {
            trajectory.advance_period(&mut ())?;
        } else {
            trajectory.advance_to(share * period, &mut ())?;
        }
        samples.push(sample(trajectory, (before + share) * period));
    }
    Ok(())
}

/// Returns the sample of a trajectory at the present time, which is `t` since the start of the trace.
pub(super) fn sample(trajectory: &Trajectory<'_, 0>, t: f64) -> Sample {
    let (state, meshing) = at_present(trajectory, t);
    Sample { t, state, meshing }
}
