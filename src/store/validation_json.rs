//! `validation.json`: the result of validating a map. The report shows the same object.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::show::cells::Cells;
use crate::show::replay;
use crate::store::manifest::Head;
use crate::store::manifest::map::Made;
use crate::validate::{
    ChaosTest, HORIZON, HalfMesh, Judge, Kind, Mismatch, Off, Rate, StateCheck, StratumResult, Validation,
    Value,
};

#[derive(Serialize)]
pub(crate) struct ValidationObject {
    #[serde(flatten)]
    head: Head,
    engine: String,
    precision: String,
    device: String,
    /// Device that ran lanes again, if any, and whether it computed the map.
    again_on: Option<String>,
    same_device: bool,
    judge: &'static str,
    seed: u64,
    cells: usize,
    /// Unit of all numbers but `cells`: cells, or runs if cells have several starts.
    counted: &'static str,
    runs: usize,
    /// Number of integrated runs. Only these are replayed.
    integrated: usize,
    filled: usize,
    samples: usize,
    /// Reasons why the validation failed; empty if it passed.
    faults: Vec<String>,
    strata: Vec<StratumObject>,
    kinds: BTreeMap<&'static str, &'static str>,
    agreement: BTreeMap<&'static str, AgreementObject>,
    /// Number of records that the same engine reproduced bit for bit.
    identical: usize,
    computed_again: usize,
    chaos: Vec<ChaosObject>,
    /// Changes at half the meshing speed in the uniform stratum; null if no cell meshes.
    half_mesh_speed: Option<HalfMeshObject>,
    states: Option<StatesObject>,
    /// Runs of the whole map whose record contains a number that is not finite.
    not_finite: Vec<u32>,
    mismatches: Vec<MismatchObject>,
}

#[derive(Serialize)]
struct RateObject {
    count: usize,
    /// Limits of the 95 % interval.
    interval: [f64; 2],
    text: String,
}

#[derive(Serialize)]
struct StratumObject {
    name: &'static str,
    runs: usize,
    sampled: usize,
    differing: RateObject,
    kinds: BTreeMap<&'static str, RateObject>,
}

#[derive(Serialize)]
struct AgreementObject {
    compared: usize,
    agreeing: usize,
}

#[derive(Serialize)]
struct ChaosObject {
    name: &'static str,
    cells: usize,
    distance: f64,
    bar: Option<f64>,
    means: [f64; 2],
    fails: bool,
}

/// Changes of class, and of the period, word and pattern of cycles. Mirror images count as equal.
#[derive(Serialize)]
struct HalfMeshObject {
    class: ChangedObject,
    period: ChangedObject,
    word: ChangedObject,
    pattern: ChangedObject,
}

#[derive(Serialize)]
struct ChangedObject {
    compared: usize,
    changed: usize,
    interval: [f64; 2],
    text: String,
}

#[derive(Serialize)]
struct StatesObject {
    horizon_periods: u32,
    compared: usize,
    off: RateObject,
    median: f64,
    worst: f64,
    lanes: Vec<OffObject>,
}

#[derive(Serialize)]
struct OffObject {
    id: u32,
    /// Null if it is infinite.
    distance: f64,
    bar: f64,
}

#[derive(Serialize)]
struct MismatchObject {
    id: u32,
    i: usize,
    j: usize,
    values: BTreeMap<String, f64>,
    differences: Vec<DifferenceObject>,
    kind: &'static str,
    replay: String,
}

#[derive(Serialize)]
struct DifferenceObject {
    field: &'static str,
    map: Value,
    judge: Value,
}

