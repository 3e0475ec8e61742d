//! How right is a finished map? Cells of it, replayed on the reference.
//!
//! A sample of cells ([`sample()`]) is measured again by [`crate::orbit::measure`] within the
//! plan's own budget. Where class, period, word, symmetry, exponent or averages differ, other
//! computations on the reference look for the reason ([`Explanation`]); a difference that none
//! of them gives is unexplained, and the map is not to be trusted there. Lanes are also run
//! again over a few periods, and their states compared with the reference's in units of an
//! error budget ([`states`]).
//!
//! A map of the CPU engine was made by the reference: its replay shows that records are what
//! they were, not that the reference is right. For that see the tests.

mod again;
mod answer;
mod averages;
mod case;
mod explain;
mod explanation;
mod lane_growth;
mod lane_model;
mod limits;
mod on_the_way;
mod own_figures;
mod reached;
mod reading;
mod rounded;
mod rounding;
mod same_cycle;
mod sample;
mod spread;
pub mod states;
mod unsettled;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

pub use answer::{Difference, Field, Value};
pub use explanation::Explanation;
pub use sample::{Pick, Sample, Stratum, StratumCount, sample};
pub use states::{Quantiles, StateCheck, StateSource};

use crate::gpu::Precision;
use crate::orbit::{Budget, Measured};
use crate::plan::Plan;
use crate::record::{Record, valid};
use answer::{Answer, Bars, Compared};
use case::Case;
use states::Errors;

/// Cells that a sample has unless something else is asked for.
pub const DEFAULT_SAMPLES: usize = 400;

/// A finished map, and what made it.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// Its cells and their starts.
    pub plan: &'a Plan,
    /// One record per run.
    pub records: &'a [Record],
    /// The precision that the records were computed in.
    pub precision: Precision,
    /// Whether lanes on a graphics device computed them; otherwise the reference itself did.
    pub is_lane: bool,
}

/// Agreement of one field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// What is compared.
    pub field: Field,
    /// Cells in which both sides have it.
    pub compared: usize,
    /// Cells in which they agree.
    pub agreeing: usize,
}

/// A cell whose record is not what the reference says.
#[derive(Clone, Debug, PartialEq)]
pub struct Mismatch {
    /// The run, as in [`Plan::cell`].
    pub id: u32,
    /// What differs.
    pub differences: Vec<Difference>,
    /// Why, if a check shows it.
    pub explanation: Option<Explanation>,
}

/// What the replay of a sample showed.
#[derive(Clone, Debug)]
pub struct Validation {
    /// Seed of the sample.
    pub seed: u64,
    /// Runs of the map: one per cell and start.
    pub runs: usize,
    /// Those that were filled from their neighbours and never integrated; none of them is replayed.
    pub filled: usize,
    /// Whether cells have several starts.
    pub has_starts: bool,
    /// Cells by stratum.
    pub strata: Vec<StratumCount>,
    /// Cells compared, by field.
    pub agreement: Vec<Agreement>,
    /// States against the reference's.
    pub states: StateCheck,
    /// Every cell that differs, by id.
    pub mismatches: Vec<Mismatch>,
}

impl Validation {
    /// Cells that were replayed.
    pub fn sampled(&self) -> usize {
        self.strata.iter().map(|stratum| stratum.sampled).sum()
    }

    /// What is counted.
    pub fn counted(&self) -> &'static str {
        if self.has_starts { "runs" } else { "cells" }
    }

    /// Mismatches without an explanation.
    pub fn unexplained(&self) -> usize {
        self.mismatches.iter().filter(|mismatch| mismatch.explanation.is_none()).count()
    }

    /// How many mismatches have this explanation.
    pub fn explained_by(&self, explanation: Explanation) -> usize {
        self.mismatches.iter().filter(|mismatch| mismatch.explanation == Some(explanation)).count()
    }
}

/// What one cell showed.
#[derive(Default)]
struct Replayed {
    /// Fields that were compared, and whether they agree.
    fields: Vec<(Field, bool)>,
    error: Option<states::Error>,
    mismatch: Option<Mismatch>,
}

