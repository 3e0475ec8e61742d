//! How right is a finished map? A sample of its cells, judged by what did not make them.
//!
//! What a cell's start reaches is computed by the reference within the plan's whole budget, without early stops. A
//! record that says something else is a mismatch, of one of five kinds ([`Kind`]); each kind but the last rests on a
//! computation. Averages over chaos are compared as distributions over the class ([`ChaosTest`]), and states of many
//! lanes a few periods after their start ([`StateCheck`]). Cells that mesh are computed with half the meshing speed, too
//! ([`HalfMesh`]). What one reads first is a rate per kind with its 95 %
//! interval ([`Rate`]), of cells drawn uniformly.
//!
//! A map of the reference is judged by lanes in f64 as well, or where there are none by an adaptive ODE library
//! with event location (`independent`): whoever reads the result is told by which ([`Judge`]).

mod beside;
mod cell;
mod chaos;
mod compare;
mod explain;
mod finite;
mod half_mesh;
#[cfg(feature = "independent")]
pub mod independent;
mod lanes;
mod rate;
mod sample;
mod states;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;

pub use chaos::ChaosTest;
pub use compare::{Difference, Field, Value};
pub use half_mesh::HalfMesh;
pub use lanes::{Lanes, run_lanes};
pub use rate::{Rate, TOLERATED};
pub use sample::{Draw, Sample, Stratum, sample};
pub use states::{HORIZON, Off, StateCheck};

use crate::findings::attractors::Basins;
use crate::gpu::Precision;
use crate::map::plan::Plan;
use crate::record::classify::classify;
use crate::record::{Record, valid};
use cell::Cell;
use compare::{Answer, Bars, Compared};
use rattlemap_dynamics::orbit::{Budget, Class};

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

/// Why a record is not what its judge says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// The cell's start, moved within the engine's resolution, reaches the record's answer, and the reference stays
    /// on it when it starts from the record's last state.
    Attractor,
    /// The reference says what the record says when parameters and start move within the engine's resolution; or
    /// the lane does say it in single precision, and in double precision what the reference says, both without
    /// early stops; or its period is hidden below the resolution, as it says.
    Border,
    /// One side gives the other's answer with fewer or with more periods; or the motion settles, or separates, too
    /// slowly for either to tell.
    Budget,
    /// A cap ended the lane, and does so again.
    Cap,
    /// No computation gives a reason.
    Unexplained,
}

impl Kind {
    /// Every kind, in the order in which they are told.
    pub const ALL: [Kind; 5] = [Kind::Attractor, Kind::Border, Kind::Budget, Kind::Cap, Kind::Unexplained];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Attractor => "other_attractor",
            Kind::Border => "border",
            Kind::Budget => "budget_too_short",
            Kind::Cap => "engine_cap",
            Kind::Unexplained => "unexplained",
        }
    }
}

/// What judged the records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judge {
    /// The event-driven reference, without early stops: it made none of them, or nothing else is at hand.
    Reference,
    /// That, and lanes in f64.
    Lanes,
    /// That, and an adaptive ODE library with event location.
    Independent,
}

/// Agreement of one field, over all replayed cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// What is compared.
    pub field: Field,
    /// Cells in which both sides have it.
    pub compared: usize,
    /// Cells in which they agree.
    pub agreeing: usize,
}

/// A cell whose record is not what its judge says.
#[derive(Clone, Debug, PartialEq)]
pub struct Mismatch {
    /// The run, as in [`Plan::cell`].
    pub id: u32,
    /// What differs.
    pub differences: Vec<Difference>,
    /// Why.
    pub kind: Kind,
}

/// What the cells of one stratum showed.
#[derive(Clone, Debug, PartialEq)]
pub struct StratumResult {
    /// Which.
    pub stratum: Stratum,
    /// Integrated runs of the map that belong to it.
    pub runs: usize,
    /// Those that were replayed.
    pub sampled: usize,
    /// Mismatches of every kind, in the order of [`Kind::ALL`].
    pub kinds: [usize; 5],
}

impl StratumResult {
    /// The rate of one kind.
    pub fn rate(&self, kind: Kind) -> Rate {
        Rate::new(self.kinds[kind as usize], self.sampled)
    }

    /// The rate of cells that differ.
    pub fn differing(&self) -> Rate {
        Rate::new(self.kinds.iter().sum(), self.sampled)
    }
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
    /// What judged the records.
    pub judge: Judge,
    /// Rates by stratum, the uniform one first.
    pub strata: Vec<StratumResult>,
    /// Cells that were replayed, each once.
    pub replayed: usize,
    /// Those whose record their engine gave again to the bit, among those that it computed again.
    pub again: [usize; 2],
    /// Cells compared, by field.
    pub agreement: Vec<Agreement>,
    /// Averages over chaos, in the uniform stratum.
    pub chaos: Vec<ChaosTest>,
    /// What hangs on the meshing speed, in the uniform stratum; none where no cell of it meshes.
    pub half_mesh: Option<HalfMesh>,
    /// States of lanes; none where no lanes ran.
    pub states: Option<StateCheck>,
    /// Every cell that differs, by id.
    pub mismatches: Vec<Mismatch>,
    /// Runs of the whole map, replayed or not, whose record claims a number and holds none.
    pub not_finite: Vec<u32>,
}

