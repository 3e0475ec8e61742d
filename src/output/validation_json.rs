//! `validation.json`: what the replay of a map's cells on the reference showed.
//!
//! The report shows the same object.

use std::collections::BTreeMap;

use serde::Serialize;

use super::cells::Cells;
use super::manifest::Head;
use super::map_manifest::Made;
use super::{names, replay};
use crate::validate::states::HORIZON;
use crate::validate::{Explanation, Mismatch, Quantiles, StateCheck, Stratum, Validation, Value};

#[derive(Serialize)]
pub(super) struct ValidationObject {
    #[serde(flatten)]
    head: Head,
    engine: String,
    precision: String,
    device: String,
    seed: u64,
    cells: usize,
    /// What all numbers but `cells` count: runs if cells have several starts.
    counted: &'static str,
    runs: usize,
    /// Only these are replayed: the others were filled from their neighbours.
    integrated: usize,
    filled: usize,
    samples: usize,
    strata: Vec<StratumObject>,
    agreement: BTreeMap<&'static str, AgreementObject>,
    states: StatesObject,
    mismatched: usize,
    explanations: Vec<ExplanationObject>,
    unexplained: usize,
    mismatches: Vec<MismatchObject>,
}

#[derive(Serialize)]
struct StratumObject {
    name: String,
    runs: usize,
    sampled: usize,
}

#[derive(Serialize)]
struct AgreementObject {
    compared: usize,
    agreeing: usize,
}

#[derive(Serialize)]
#[serde(tag = "check", rename_all = "snake_case")]
enum StatesObject {
    Lanes {
        /// What ran the lanes again, and whether that is what made the map.
        device: String,
        same_device: bool,
        horizon_periods: u32,
        compared: usize,
        above_budget: usize,
        budgets: Option<QuantilesObject>,
        absolute: Option<QuantilesObject>,
    },
    Replay {
        compared: usize,
        identical: usize,
        absolute: Option<QuantilesObject>,
    },
    Skipped {
        reason: String,
    },
}

#[derive(Serialize)]
struct QuantilesObject {
    median: f64,
    percentile_99: f64,
    worst: f64,
}

#[derive(Serialize)]
struct ExplanationObject {
    name: &'static str,
    meaning: &'static str,
    mismatches: usize,
}

#[derive(Serialize)]
struct MismatchObject {
    id: u32,
    i: usize,
    j: usize,
    values: BTreeMap<&'static str, f64>,
    differences: Vec<DifferenceObject>,
    explanation: Option<&'static str>,
    replay: String,
}

#[derive(Serialize)]
struct DifferenceObject {
    field: &'static str,
    map: Value,
    reference: Value,
}

impl ValidationObject {
    /// `again` is the device that ran the sample's lanes again, if one did.
    pub(super) fn new(
        cells: &Cells<'_>,
        made: &Made<'_>,
        again: Option<&str>,
        validation: &Validation,
    ) -> ValidationObject {
        let strata = validation.strata.iter().map(|stratum| StratumObject {
            name: stratum_name(stratum.stratum),
            runs: stratum.runs,
            sampled: stratum.sampled,
        });
        let agreement = validation.agreement.iter().map(|field| {
            let counts = AgreementObject { compared: field.compared, agreeing: field.agreeing };
            (field.field.name(), counts)
        });
        let explanations = Explanation::ALL.into_iter().map(|explanation| ExplanationObject {
            name: explanation.name(),
            meaning: meaning(explanation),
            mismatches: validation.explained_by(explanation),
        });
        ValidationObject {
            head: Head::of("validate"),
            engine: made.engine.to_owned(),
            precision: made.precision.to_owned(),
            device: made.device.to_owned(),
            seed: validation.seed,
            cells: cells.counts().iter().product(),
            counted: validation.counted(),
            runs: validation.runs,
            integrated: validation.runs - validation.filled,
            filled: validation.filled,
            samples: validation.sampled(),
            strata: strata.collect(),
            agreement: agreement.collect(),
            states: StatesObject::new(&validation.states, made.device, again),
            mismatched: validation.mismatches.len(),
            explanations: explanations.collect(),
            unexplained: validation.unexplained(),
            mismatches: validation.mismatches.iter().map(|mismatch| mismatched(cells, mismatch)).collect(),
        }
    }
}

