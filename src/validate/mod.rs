//! Validation of a finished map: a sample of its cells is recomputed by another engine and compared.
//!
//! The reference computes each sampled cell over the plan's whole budget, without early stops. A record that differs is a mismatch of one
//! of five kinds ([`Kind`]). The last kind is `unexplained`. For the others, a computation explains the difference, or the status of an
//! answer leaves the result open. Averages of chaotic motion are compared as distributions over the class ([`ChaosTest`]). States of many
//! lanes are compared a few periods after their start ([`StateCheck`]). Meshing cells are also computed with half the meshing speed
//! ([`HalfMesh`]). The main result is a rate per kind with its 95 % interval ([`Rate`]), from cells drawn uniformly.
//!
//! A map that the reference computed is also judged by lanes in f64, or by an adaptive ODE solver with event location
//! (`independent`) where no adapter has f64. The result names the judge ([`Judge`]).

mod cell;
mod chaos;
mod chaos_ends;
mod compare;
mod explain;
mod finite;
mod half_mesh;
#[cfg(feature = "independent")]
pub mod independent;
mod lanes;
mod near_cycle;
mod rate;
mod sample;
mod states;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

pub use chaos::ChaosTest;
pub use chaos_ends::{CHAOS_PERIODS, ChaosEnd, ChaosEnds, draw_chaos, follow_chaos};
pub use compare::{Difference, Field, Value};
pub use half_mesh::HalfMesh;
pub use lanes::{Lanes, run_lanes};
pub use rate::{Rate, TOLERATED};
pub use sample::{Draw, Sample, Stratum, sample};
pub use states::{HORIZON, Off, StateCheck};

use crate::findings::attractors::Basins;
use crate::gpu::Precision;
use crate::map::plan::Plan;
use crate::record::classify::{classify, status};
use crate::record::{Record, Records, valid};
use cell::Cell;
use compare::{Answer, Bars, Compared};
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::{Budget, Class, Status};

/// Default number of cells in a sample.
pub const DEFAULT_SAMPLES: usize = 400;

/// A finished map and the engine that computed it.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// Its cells and their starts.
    pub plan: &'a Plan,
    /// Records, one per run.
    pub records: &'a dyn Records,
    /// Precision in which the records were computed.
    pub precision: Precision,
    /// Whether lanes on a graphics device computed the records. If not, the reference computed them.
    pub is_lane: bool,
}

named! {
    /// Explanation of a mismatch between a record and its judge.
    pub enum Kind {
        /// A start within the engine's resolution of the cell's start leads to the record's answer, and the reference stays on
        /// that attractor from the record's last state.
        Attractor = "other_attractor",
        /// The cell lies at a border that rounding can cross. The reference gives the record's answer if parameters and start change within the
        /// engine's resolution; or the lane gives the record's answer in single precision and the reference's answer in double precision, both
        /// without early stops; or the record's status says that the period is below the resolution.
        Border = "border",
        /// One engine gives the other's answer with fewer or more periods; or the motion settles or separates too slowly to be decided within
        /// the budget; or the second judge or the reference is undecided.
        Budget = "budget_too_short",
        /// A cap ended the lane, and ended it again when the lane was repeated.
        Cap = "engine_cap",
        /// No computation explains the difference.
        Unexplained = "unexplained",
    }
}

named! {
    /// The engines that judged the records.
    pub enum Judge {
        /// The event-driven reference without early stops.
        Reference = "reference",
        /// The reference and lanes in f64.
        Lanes = "lanes_f64",
        /// The reference and an adaptive ODE solver with event location.
        Independent = "dop853",
    }
}

/// Agreement of one field over all compared cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// The compared field.
    pub field: Field,
    /// Number of cells in which both sides have the field.
    pub compared: usize,
    /// Number of cells in which the sides agree.
    pub agreeing: usize,
}

/// A cell whose record differs from its judge.
#[derive(Clone, Debug, PartialEq)]
pub struct Mismatch {
    /// The run, as in [`Plan::cell`].
    pub id: u32,
    /// The fields that differ.
    pub differences: Vec<Difference>,
    /// The explanation.
    pub kind: Kind,
}

