//! Random parameters over the whole valid space, on every engine.
//!
//! Bounded cells take fewer than 2,000 steps per forcing period and run for 64 of them on lanes in
//! every precision and on the reference as the CPU engine runs it: each must end in a named
//! status with finite numbers, and where a lane's class, period, word, symmetry, exponent or
//! averages are not the reference's, [`rattlemap::validate`] must find out why by a computation. Wild
//! cells, of any magnitude at all, run on the reference alone.

mod compare;
mod space;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

pub use compare::Mismatch;

use super::cells::{EngineName, flow_of};
use super::lanes::{CHUNK, Lanes, Start};
use super::{Part, Size, Verdict, Watch};
use rattlemap::gpu::{GpuError, LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::Needs;
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap::validate::{Kind, Rate};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Budget, Measurement, Settings, Status, measure as measure_cell, status_of};
use rattlemap_dynamics::reference::Trajectory;

/// Periods of bounded cells: half of them transient.
pub(super) const SETTINGS: Settings =
    Settings { transient_periods: 32, observed_periods: 32, max_period: 16 };

/// Periods of wild cells.
const WILD_PERIODS: u32 = 4;

/// A cell that takes longer than this hangs.
const HANGS: Duration = Duration::from_secs(120);

/// How many cells of an engine ended in one status and class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Count {
    /// `bounded` or `wild`.
    pub kind: &'static str,
    /// Who computed them.
    pub engine: EngineName,
    /// A status's name.
    pub status: &'static str,
    /// A class's name; none for wild cells, which are not classified.
    pub class: Option<&'static str>,
    /// Cells.
    pub cells: usize,
}

/// What came of all cells.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// How cells ended.
    pub counts: Vec<Count>,
    /// Lanes that decide nothing, or that a cap ended, where the reference decides: they claim nothing.
    pub silent: usize,
    /// Lanes that say something else than the reference, as far as they were examined: a
    /// random choice of them.
    pub mismatches: Vec<Mismatch>,
    /// Those that were not examined.
    pub left: usize,
    /// Records that hold a number that is not finite, by engine, and wild states.
    pub not_finite: usize,
    /// The longest that one wild cell took.
    pub longest: Duration,
}

/// Runs every cell.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, seed: u64, lanes: &mut Lanes, watch: &dyn Watch) -> Result<Rows, GpuError> {
    let mut cells = space::all_bounded(size.pick(200, 1000, 100_000), seed, watch);
    // Lanes that take as many steps run side by side.
    cells.sort_by_cached_key(|(pair, _)| space::iterations(pair));
    let mut rows = Rows::default();
    let told = Told::new(watch, "cells on the reference", cells.len());
    let truth = each(&cells, |cell| told.count(on_reference(cell)));
    let records: Vec<Record> =
        truth.iter().map(|measured| measured_record(measured, &Needs::EVERYTHING)).collect();
    rows.count("bounded", EngineName::Reference, &records);
    let most = size.pick(20, 60, usize::MAX);
    for precision in lanes.precisions() {
        let records = on_lanes(precision, &cells, lanes, watch)?;
        rows.count("bounded", precision.into(), &records);
        let compared = compare::all(precision, &cells, &truth, &records, (seed, most), watch);
        rows.silent += compared.silent;
        rows.left += compared.left;
        rows.mismatches.extend(compared.mismatches);
    }
    let wild = space::all_wild(size.pick(20, 100, 1000), seed);
    let told = Told::new(watch, "wild cells", wild.len());
    rows.count_wild(&each(&wild, |pair| told.count(on_reference_for_a_while(pair))));
    Ok(rows)
}

/// What `of` says of every one. They differ a thousandfold in cost: no task holds more than one.
fn each<T: Sync, R: Send>(list: &[T], of: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
    list.par_iter().with_max_len(1).map(of).collect()
}

fn on_lanes(
    precision: Precision,
    cells: &[Start],
    lanes: &mut Lanes,
    watch: &dyn Watch,
) -> Result<Vec<Record>, GpuError> {
    let told = match precision {
        Precision::F32 => "lanes in f32",
        Precision::F64 => "lanes in f64",
    };
    let mut records = Vec::with_capacity(cells.len());
    for chunk in cells.chunks(CHUNK) {
        records.extend(lanes.run(precision, chunk, &lane_settings())?);
        watch.progress(told, records.len(), cells.len());
    }
    Ok(records)
}

