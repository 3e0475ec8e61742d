//! Random parameters from the whole valid space, on every engine.
//!
//! Bounded cells take fewer than 2,000 steps per forcing period. They run for 64 periods in lanes of every precision and on
//! the reference, as in the CPU engine. Each must end in a status with finite numbers. If a lane's class, period, word,
//! symmetry, exponent or averages differ from the reference's, [`rattlemap::validate`] must explain the difference by a
//! computation. Wild cells have parameters of any magnitude and run on the reference only.

mod compare;
mod space;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

pub use compare::Mismatch;

use super::cells::{EngineName, REST, flow_of, run_reference};
use super::lanes::{CHUNK, Lanes, Start};
use super::{Size, Verdict, Watch};
use rattlemap::gpu::{GpuError, LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::Needs;
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap::validate::{Kind, Rate};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Budget, Settings, Status, measure as measure_cell, status_of};

/// Periods of bounded cells. One half is transient.
pub(super) const SETTINGS: Settings =
    Settings { transient_periods: 32, observed_periods: 32, max_period: 16 };

/// Periods of wild cells.
const WILD_PERIODS: u32 = 4;

/// Longest allowed time of a wild cell.
const LONGEST: Duration = Duration::from_secs(120);

/// Number of cells of an engine with one status and class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Count {
    /// `bounded` or `wild`.
    pub kind: &'static str,
    /// The engine.
    pub engine: EngineName,
    /// Name of the status.
    pub status: &'static str,
    /// Name of the class; `None` for wild cells, which are not classified.
    pub class: Option<&'static str>,
    /// Number of cells.
    pub cells: usize,
}

/// Results of all cells.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Numbers of cells by status and class.
    pub counts: Vec<Count>,
    /// Lanes that are undecided or stopped by a cap where the reference decides. They claim nothing.
    pub undecided: usize,
    /// Explanations of a random choice of the lanes that differ from the reference.
    pub mismatches: Vec<Mismatch>,
    /// Number of differing lanes outside this choice.
    pub unexamined: usize,
    /// Number of records and wild states with a number that is not finite.
    pub not_finite: usize,
    /// Longest time of a wild cell.
    pub longest: Duration,
}

/// Computes every cell.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, seed: u64, lanes: &mut Lanes, watch: &dyn Watch) -> Result<Rows, GpuError> {
    let mut cells = space::all_bounded(size.pick(200, 1000, 100_000), seed, watch);
    // Lanes with similar numbers of steps run together.
    cells.sort_by_cached_key(|(pair, _)| space::iterations(pair));
    let mut rows = Rows::default();
    let counter = Counter::new(watch, "cells on the reference", cells.len());
    let judges: Vec<Record> = each(&cells, |cell| counter.count(on_reference(cell)));
    rows.count("bounded", EngineName::Reference, &judges);
    let most = size.pick(20, 60, usize::MAX);
    for precision in lanes.precisions() {
        let records = on_lanes(precision, &cells, lanes, watch)?;
        rows.count("bounded", precision.into(), &records);
        compare::all(precision, &cells, &judges, &records, (seed, most), watch, &mut rows);
    }
    let wild = space::all_wild(size.pick(20, 100, 1000), seed);
    let counter = Counter::new(watch, "wild cells", wild.len());
    rows.count_wild(&each(&wild, |pair| counter.count(run_wild(pair))));
    Ok(rows)
}

/// Computes `of` for each item in parallel. Costs differ a thousandfold, so each task has one item.
fn each<T: Sync, R: Send>(list: &[T], of: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
    list.par_iter().with_max_len(1).map(of).collect()
}

fn on_lanes(
    precision: Precision,
    cells: &[Start],
    lanes: &mut Lanes,
    watch: &dyn Watch,
) -> Result<Vec<Record>, GpuError> {
    let work = match precision {
        Precision::F32 => "lanes in f32",
        Precision::F64 => "lanes in f64",
    };
    let mut records = Vec::with_capacity(cells.len());
    for chunk in cells.chunks(CHUNK) {
        records.extend(lanes.run(precision, chunk, &lane_settings())?);
        watch.progress(work, records.len(), cells.len());
    }
    Ok(records)
}

/// Reports how many items are done.
struct Counter<'w> {
    watch: &'w dyn Watch,
    work: &'static str,
    done: AtomicUsize,
    total: usize,
}

impl Counter<'_> {
    fn new<'w>(watch: &'w dyn Watch, work: &'static str, total: usize) -> Counter<'w> {
        Counter { watch, work, done: AtomicUsize::new(0), total }
    }

    /// Counts one more item and returns its result.
    fn count<R>(&self, result: R) -> R {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.watch.progress(self.work, done, self.total);
        result
    }
}

pub(super) fn budget() -> Budget {
    Budget {
        settings: SETTINGS,
        early_stop: true,
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    }
}

pub(super) fn lane_settings() -> LaneSettings {
    LaneSettings::within(&budget())
}

