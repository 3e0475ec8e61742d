//! Densely sampled trajectories, for figures.

use super::Sample;
use crate::flow::Flow;
use crate::model::{GearPair, State};
use crate::reference::Trajectory;

/// Samples a trajectory from `start` at phase 0 over `periods` forcing periods, evenly, first
/// and last instant included. Ends early where the trajectory cannot be continued.
pub fn trace(pair: &GearPair, start: State, periods: u32, samples_per_period: usize) -> Vec<Sample> {
    let (Ok(oscillator), true) = (pair.oscillator(), periods > 0) else { return Vec::new() };
    let flow = Flow::new(&oscillator);
    let mut trajectory = Trajectory::new(&flow, pair.law(), start);
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
                return samples;
            }
            samples.push(Sample {
                t: (f64::from(period) + share) * flow.period,
                state: trajectory.state(),
                meshing: trajectory.meshing(),
            });
        }
    }
    samples
}