/// Counts what is done.
struct Told<'w> {
    watch: &'w dyn Watch,
    work: &'static str,
    done: AtomicUsize,
    total: usize,
}

impl Told<'_> {
    fn new<'w>(watch: &'w dyn Watch, work: &'static str, total: usize) -> Told<'w> {
        Told { watch, work, done: AtomicUsize::new(0), total }
    }

    /// One more is done, and this is what came of it.
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
        exponent: true,
        shows_exponent: true,
    }
}

pub(super) fn lane_settings() -> LaneSettings {
    LaneSettings::within(&budget())
}

/// As the CPU engine does it.
fn on_reference((pair, start): &Start) -> Measurement {
    measure_cell(&flow_of(pair), pair.law(), *start, &budget())
}

/// How a wild cell ends, whether its state is finite, and how long it took.
fn on_reference_for_a_while(pair: &GearPair) -> (Status, bool, Duration) {
    let clock = Instant::now();
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), [0.0; 4]);
    let ended = (0..WILD_PERIODS).try_for_each(|_| trajectory.advance_period(&mut ()));
    let status = ended.map_or_else(status_of, |()| Status::Ok);
    let is_finite = status != Status::Ok || trajectory.state().iter().all(|x| x.is_finite());
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

    /// Cells of one kind on one engine.
    pub fn cells(&self, kind: &str, engine: EngineName) -> usize {
        let here = self.counts.iter().filter(|count| count.kind == kind && count.engine == engine);
        here.map(|count| count.cells).sum()
    }

    /// How many of them ended in which status.
    fn statuses(&self, kind: &str, engine: EngineName) -> String {
        let here = || self.counts.iter().filter(|count| count.kind == kind && count.engine == engine);
        let names = Status::ALL.into_iter().map(Status::name).filter_map(|status| {
            let cells: usize = here().filter(|count| count.status == status).map(|count| count.cells).sum();
            (cells > 0).then(|| format!("{cells} {status}"))
        });
        names.collect::<Vec<_>>().join(", ")
    }

    /// Mismatches that no computation explains.
    pub fn unexplained(&self) -> usize {
        self.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained).count()
    }

    /// Their rate: of those that say something else a choice was examined, which stands for as large a share of all
    /// lanes.
    fn rate(&self) -> Rate {
        let lanes = EngineName::ALL.into_iter().filter(|&engine| engine != EngineName::Reference);
        let lanes: usize = lanes.map(|engine| self.cells("bounded", engine)).sum();
        let examined = self.mismatches.len();
        let among = if self.left == 0 { lanes } else { lanes * examined / (examined + self.left) };
        Rate::new(self.unexplained(), among)
    }
}

/// A superstable cycle has the exponent minus infinity; nothing else is not finite.
fn is_finite(record: &Record) -> bool {
    let numbers = [record.lyapunov_error, record.impacts_per_period, record.mesh_fraction];
    let superstable = record.lyapunov == f64::NEG_INFINITY && record.period > 0;
    (record.lyapunov.is_finite() || superstable)
        && numbers.iter().chain(&record.strobe).all(|number| number.is_finite())
}

/// No hang, nothing that is not finite, and no more mismatches without an explanation than validation tolerates.
pub fn judge(rows: &Rows) -> Verdict {
    let bounded = rows.cells("bounded", EngineName::Reference);
    let wild = rows.cells("wild", EngineName::Reference);
    let (examined, rate) = (rows.mismatches.len(), rows.rate());
    let (unexplained, share) = (rate.count, rate.text());
    let ran = rows.longest < HANGS && bounded > 0 && wild > 0;
    let holds = rows.not_finite == 0 && !rate.is_too_many() && ran;
    let ended: Vec<String> = EngineName::ALL
        .into_iter()
        .filter(|&engine| rows.cells("bounded", engine) > 0)
        .map(|engine| format!("{} ({})", engine.name(), rows.statuses("bounded", engine)))
        .collect();
    Verdict {
        part: Part::Fuzz.name(),
        holds,
        sentence: format!(
            "{bounded} random cells on every engine, {}; {} lanes decide nothing where the reference does, {} say \
             something else, {examined} of them examined, {unexplained} without an explanation ({share}); {wild} wild cells on \
             the reference ({}), the longest in {:.1} s; {} records with a number that is not finite",
            ended.join(", "),
            rows.silent,
            examined + rows.left,
            rows.statuses("wild", EngineName::Reference),
            rows.longest.as_secs_f64(),
            rows.not_finite
        ),
    }
}
