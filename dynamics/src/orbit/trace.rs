//! Densely sampled trajectories for figures.

use super::Sample;
use crate::flow::Flow;
use crate::model::{Model, ModelError, Side, State};
use crate::reference::Trajectory;

/// Samples a trajectory evenly over `periods` forcing periods, including the first and the last instant. It starts
/// from `start` at phase 0, in lasting contact with the wall `meshing` or in free motion. If the trajectory cannot be
/// continued, the samples up to that point are returned.
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
    let mut samples = vec![Sample { t: 0.0, state: start, meshing: trajectory.meshing() }];
    for period in 0..periods {
        for i in 1..=samples_per_period {
            let share = i as f64 / samples_per_period as f64;
            let advanced = if i == samples_per_period {
                trajectory.advance_period(&mut ())
            } else {
                trajectory.advance_to(share * flow.period, &mut ())
            };
            if advanced.is_err() {
                return Ok(samples);
            }
            samples.push(Sample {
                t: (f64::from(period) + share) * flow.period,
                state: trajectory.state(),
                meshing: trajectory.meshing(),
            });
        }
    }
    Ok(samples)
}
