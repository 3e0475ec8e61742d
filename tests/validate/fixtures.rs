//! Maps and their validation, without a device.

use std::path::Path;

use crate::common::gpu::all_records;
use rattlemap::gpu::Precision;
use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene};
use rattlemap::record::Record;
use rattlemap::store::record_file::{Identity, Order, RecordFile};
use rattlemap::validate::{Draw, Kind, Lanes, Sample, Stratum, Subject, Validation, replay};

/// Every quantity that a scene can request.
pub(crate) const EVERYTHING: [Quantity; 7] = [
    Quantity::Class,
    Quantity::Lyapunov,
    Quantity::Impacts,
    Quantity::Mesh,
    Quantity::Symmetric,
    Quantity::Word,
    Quantity::Pattern,
];

/// Returns the records of a plan by the CPU engine, by cell.
pub(crate) fn cpu_records(plan: &Plan) -> Vec<Record> {
    all_records(plan, &mut Engine::Cpu(Cpu::new(plan)))
}

/// Returns the identity of the records of a scene by the CPU engine.
pub(crate) fn cpu_identity(scene: &Scene) -> Identity {
    Identity::new("cpu", "f64", "event-driven reference", scene.identity())
}

/// Reads the records of a file.
pub(crate) fn read_records(path: &Path, identity: &Identity) -> Vec<(u32, Record)> {
    let mut records = Vec::new();
    let read = RecordFile::read(path, identity, Order::Any, |batch| {
        records.extend_from_slice(batch);
        true
    });
    read.unwrap();
    records
}

/// Returns a sample of these runs. No states are compared.
pub(crate) fn sample_of(ids: Vec<u32>) -> Sample {
    let requested = ids.len();
    let draws = vec![Draw { stratum: Stratum::Uniform, runs: requested, ids }];
    Sample { seed: 0, requested, draws, states: Vec::new() }
}

/// Validates these runs of a map.
pub(crate) fn validate_runs(subject: &Subject<'_>, ids: Vec<u32>) -> Validation {
    replay(subject, &sample_of(ids), &Lanes::default(), &|_| {})
}

/// Validates every run of a map.
pub(crate) fn validate_all(
    plan: &Plan,
    records: &[Record],
    precision: Precision,
    is_lane: bool,
) -> Validation {
    validate_runs(
        &Subject { plan, records: &records, precision, is_lane },
        (0..records.len() as u32).collect(),
    )
}

/// Validates a lane's record of a plan's first run.
pub(crate) fn validate_first(plan: &Plan, record: &Record, precision: Precision) -> Validation {
    let mut records = vec![Record::default(); plan.run_count()];
    records[0].clone_from(record);
    validate_runs(&Subject { plan, records: &records, precision, is_lane: true }, vec![0])
}

/// Returns the explanation of a lane's record of a plan's first run; `None` if the record is right.
pub(crate) fn kind(plan: &Plan, record: &Record, precision: Precision) -> Option<Kind> {
    kinds(&validate_first(plan, record, precision)).first().copied()
}

/// Returns the kind of each mismatch.
pub(crate) fn kinds(validation: &Validation) -> Vec<Kind> {
    validation.mismatches.iter().map(|mismatch| mismatch.kind).collect()
}

/// Returns the runs whose mismatch has no explanation.
pub(crate) fn unexplained(validation: &Validation) -> Vec<u32> {
    let without = validation.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
    without.map(|mismatch| mismatch.id).collect()
}