/// Results of one stratum of the sample.
#[derive(Clone, Debug, PartialEq)]
pub struct StratumResult {
    /// The stratum.
    pub stratum: Stratum,
    /// Number of integrated runs of the map in the stratum.
    pub runs: usize,
    /// Number of runs that were compared.
    pub sampled: usize,
    /// Number of mismatches of each kind, in the order of [`Kind::ALL`].
    pub kinds: [usize; 5],
}

impl StratumResult {
    /// Returns the rate of one kind.
    pub fn rate(&self, kind: Kind) -> Rate {
        Rate::new(self.kinds[kind as usize], self.sampled)
    }

    /// Returns the rate of cells that differ.
    pub fn differing(&self) -> Rate {
        Rate::new(self.kinds.iter().sum(), self.sampled)
    }
}

/// Result of the validation of a sample.
#[derive(Clone, Debug)]
pub struct Validation {
    /// Seed of the sample.
    pub seed: u64,
    /// Number of requested cells.
    pub requested: usize,
    /// Number of runs of the map, one per cell and start.
    pub runs: usize,
    /// Number of runs that were filled from their neighbours. They are not sampled.
    pub filled: usize,
    /// Whether cells have several starts.
    pub has_starts: bool,
    /// The engines that judged the records.
    pub judge: Judge,
    /// Rates by stratum, the uniform one first.
    pub strata: Vec<StratumResult>,
    /// Number of distinct cells that were compared.
    pub replayed: usize,
    /// Number of records that their engine reproduced to the bit, and number of cells that the engine computed again.
    pub again: [usize; 2],
    /// Whether the engine always reproduces a correct record to the bit.
    pub is_exact: bool,
    /// Agreement by field.
    pub agreement: Vec<Agreement>,
    /// Comparison of averages of chaotic motion in the uniform stratum.
    pub chaos: Vec<ChaosTest>,
    /// Further periods of chaotic cells; none if they were not requested.
    pub chaos_ends: Option<ChaosEnds>,
    /// Dependence on the meshing speed in the uniform stratum; none if no cell meshes.
    pub half_mesh: Option<HalfMesh>,
    /// Comparison of lanes' states; none if no lanes ran.
    pub states: Option<StateCheck>,
    /// All cells that differ, by id.
    pub mismatches: Vec<Mismatch>,
    /// Runs of the whole map whose records contain NaN or an unexpected infinity.
    pub not_finite: Vec<u32>,
}

impl Validation {
    /// Returns the noun for what is counted: runs or cells.
    pub fn counted(&self) -> &'static str {
        if self.has_starts { "runs" } else { "cells" }
    }

    /// Counts mismatches of one kind in all strata.
    pub fn of_kind(&self, kind: Kind) -> usize {
        self.mismatches.iter().filter(|mismatch| mismatch.kind == kind).count()
    }

    /// Returns the number and the rate of wrong cells in a stratum: "0 of 200 random cells are wrong (below 1.5 %)".
    pub fn wrong(&self, stratum: &StratumResult) -> String {
        let rate = stratum.rate(Kind::Unexplained);
        let (count, verb) = (rate.count, if rate.count == 1 { "is" } else { "are" });
        if stratum.sampled == stratum.runs && stratum.stratum == Stratum::Uniform {
            let integrated = if self.filled > 0 { "integrated " } else { "" };
            return format!("{count} of all {} {integrated}{} {verb} wrong", stratum.runs, self.counted());
        }
        let cells = stratum.stratum.describe(self.counted());
        format!("{count} of {} {cells} {verb} wrong ({})", rate.among, rate.text())
    }

    /// Describes why the map fails the validation; empty if it passes.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.replayed == 0 {
            faults.push(format!("none of {} {} was compared", self.runs, self.counted()));
        }
        let [same, count] = self.again;
        if self.is_exact && same < count {
            let [other, counted] = [(count - same).to_string(), self.counted().to_owned()];
            faults.push(format!(
                "{other} of {count} {counted} differ from what the same program computes again"
            ));
        }
        if !self.not_finite.is_empty() {
            let (count, runs, counted) = (self.not_finite.len(), self.runs, self.counted());
            faults.push(format!("{count} of {runs} {counted} hold numbers that are not finite"));
        }
        for stratum in &self.strata {
            let rate = stratum.rate(Kind::Unexplained);
            if rate.is_too_many() {
                faults.push(self.wrong(stratum));
            }
        }
        faults.extend(self.chaos.iter().filter(|test| test.fails()).map(|test| {
            let ChaosTest { name, cells, distance, .. } = test;
            format!("{name} of {cells} chaotic cells has a different distribution (distance {distance:.2})")
        }));
        if let Some(states) = self.states.as_ref().filter(|states| states.rate().is_too_many()) {
            let (off, compared) = (states.off.len(), states.compared);
            faults.push(format!("states of {off} of {compared} lanes are wrong after {HORIZON} periods"));
        }
        faults
    }
}