/// Computes a cell like the CPU engine.
fn on_reference((pair, start): &Start) -> Record {
    let measurement = measure_cell(&flow_of(pair), pair.law(), *start, &budget());
    measured_record(&measurement, &Needs::EVERYTHING)
}

/// Returns the status of a wild cell, whether its state is finite, and its time.
fn run_wild(pair: &GearPair) -> (Status, bool, Duration) {
    let clock = Instant::now();
    let (status, is_finite) = match run_reference(pair, REST, WILD_PERIODS).0 {
        Ok(state) => (Status::Ok, state.iter().all(|x| x.is_finite())),
        Err(stop) => (status_of(stop), true),
    };
    (status, is_finite, clock.elapsed())
}

impl Rows {
    fn count(&mut self, kind: &'static str, engine: EngineName, records: &[Record]) {
        let mut counts = BTreeMap::new();
        for record in records {
            let key = (record.status, classify(record).name());
            counts.entry(key).or_insert((status(record).name(), 0usize)).1 += 1;
        }
        self.counts.extend(counts.into_iter().map(|((_, class), (status, cells))| Count {
            kind,
            engine,
            status,
            class: Some(class),
            cells,
        }));
        self.not_finite += records.iter().filter(|record| !is_finite(record)).count();
    }

    fn count_wild(&mut self, ends: &[(Status, bool, Duration)]) {
        for status in Status::ALL {
            let cells = ends.iter().filter(|end| end.0 == status).count();
            let engine = EngineName::Reference;
            if cells > 0 {
                self.counts.push(Count { kind: "wild", engine, status: status.name(), class: None, cells });
            }
        }
        self.not_finite += ends.iter().filter(|end| !end.1).count();
        self.longest = ends.iter().map(|end| end.2).max().unwrap_or_default();
    }

    /// Returns the number of cells of one kind on one engine.
    pub fn cells(&self, kind: &str, engine: EngineName) -> usize {
        let here = self.counts.iter().filter(|count| count.kind == kind && count.engine == engine);
        here.map(|count| count.cells).sum()
    }

    /// Lists the numbers of these cells by status.
    fn statuses(&self, kind: &str, engine: EngineName) -> String {
        let here = || self.counts.iter().filter(|count| count.kind == kind && count.engine == engine);
        let names = Status::ALL.into_iter().map(Status::name).filter_map(|status| {
            let cells: usize = here().filter(|count| count.status == status).map(|count| count.cells).sum();
            (cells > 0).then(|| format!("{cells} {status}"))
        });
        names.collect::<Vec<_>>().join(", ")
    }

    /// Returns the rate of mismatches without an explanation. If only some of the differing lanes were examined, they stand
    /// for the same fraction of all lanes.
    fn rate(&self) -> Rate {
        let lanes = EngineName::ALL.into_iter().filter(|&engine| engine != EngineName::Reference);
        let lanes: usize = lanes.map(|engine| self.cells("bounded", engine)).sum();
        let examined = self.mismatches.len();
        let all = examined + self.unexamined;
        let among = if self.unexamined == 0 { lanes } else { lanes * examined / all };
        let unexplained = self.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
        Rate::new(unexplained.count(), among)
    }
}

/// Whether all numbers are finite. Only the exponent of a superstable cycle may be minus infinity.
fn is_finite(record: &Record) -> bool {
    let numbers = [record.lyapunov_error, record.impacts_per_period, record.mesh_fraction];
    let superstable = record.lyapunov == f64::NEG_INFINITY && record.period > 0;
    (record.lyapunov.is_finite() || superstable)
        && numbers.iter().chain(&record.strobe).all(|number| number.is_finite())
}

/// Requires that all numbers are finite, that wild cells end in time, and that no more mismatches lack an explanation than
/// validation tolerates.
pub fn judge(rows: &Rows) -> Verdict {
    let bounded = rows.cells("bounded", EngineName::Reference);
    let wild = rows.cells("wild", EngineName::Reference);
    let (examined, rate) = (rows.mismatches.len(), rows.rate());
    let (unexplained, share) = (rate.count, rate.text());
    let ended_in_time = rows.longest < LONGEST && bounded > 0 && wild > 0;
    let holds = rows.not_finite == 0 && !rate.is_too_many() && ended_in_time;
    let ended: Vec<String> = EngineName::ALL
        .into_iter()
        .filter(|&engine| rows.cells("bounded", engine) > 0)
        .map(|engine| format!("{} ({})", engine.name(), rows.statuses("bounded", engine)))
        .collect();
    Verdict {
        holds,
        sentence: format!(
            "{bounded} random cells on every engine, {}; {} lanes are undecided where the reference decides, {} differ, \
             {examined} of them examined, {unexplained} without an explanation ({share}); {wild} wild cells on the \
             reference ({}), the longest in {:.1} s; {} records with a number that is not finite",
            ended.join(", "),
            rows.undecided,
            examined + rows.unexamined,
            rows.statuses("wild", EngineName::Reference),
            rows.longest.as_secs_f64(),
            rows.not_finite
        ),
    }
}
