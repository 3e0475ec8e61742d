//! Records under judgement.

use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::record::Record;
use rattlemap::validate::{Draw, Kind, Lanes, Sample, Stratum, Subject, Validation, replay};

/// A sample of these runs alone, none of whose states are compared.
pub(crate) fn only(ids: Vec<u32>) -> Sample {
    let draws = vec![Draw { stratum: Stratum::Uniform, runs: ids.len(), ids }];
    Sample { seed: 0, draws, states: Vec::new() }
}

/// Validates every run of a map, without a device.
pub(crate) fn validated(plan: &Plan, records: &[Record], precision: Precision, is_lane: bool) -> Validation {
    let subject = Subject { plan, records, precision, is_lane };
    replay(&subject, &only((0..records.len() as u32).collect()), &Lanes::default(), &|_| {})
}

/// Validates a record of a plan's first run, without a device.
pub(crate) fn first(plan: &Plan, record: Record, precision: Precision) -> Validation {
    let mut records = vec![Record::default(); plan.run_count()];
    records[0] = record;
    let subject = Subject { plan, records: &records, precision, is_lane: true };
    replay(&subject, &only(vec![0]), &Lanes::default(), &|_| {})
}

/// Why it differs from what its start reaches; none if it does not.
pub(crate) fn kind(plan: &Plan, record: Record, precision: Precision) -> Option<Kind> {
    first(plan, record, precision).mismatches.first().map(|mismatch| mismatch.kind)
}

/// Runs that differ without a reason.
pub(crate) fn unexplained(found: &Validation) -> Vec<u32> {
    let without = found.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
    without.map(|mismatch| mismatch.id).collect()
}