/// Result of one cell.
struct Replayed {
    id: u32,
    /// Whether the engine reproduced the record to the bit. None if it did not compute the cell again.
    again: Option<bool>,
    fields: Vec<Compared>,
    kind: Option<Kind>,
    chaos: Option<chaos::Differences>,
    half_mesh: Option<half_mesh::Changes>,
}

/// Validates a sample. `lanes` are the results of lanes that a device computed again; empty without a device. `report`
/// receives the number of finished cells, which rises by one each time; it may be called from any thread.
pub fn replay(
    subject: &Subject<'_>,
    sample: &Sample,
    lanes: &Lanes,
    report: &(dyn Fn(usize) + Sync),
) -> Validation {
    replay_until(subject, None, false, sample, lanes, report, &NEVER).expect("the flag is never set")
}

/// Like [`replay`], but returns `None` once `halt` is set. In a map of basins, attractors are also compared. With `is_exact` the map fails
/// if its engine does not reproduce a record to the bit.
pub fn replay_until(
    subject: &Subject<'_>,
    basins: Option<&Basins>,
    is_exact: bool,
    sample: &Sample,
    lanes: &Lanes,
    report: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Option<Validation> {
    let judge = judge(subject, lanes);
    let is_halted = || halt.load(Ordering::Relaxed);
    let (done, ids) = (Mutex::new(0), sample.ids());
    let uniform = &sample.draws.iter().find(|draw| draw.stratum == Stratum::Uniform);
    let uniform: &[u32] = uniform.map_or(&[], |draw| &draw.ids);
    let mut replayed: Vec<Replayed> = ids
        .par_iter()
        // The cost of cells varies by a factor of 1,000, so each is a task of its own.
        .with_max_len(1)
        .filter_map(|&id| {
            if is_halted() {
                return None;
            }
            let cell = Cell::new(subject, id, halt).in_basins(basins, id);
            let is_uniform = uniform.binary_search(&id).is_ok();
            let replayed = replay_cell(subject, &cell, id, judge, lanes, is_uniform, is_exact);
            (!is_halted()).then(|| {
                // The lock is held during a report, so that the reported number never decreases.
                let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
                *done += 1;
                report(*done);
                replayed
            })
        })
        .collect();
    let again = again(&mut replayed, is_exact);
    let agreement = Field::all().map(|field| {
        let of_field = || replayed.iter().flat_map(|cell| &cell.fields).filter(move |(f, _)| *f == field);
        let agreeing = of_field().filter(|(_, differs)| differs.is_none()).count();
        Agreement { field, compared: of_field().count(), agreeing }
    });
    // Measured quantities that the scene does not request are not listed.
    let is_listed = |agreement: &Agreement| agreement.compared > 0 || !agreement.field.is_measured();
    let agreement = agreement.filter(is_listed).collect();
    let changes: Vec<half_mesh::Changes> = replayed.iter().filter_map(|cell| cell.half_mesh).collect();
    let chaos: Vec<chaos::Differences> = replayed.iter().filter_map(|cell| cell.chaos).collect();
    let mismatches: Vec<Mismatch> = replayed.into_iter().filter_map(mismatch).collect();
    let has_states = !lanes.states().is_empty();
    let validation = Validation {
        seed: sample.seed,
        requested: sample.requested,
        runs: subject.records.count(),
        filled: subject.records.iter().filter(|record| record.valid & valid::FILLED != 0).count(),
        has_starts: subject.plan.start_count() > 1,
        judge,
        strata: sample.draws.iter().map(|draw| stratum(draw, &mismatches)).collect(),
        replayed: ids.len(),
        again,
        is_exact,
        agreement,
        chaos: chaos::tests(&chaos),
        chaos_ends: None,
        half_mesh: half_mesh::rates(&changes),
        states: has_states.then(|| states::check(subject, lanes.states(), halt)),
        mismatches,
        not_finite: not_finite(subject),
    };
    (!is_halted()).then_some(validation)
}

/// A halt flag that is never set.
static NEVER: AtomicBool = AtomicBool::new(false);

/// Lists runs whose records contain NaN or an unexpected infinity.
fn not_finite(subject: &Subject<'_>) -> Vec<u32> {
    let budget = subject.plan.budget();
    let is_wrong = |record: &Record| finite::not_finite(record, budget).is_some();
    (0..).zip(subject.records.iter()).filter(|(_, record)| is_wrong(record)).map(|(id, _)| id).collect()
}

/// Compares two records of the same cell and lists the fields that differ.
pub fn differences(
    record: &Record,
    judge: &Record,
    precision: Precision,
    forcing_period: f64,
    budget: &Budget,
) -> Vec<Difference> {
    let compared =
        Bars::new(precision, forcing_period, budget).compare(record, &Answer::new(judge.clone(), None));
    compared.into_iter().filter_map(|(_, differs)| differs).collect()
}

fn judge(subject: &Subject<'_>, lanes: &Lanes) -> Judge {
    match (subject.is_lane, lanes.has_double()) {
        (true, _) => Judge::Reference,
        (false, true) => Judge::Lanes,
        (false, false) if cfg!(feature = "independent") => Judge::Independent,
        (false, false) => Judge::Reference,
    }
}

/// Computes a cell with another judge than the reference, if the reference computed the cell or finished it.
#[cfg_attr(not(feature = "independent"), expect(unused_variables, reason = "used by the ODE solver only"))]
fn judged(subject: &Subject<'_>, cell: &Cell<'_>, id: u32, judge: Judge, lanes: &Lanes) -> Option<Record> {
    let is_by_reference = cell.record.valid & valid::BY_REFERENCE != 0;
    if judge == Judge::Reference && !is_by_reference {
        return None;
    }
    #[cfg(feature = "independent")]
    let independent = || {
        let budget = subject.plan.budget();
        let budget = if is_by_reference { lanes::all_periods(budget) } else { *budget };
        independent::record_until(subject.plan, id, subject.records, &budget, cell.halt)
    };
    #[cfg(not(feature = "independent"))]
    let independent = || None;
    match judge {
        Judge::Independent => independent(),
        Judge::Lanes | Judge::Reference => {
            let decided = |record: &&Record| !is_by_reference || classify(record) != Class::Undecided;
            lanes.double(id).filter(decided).cloned().or_else(independent)
        }
    }
}

fn replay_cell(
    subject: &Subject<'_>,
    cell: &Cell<'_>,
    id: u32,
    judge: Judge,
    lanes: &Lanes,
    is_uniform: bool,
    is_exact: bool,
) -> Replayed {
    let own = (!subject.is_lane).then(|| cell.again(subject.plan.needs()));
    let again = own.as_ref().or(lanes.again(id));
    let is_same = again.map(|again| again.to_bytes() == cell.record.to_bytes());
    let truth = cell.truth();
    let mut fields = cell.bars.compare(&cell.record, &truth);
    let differs = |fields: &[Compared]| fields.iter().any(|(_, differs)| differs.is_some());
    let ran = explain::RepeatedLanes { again, whole: lanes.whole(id), double: lanes.double(id) };
    // An engine cannot return such a record, so no explanation is searched for.
    let is_forged = is_exact && is_same == Some(false);
    let mut kind = match is_forged {
        true => Some(Kind::Unexplained),
        false => differs(&fields).then(|| explain::kind(cell, &cell.record, &truth, ran)),
    };
    if kind.is_none()
        && let Some(judged) = judged(subject, cell, id, judge, lanes)
    {
        // A judge whose motion is still approaching the cycle does not know the cycle's multipliers.
        let is_slow = status(&judged) == Status::Slow;
        let judged = if is_slow { compare::without_multipliers(judged) } else { judged };
        // The second judge is compared with the reference in the same way as a lane.
        fields = cell.bars.compare(&cell.record, &Answer::new(judged.clone(), None));
        // If one side is undecided, the sides do not contradict each other.
        let is_undecided = [&judged, &truth.record].iter().any(|side| classify(side) == Class::Undecided);
        kind = differs(&fields).then(|| match is_undecided {
            true => Kind::Budget,
            false => match explain::kind(cell, &judged, &truth, explain::RepeatedLanes::default()) {
                Kind::Unexplained if explain::is_unresolved(cell, &judged, &truth) => Kind::Border,
                kind => kind,
            },
        });
    }
    Replayed {
        id,
        again: is_same,
        fields,
        kind,
        chaos: is_uniform.then(|| chaos::differences(cell)).flatten(),
        half_mesh: is_uniform.then(|| half_mesh::changes(cell, &truth)).flatten(),
    }
}

/// Marks records as unexplained that their engine does not reproduce to the bit. This applies only if the engine must reproduce all
/// records, or reproduces most of them. Returns the number of reproduced records and of repeated cells.
fn again(replayed: &mut [Replayed], is_exact: bool) -> [usize; 2] {
    let count = |same| replayed.iter().filter(|cell| cell.again == Some(same)).count();
    let [same, other] = [count(true), count(false)];
    if is_exact || same > other {
        for cell in replayed {
            let Some(is_same) = cell.again else { continue };
            let values = || (Value::Text("another record".into()), Value::Text("the engine's".into()));
            cell.fields.push(compare::compared(Field::AGAIN, is_same, values));
            if !is_same {
                cell.kind = Some(Kind::Unexplained);
            }
        }
    }
    [same, same + other]
}

fn mismatch(cell: Replayed) -> Option<Mismatch> {
    let differences = cell.fields.into_iter().filter_map(|(_, differs)| differs).collect();
    Some(Mismatch { id: cell.id, differences, kind: cell.kind? })
}

fn stratum(draw: &Draw, mismatches: &[Mismatch]) -> StratumResult {
    let of = |kind| {
        let drawn =
            |mismatch: &&Mismatch| mismatch.kind == kind && draw.ids.binary_search(&mismatch.id).is_ok();
        mismatches.iter().filter(drawn).count()
    };
    StratumResult {
        stratum: draw.stratum,
        runs: draw.runs,
        sampled: draw.ids.len(),
        kinds: Kind::ALL.map(of),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replayed(again: &[bool]) -> Vec<Replayed> {
        let cell = |(id, &again)| Replayed {
            id,
            again: Some(again),
            fields: Vec::new(),
            kind: None,
            chaos: None,
            half_mesh: None,
        };
        (0..).zip(again).map(cell).collect()
    }

    /// Another processor may round differently. Then most records differ, which is not an error.
    #[test]
    fn a_record_that_its_engine_does_not_reproduce_is_unexplained_if_most_are_reproduced() {
        let mut one = replayed(&[true, true, false]);
        assert_eq!(again(&mut one, false), [2, 3]);
        assert_eq!(one[2].kind, Some(Kind::Unexplained));
        assert!(one[..2].iter().all(|cell| cell.kind.is_none()));
        let mut most = replayed(&[true, false, false]);
        assert_eq!(again(&mut most, false), [1, 3]);
        assert!(most.iter().all(|cell| cell.kind.is_none() && cell.fields.is_empty()));
        // The same program on the same processor must not differ.
        assert_eq!(again(&mut most, true), [1, 3]);
        assert!(most[1..].iter().all(|cell| cell.kind == Some(Kind::Unexplained)));
    }
}
