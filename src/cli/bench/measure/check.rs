//! Are the answers right? A sample of the last map, replayed on the reference.

use super::Bench;
use crate::gpu::{Gpu, Precision};
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::record::Record;
use crate::validate::{self, Kind, Lanes, Subject, Validation};

/// Seed of the sample.
const SEED: u64 = 1;

/// What the replay showed.
#[derive(Clone, Debug)]
pub struct Check {
    /// Lanes of the map.
    pub lanes: usize,
    /// Its validation.
    pub validation: Validation,
    /// Restitution and frequency of cells that differ without an explanation.
    pub unexplained: Vec<[f64; 2]>,
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
    let again = |device| pollster::block_on(Lanes::run(&subject, &sample, Some(device), None)).ok();
    let lanes = device.and_then(again).unwrap_or_default();
    let validation = validate::replay(&subject, &sample, &lanes, &|_| {});
    let without = validation.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
    let unexplained = without
        .map(|mismatch| plan.indices(mismatch.id))
        .map(|[i, j]| [plan.axes()[0].value(i), plan.axes()[1].value(j)]);
    Check { lanes: records.len(), unexplained: unexplained.collect(), validation }
}