impl Validation {
    /// What is counted.
    pub fn counted(&self) -> &'static str {
        if self.has_starts { "runs" } else { "cells" }
    }

    /// Mismatches of one kind, in all strata.
    pub fn of_kind(&self, kind: Kind) -> usize {
        self.mismatches.iter().filter(|mismatch| mismatch.kind == kind).count()
    }

    /// Why the map is not to be trusted, in words; empty if it is.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.replayed == 0 {
            faults.push(format!("none of {} {} was replayed", self.runs, self.counted()));
        }
        if !self.not_finite.is_empty() {
            let (count, runs, counted) = (self.not_finite.len(), self.runs, self.counted());
            faults.push(format!("{count} of {runs} {counted} hold numbers that are not finite"));
        }
        for stratum in &self.strata {
            let rate = stratum.rate(Kind::Unexplained);
            if rate.is_too_many() {
                let (name, counted) = (stratum.stratum.name(), self.counted());
                faults
                    .push(format!("{} of {} {counted} ({name}) differ, unexplained", rate.count, rate.among));
            }
        }
        faults.extend(self.chaos.iter().filter(|test| test.fails()).map(|test| {
            let ChaosTest { name, cells, distance, .. } = test;
            format!("{name} of {cells} chaotic cells is distributed otherwise (distance {distance:.2})")
        }));
        if let Some(states) = self.states.as_ref().filter(|states| states.rate().is_too_many()) {
            let (off, compared) = (states.off.len(), states.compared);
            faults.push(format!("states of {off} of {compared} lanes are off after {HORIZON} periods"));
        }
        faults
    }
}

/// What one cell showed.
struct Replayed {
    id: u32,
    /// Whether the engine gave the record again to the bit, if it was asked.
    again: Option<bool>,
    fields: Vec<Compared>,
    kind: Option<Kind>,
    chaos: Option<chaos::Differences>,
    half_mesh: Option<half_mesh::Changes>,
}

/// Replays a sample. `lanes` are those that a device ran again, if there is one; `report` is told how many cells are
/// done, from any thread.
pub fn replay(
    subject: &Subject<'_>,
    sample: &Sample,
    lanes: &Lanes,
    report: &(dyn Fn(usize) + Sync),
) -> Validation {
    replay_whole(subject, None, sample, lanes, report, &NEVER)
}