fn mismatched(cells: &Cells<'_>, mismatch: &Mismatch) -> MismatchObject {
    let row = cells.row(mismatch.id as usize);
    let axes = cells.scene().axes().iter().map(|axis| axis.parameter().name);
    let differences = mismatch.differences.iter().map(|difference| DifferenceObject {
        field: difference.field.name(),
        map: difference.record.clone(),
        reference: difference.reference.clone(),
    });
    MismatchObject {
        id: mismatch.id,
        i: row.indices[0],
        j: row.indices[1],
        values: axes.zip(row.values).collect(),
        differences: differences.collect(),
        explanation: mismatch.explanation.map(Explanation::name),
        replay: replay::command(cells, mismatch.id as usize),
    }
}

impl StatesObject {
    fn new(check: &StateCheck, made_on: &str, again: Option<&str>) -> StatesObject {
        let object = |quantiles: &Option<Quantiles>| quantiles.as_ref().map(QuantilesObject::from);
        match check {
            StateCheck::Lanes { cells, above_budget, units, absolute } => StatesObject::Lanes {
                device: again.unwrap_or(made_on).to_owned(),
                same_device: again.is_none_or(|again| again == made_on),
                horizon_periods: HORIZON,
                compared: *cells,
                above_budget: *above_budget,
                budgets: object(units),
                absolute: object(absolute),
            },
            StateCheck::Replay { cells, identical, absolute } => {
                StatesObject::Replay { compared: *cells, identical: *identical, absolute: object(absolute) }
            }
            StateCheck::Skipped { reason } => StatesObject::Skipped { reason: reason.clone() },
        }
    }
}

impl From<&Quantiles> for QuantilesObject {
    fn from(quantiles: &Quantiles) -> QuantilesObject {
        let &Quantiles { median, percentile_99, worst } = quantiles;
        QuantilesObject { median, percentile_99, worst }
    }
}

fn stratum_name(stratum: Stratum) -> String {
    match stratum {
        Stratum::Uniform => "uniform".to_owned(),
        Stratum::Border => "border".to_owned(),
        Stratum::Status(status) => format!("status {}", names::status(status)),
    }
}

/// The explanation for a reader who has not read the code.
fn meaning(explanation: Explanation) -> &'static str {
    match explanation {
        Explanation::EngineCap => {
            "the engine's caps ended the cell, as its status says, and it does need more"
        }
        Explanation::UndecidedInBudget => {
            "one side does not decide within the periods allowed; on the reference the motion settles too late for that, or \
             grows too little"
        }
        Explanation::CoexistingAttractor => {
            "another attractor of the same cell: the reference stays on it when started on the map's last state, and \
             comes to it from the cell's start moved within rounding"
        }
        Explanation::Chaos => {
            "a chaotic transient outlives the periods allowed, or averages over chaos scatter as much on the \
             reference itself"
        }
        Explanation::Border => {
            "the reference changes its answer to the map's within the rounding of parameters and start, or at a \
             bifurcation"
        }
        Explanation::Unsettled => {
            "the cycle was read before the motion had settled on it, or rounding keeps it from settling; the \
             reference reads the same there"
        }
        Explanation::NearlySymmetric => {
            "the cycle differs from its mirror image by less than 2.5e-4 of its size, all that lanes look for"
        }
        Explanation::BelowResolution => {
            "lanes cannot resolve it: one period is a multiple of the other and the cycles are as near to each other, \
             or rounding moves the exponent that far or keeps the motion from settling"
        }
        Explanation::NearGrazing => "an event grazes more nearly than the precision resolves",
    }
}