impl ValidationObject {
    /// Collects the result of a validation; `again_on` is the device that ran lanes again, if any.
    pub(crate) fn new(
        cells: &Cells<'_>,
        made: &Made<'_>,
        again_on: Option<&str>,
        validation: &Validation,
    ) -> ValidationObject {
        let agreement = validation.agreement.iter().map(|field| {
            let counts = AgreementObject { compared: field.compared, agreeing: field.agreeing };
            (field.field.name(), counts)
        });
        ValidationObject {
            head: Head::of("validate"),
            engine: made.engine.to_owned(),
            precision: made.precision.to_owned(),
            device: made.device.to_owned(),
            again_on: again_on.map(str::to_owned),
            same_device: again_on.is_none_or(|again| again == made.device),
            judge: match validation.judge {
                Judge::Reference => "reference",
                Judge::Lanes => "lanes_f64",
                Judge::Independent => "dop853",
            },
            seed: validation.seed,
            cells: cells.counts().iter().product(),
            counted: validation.counted(),
            runs: validation.runs,
            integrated: validation.runs - validation.filled,
            filled: validation.filled,
            samples: validation.replayed,
            faults: validation.faults(),
            strata: validation.strata.iter().map(StratumObject::from).collect(),
            kinds: Kind::ALL.into_iter().map(|kind| (kind.name(), meaning(kind))).collect(),
            agreement: agreement.collect(),
            identical: validation.again[0],
            computed_again: validation.again[1],
            chaos: validation.chaos.iter().map(ChaosObject::from).collect(),
            half_mesh_speed: validation.half_mesh.as_ref().map(HalfMeshObject::from),
            states: validation.states.as_ref().map(StatesObject::from),
            not_finite: validation.not_finite.clone(),
            mismatches: validation.mismatches.iter().map(|mismatch| mismatched(cells, mismatch)).collect(),
        }
    }
}

fn mismatched(cells: &Cells<'_>, mismatch: &Mismatch) -> MismatchObject {
    let row = cells.row(mismatch.id as usize);
    let swept = cells.scene().swept().map(|parameter| parameter.name.to_string());
    let differences = mismatch.differences.iter().map(|difference| DifferenceObject {
        field: difference.field.name(),
        map: difference.record.clone(),
        judge: difference.judge.clone(),
    });
    MismatchObject {
        id: mismatch.id,
        i: row.indices[0],
        j: row.indices[1],
        values: swept.zip(cells.values(mismatch.id as usize)).collect(),
        differences: differences.collect(),
        kind: mismatch.kind.name(),
        replay: replay::command(cells, mismatch.id as usize),
    }
}

impl From<Rate> for RateObject {
    fn from(rate: Rate) -> RateObject {
        RateObject { count: rate.count, interval: rate.interval, text: rate.text() }
    }
}

impl From<&StratumResult> for StratumObject {
    fn from(stratum: &StratumResult) -> StratumObject {
        let kinds = Kind::ALL.into_iter().map(|kind| (kind.name(), stratum.rate(kind).into()));
        StratumObject {
            name: stratum.stratum.name(),
            runs: stratum.runs,
            sampled: stratum.sampled,
            differing: stratum.differing().into(),
            kinds: kinds.collect(),
        }
    }
}

impl From<&ChaosTest> for ChaosObject {
    fn from(test: &ChaosTest) -> ChaosObject {
        let &ChaosTest { name, cells, distance, bar, means } = test;
        ChaosObject { name, cells, distance, bar, means, fails: test.fails() }
    }
}

impl From<Rate> for ChangedObject {
    fn from(rate: Rate) -> ChangedObject {
        ChangedObject {
            compared: rate.among,
            changed: rate.count,
            interval: rate.interval,
            text: rate.text(),
        }
    }
}

impl From<&HalfMesh> for HalfMeshObject {
    fn from(half: &HalfMesh) -> HalfMeshObject {
        HalfMeshObject {
            class: half.classes.into(),
            period: half.periods.into(),
            word: half.words.into(),
            pattern: half.patterns.into(),
        }
    }
}

impl From<&StateCheck> for StatesObject {
    fn from(states: &StateCheck) -> StatesObject {
        let lane = |&Off { id, distance, bar }: &Off| OffObject { id, distance, bar };
        StatesObject {
            horizon_periods: HORIZON,
            compared: states.compared,
            off: states.rate().into(),
            median: states.distances[0],
            worst: states.distances[1],
            lanes: states.off.iter().map(lane).collect(),
        }
    }
}

/// Explains a kind of mismatch.
fn meaning(kind: Kind) -> &'static str {
    match kind {
        Kind::Attractor => {
            "another attractor of the same cell: the start reaches it when it moves within the engine's resolution, and \
             the reference stays on it from the map's last state"
        }
        Kind::Border => {
            "a border within rounding: the reference gives the map's answer when parameters and start move within the \
             engine's resolution, or lanes in double precision give the reference's"
        }
        Kind::Budget => {
            "a budget too short: one side gives the other's answer with fewer or with more periods, or the motion \
             settles or separates too slowly to be told"
        }
        Kind::Cap => "a cap ended the lane, as its status says, and does so again",
        Kind::Unexplained => "no computation gives a reason",
    }
}