/// [`replay`] until a flag is raised; none if it was by then. In a map of basins a start has to lead to its attractor,
/// too.
pub fn replay_until(
    subject: &Subject<'_>,
    basins: Option<&Basins>,
    sample: &Sample,
    lanes: &Lanes,
    report: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Option<Validation> {
    let validation = replay_whole(subject, basins, sample, lanes, report, halt);
    (!halt.load(Ordering::Relaxed)).then_some(validation)
}

/// A flag that nobody raises.
static NEVER: AtomicBool = AtomicBool::new(false);

/// What comes back once `halt` is raised is of no use.
fn replay_whole(
    subject: &Subject<'_>,
    basins: Option<&Basins>,
    sample: &Sample,
    lanes: &Lanes,
    report: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Validation {
    let judge = judge(subject, lanes);
    let (done, ids) = (AtomicUsize::new(0), sample.ids());
    let uniform = &sample.draws.iter().find(|draw| draw.stratum == Stratum::Uniform);
    let uniform: &[u32] = uniform.map_or(&[], |draw| &draw.ids);
    let mut replayed: Vec<Replayed> = ids
        .par_iter()
        // Cells differ a thousandfold in cost: no task holds more than one.
        .with_max_len(1)
        .filter_map(|&id| {
            let is_halted = || halt.load(Ordering::Relaxed);
            if is_halted() {
                return None;
            }
            let cell = Cell::new(subject, id, halt).in_basins(basins, id);
            let replayed = replay_cell(subject, &cell, id, judge, lanes, uniform.binary_search(&id).is_ok());
            (!is_halted()).then(|| {
                report(done.fetch_add(1, Ordering::Relaxed) + 1);
                replayed
            })
        })
        .collect();
    let again = again(&mut replayed);
    let agreement = Field::ALL.map(|field| {
        let of_field = || replayed.iter().flat_map(|cell| &cell.fields).filter(move |(f, _)| *f == field);
        let agreeing = of_field().filter(|(_, differs)| differs.is_none()).count();
        Agreement { field, compared: of_field().count(), agreeing }
    });
    let changes: Vec<half_mesh::Changes> = replayed.iter().filter_map(|cell| cell.half_mesh).collect();
    let chaos: Vec<chaos::Differences> = replayed.iter().filter_map(|cell| cell.chaos).collect();
    let mismatches: Vec<Mismatch> = replayed.into_iter().filter_map(mismatch).collect();
    let has_states = !lanes.states().is_empty();
    Validation {
        seed: sample.seed,
        runs: subject.records.len(),
        filled: subject.records.iter().filter(|record| record.valid & valid::FILLED != 0).count(),
        has_starts: subject.plan.start_count() > 1,
        judge,
        strata: sample.draws.iter().map(|draw| stratum(draw, &mismatches)).collect(),
        replayed: ids.len(),
        again,
        agreement: agreement.to_vec(),
        chaos: chaos::tests(&chaos),
        half_mesh: half_mesh::told(&changes),
        states: has_states.then(|| states::check(subject, lanes.states(), halt)),
        mismatches,
        not_finite: not_finite(subject),
    }
}

/// Runs whose record claims a number and holds none.
fn not_finite(subject: &Subject<'_>) -> Vec<u32> {
    let budget = subject.plan.budget();
    let is_wrong = |record: &Record| finite::not_finite(record, budget).is_some();
    (0..).zip(subject.records).filter(|(_, record)| is_wrong(record)).map(|(id, _)| id).collect()
}

/// Where a record differs from another of the same cell, without asking why.
pub fn differences(
    record: &Record,
    judge: &Record,
    precision: Precision,
    forcing_period: f64,
    budget: &Budget,
) -> Vec<Difference> {
    let compared = Bars::new(precision, forcing_period, budget).compare(record, &Answer::new(*judge, None));
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

/// What a judge beside the reference says of a cell of the reference's own map.
#[cfg_attr(not(feature = "independent"), expect(unused_variables, reason = "for the ODE library alone"))]
fn judged(subject: &Subject<'_>, cell: &Cell<'_>, id: u32, judge: Judge, lanes: &Lanes) -> Option<Record> {
    match judge {
        Judge::Reference => None,
        Judge::Lanes => lanes.double(id).copied(),
        #[cfg(feature = "independent")]
        Judge::Independent => independent::record_until(subject.plan, id, subject.records, cell.halt),
        #[cfg(not(feature = "independent"))]
        Judge::Independent => None,
    }
}

fn replay_cell(
    subject: &Subject<'_>,
    cell: &Cell<'_>,
    id: u32,
    judge: Judge,
    lanes: &Lanes,
    is_uniform: bool,
) -> Replayed {
    let own = (!subject.is_lane).then(|| cell.again(subject.plan.needs()));
    let again = own.as_ref().or(lanes.again(id));
    let truth = cell.truth();
    let mut fields = cell.bars.compare(cell.record, &truth);
    let differs = |fields: &[Compared]| fields.iter().any(|(_, differs)| differs.is_some());
    let ran = explain::Lanes { again, whole: lanes.whole(id), double: lanes.double(id) };
    let mut kind = differs(&fields).then(|| explain::kind(cell, cell.record, &truth, ran));
    if kind.is_none()
        && let Some(judged) = judged(subject, cell, id, judge, lanes)
    {
        // The same question, asked of the judge: may the reference say what it says, within rounding?
        fields = cell.bars.compare(cell.record, &Answer::new(judged, None));
        kind = differs(&fields).then(|| match classify(&judged) {
            // It contradicts nothing.
            Class::Undecided => Kind::Budget,
            _ => explain::kind(cell, &judged, &truth, explain::Lanes::default()),
        });
    }
    Replayed {
        id,
        again: again.map(|again| bytemuck::bytes_of(again) == bytemuck::bytes_of(cell.record)),
        fields,
        kind,
        chaos: is_uniform.then(|| chaos::differences(cell)).flatten(),
        half_mesh: is_uniform.then(|| half_mesh::changes(cell, &truth)).flatten(),
    }
}

/// Where an engine gives most records again to the bit, those that it does not are not its own. How many it gave, and
/// was asked for.
fn again(replayed: &mut [Replayed]) -> [usize; 2] {
    let count = |same| replayed.iter().filter(|cell| cell.again == Some(same)).count();
    let [same, other] = [count(true), count(false)];
    if same > other {
        for cell in replayed {
            let Some(is_same) = cell.again else { continue };
            let shown = || (Value::Text("another record".into()), Value::Text("the engine's".into()));
            cell.fields.push(compare::compared(Field::Again, is_same, shown));
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

    /// Another processor may round differently: then most records are others, and none is at fault.
    #[test]
    fn a_record_that_is_not_its_engines_is_found_where_most_are() {
        let mut one = replayed(&[true, true, false]);
        assert_eq!(again(&mut one), [2, 3]);
        assert_eq!(one[2].kind, Some(Kind::Unexplained));
        assert!(one[..2].iter().all(|cell| cell.kind.is_none()));
        let mut most = replayed(&[true, false, false]);
        assert_eq!(again(&mut most), [1, 3]);
        assert!(most.iter().all(|cell| cell.kind.is_none() && cell.fields.is_empty()));
    }
}
