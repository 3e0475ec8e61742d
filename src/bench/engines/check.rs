//! Are the answers right? A sample of the last map, replayed on the reference.

use super::Bench;
use crate::gpu::{Gpu, Precision};
use crate::plan::Plan;
use crate::record::Record;
use crate::scene::Scene;
use crate::validate::{self, StateSource, Subject, Validation, states};

/// Seed of the sample.
const SEED: u64 = 1;

/// What the replay showed.
#[derive(Clone, Debug)]
pub struct Check {
    /// Lanes of the map.
    pub lanes: usize,
    /// Its validation.
    pub validation: Validation,
}

/// Replays `samples` cells of the map that was made last; none if none was made.
pub fn check(bench: &mut Bench<'_>, samples: usize) -> Option<Check> {
    let (scene, records, device) = bench.last()?;
    Some(replay(scene, records, device, samples))
}

fn replay(scene: &Scene, records: &[Record], device: Option<&mut Gpu>, samples: usize) -> Check {
    let plan = Plan::new(scene);
    let precision = device.as_ref().map_or(Precision::F64, |device| device.precision());
    let subject = Subject { plan: &plan, records, precision, is_lane: device.is_some() };
    let sample = validate::sample(&plan, records, samples, SEED);
    let ids: Vec<u32> = sample.picks.iter().map(|pick| pick.id).collect();
    let source = device.map_or(StateSource::Replay, |device| {
        pollster::block_on(states::lane_states(device, &plan, records, &ids, None))
            .map_or_else(|error| StateSource::None(error.to_string()), StateSource::Lanes)
    });
    Check { lanes: records.len(), validation: validate::replay(&subject, &sample, source, &|_| {}) }
}