/// Replays a sample on the reference. `source` says where states come from; `report` is told
/// how many cells are done, from any thread.
///
/// # Panics
/// If `source` has lanes, and not one per cell of the sample.
pub fn replay(
    subject: &Subject<'_>,
    sample: &Sample,
    source: StateSource,
    report: &(dyn Fn(usize) + Sync),
) -> Validation {
    if let StateSource::Lanes(lanes) = &source {
        assert_eq!(lanes.len(), sample.picks.len(), "one lane per cell");
    }
    let (done, among) = (AtomicUsize::new(0), sample.among);
    let mut replayed: Vec<Replayed> = sample
        .picks
        .par_iter()
        .enumerate()
        // Cells differ a thousandfold in cost: no task holds more than one.
        .with_max_len(1)
        .map(|(k, pick)| {
            let lane = if let StateSource::Lanes(lanes) = &source { Some(&lanes[k]) } else { None };
            let replayed = if subject.is_lane {
                replay_lane(subject, pick.id, lane, among)
            } else {
                replay_own(subject, pick.id, among)
            };
            report(done.fetch_add(1, Ordering::Relaxed) + 1);
            replayed
        })
        .collect();
    if !subject.is_lane {
        // On another processor hardly any record is the same to the bit.
        let identical = replayed.iter().filter(|cell| cell.mismatch.is_none()).count();
        if 2 * identical <= replayed.len() {
            let again = |cell: &mut Replayed| {
                if let Some(mismatch) = cell.mismatch.take() {
                    *cell = Replayed { error: cell.error, ..replay_within_bars(subject, mismatch.id, among) };
                }
            };
            replayed.par_iter_mut().with_max_len(1).for_each(again);
        }
    }
    let agreement = Field::ALL.map(|field| {
        let of_field = || replayed.iter().flat_map(|cell| &cell.fields).filter(move |(f, _)| *f == field);
        Agreement {
            field,
            compared: of_field().count(),
            agreeing: of_field().filter(|(_, same)| *same).count(),
        }
    });
    let errors: Errors = replayed.iter().filter_map(|cell| cell.error).collect();
    let mut mismatches: Vec<Mismatch> = replayed.into_iter().filter_map(|cell| cell.mismatch).collect();
    mismatches.sort_by_key(|mismatch| mismatch.id);
    Validation {
        seed: sample.seed,
        runs: subject.records.len(),
        filled: subject.records.iter().filter(|record| record.valid & valid::FILLED != 0).count(),
        has_starts: subject.plan.start_count() > 1,
        strata: sample.strata.clone(),
        agreement: agreement.to_vec(),
        states: errors.check(source),
        mismatches,
    }
}

/// Where a record differs from what was measured on the reference within the same budget,
/// without asking why.
pub fn disagreements(
    measured: &Measured,
    record: &Record,
    precision: Precision,
    forcing_period: f64,
    budget: &Budget,
) -> Vec<Difference> {
    let compared = Answer::from(measured).compare(record, &Bars::new(precision, forcing_period, budget));
    compared.into_iter().filter_map(|(_, differs)| differs).collect()
}

fn replay_lane(subject: &Subject<'_>, id: u32, lane: Option<&Record>, among: usize) -> Replayed {
    let case = Case::new(subject, id, lane, among);
    let mut fields = case.truth.compare(case.record, &case.bars);
    let (ran, longest) = (case.record.periods_run, case.budget.longest());
    fields.push(answer::compared(Field::Periods, ran <= longest, || {
        (Value::Count(ran), Value::Count(longest))
    }));
    let error = states::lane_error(&case);
    if let (Some(error), Some(_)) = (error, lane) {
        fields.push(error.compared());
    }
    Replayed { error, ..Replayed::of(id, fields, |differences| explain::explain(&case, differences)) }
}

/// A cell of the CPU engine, compared bit by bit.
fn replay_own(subject: &Subject<'_>, id: u32, among: usize) -> Replayed {
    let case = Case::new(subject, id, None, among);
    let own = again::own_record(&case, subject.plan.needs());
    let fields = again::bit_by_bit(case.record, &own);
    Replayed { error: states::replay_error(&case), ..Replayed::of(id, fields, |_| None) }
}

/// The same where processors round differently.
fn replay_within_bars(subject: &Subject<'_>, id: u32, among: usize) -> Replayed {
    let (case, needs) = (Case::new(subject, id, None, among), subject.plan.needs());
    let fields = again::within_bars(&case, needs);
    Replayed::of(id, fields, |differences| again::explain(&case, differences, needs))
}

impl Replayed {
    fn of(
        id: u32,
        fields: Vec<Compared>,
        explain: impl FnOnce(&[Difference]) -> Option<Explanation>,
    ) -> Replayed {
        let differences: Vec<Difference> = fields.iter().filter_map(|(_, differs)| differs.clone()).collect();
        let mismatch = (!differences.is_empty()).then(|| {
            let explanation = explain(&differences);
            Mismatch { id, differences, explanation }
        });
        let fields = fields.into_iter().map(|(field, differs)| (field, differs.is_none())).collect();
        Replayed { fields, error: None, mismatch }
    }
}
