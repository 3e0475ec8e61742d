//! `manifest.json` of a map: everything that its folder can be made from, and the meaning of codes.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use serde_json::{Value, json};

use crate::findings::attractors::Attractor;
use crate::gpu::AdapterId;
use crate::map::engine::{CardReport, Engine};
use crate::map::plan::count_classes;
use crate::map::scene::{List, Scene, Steps};
use crate::map::schedule::{Audit, Deviation, Refined};
use crate::map::shard::Shard;
use crate::show::cells::{Cells, SOURCES};
use crate::show::names;
use crate::show::parameters::Parameters;
use crate::show::table::cell_columns::ABSENT;
use crate::store::file_names::LIST;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{self, Head, joined, without_nulls};
use crate::store::record_file::Identity;
use rattlemap_dynamics::orbit::Status;

/// The engine that computed a map.
#[derive(Clone, Copy, Debug)]
pub struct Made<'a> {
    /// Name of the engine.
    pub engine: &'a str,
    /// Name of the precision.
    pub precision: &'a str,
    /// Description of the device.
    pub device: &'a str,
}

/// Everything about the computation of a map that is not in its records.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// The `--set` arguments.
    pub sets: &'a [String],
    /// The engine.
    pub made: Made<'a>,
    /// The graphics adapter, if there was one.
    pub adapter: Option<AdapterId>,
    /// A report for each card, if there were several.
    pub cards: Vec<CardReport>,
    /// Description of the host's processor.
    pub processor: &'a str,
    /// Time until the engine was ready.
    pub opening: Duration,
    /// Time spent integrating in this run.
    pub elapsed: Duration,
    /// Time spent integrating in earlier runs that this one resumed.
    pub elapsed_before: Duration,
    /// Number of records of earlier runs.
    pub resumed_cells: usize,
    /// The smallest and the largest number of free steps that lanes take per forcing period; none on the CPU.
    pub lane_grid: Option<[u32; 2]>,
    /// Swept parameters without effect on any measured quantity.
    pub without_effect: Vec<String>,
    /// The shards from which the map was merged.
    pub shards: Option<ShardOrigin<'a>>,
}

impl<'a> Run<'a> {
    /// Returns a run with these properties; its times are zero.
    pub fn new(made: Made<'a>, sets: &'a [String], processor: &'a str) -> Run<'a> {
        Run {
            sets,
            made,
            adapter: None,
            cards: Vec::new(),
            processor,
            opening: Duration::ZERO,
            elapsed: Duration::ZERO,
            elapsed_before: Duration::ZERO,
            resumed_cells: 0,
            lane_grid: None,
            without_effect: Vec::new(),
            shards: None,
        }
    }

    /// Adds the adapters and the grid of an engine.
    #[must_use]
    pub fn on(self, engine: &Engine<'_>) -> Run<'a> {
        let (adapter, cards, lane_grid) = (engine.adapter(), engine.cards(), engine.steps_per_period());
        Run { adapter, cards, lane_grid, ..self }
    }
}

/// The shards from which a map was merged, and the program that computed them.
#[derive(Clone, Copy, Debug)]
pub struct ShardOrigin<'a> {
    /// Number of shards.
    pub count: u32,
    /// Hash of the sources that decide the contents of records.
    pub sources: &'a str,
    /// Target of the compilation.
    pub target: &'a str,
}

/// Returns the manifest of a map. It contains neither paths nor user names.
pub(crate) fn map(cells: &Cells<'_>, run: &Run<'_>, writing: Duration, files: &[FileEntry]) -> Value {
    let scene = cells.scene();
    let quantities: Vec<String> =
        scene.outputs().quantities.iter().map(|q| format!("{q:?}").to_lowercase()).collect();
    joined([
        run_and_scene("map", None, run, scene),
        json!({ "parameters": Parameters::of_scene(scene) }),
        without_nulls(json!({ "derived": manifest::derived(scene) })),
        json!({
            "start": manifest::start(scene),
            "integration": integration(scene, run.lane_grid),
            "quantities": quantities,
            "cells": cells.counts().iter().product::<usize>(),
        }),
        counts(cells),
        json!({
            "periods": cells.periods(),
            "without_effect": run.without_effect,
            "codes": codes(),
            "elapsed_seconds": (run.elapsed_before + run.elapsed).as_secs_f64(),
            "resumed_cells": run.resumed_cells,
            "refinement": cells.refinement().map(RefinementObject::from),
            "timings": timings(run, writing),
            "files": files,
        }),
    ])
}

/// Returns the first fields of the manifest of a map or of a shard: program, engine and scene.
pub(crate) fn run_and_scene(
    command: &'static str,
    shard: Option<Shard>,
    run: &Run<'_>,
    scene: &Scene,
) -> Value {
    joined([
        json!(Head::of(command)),
        without_nulls(json!({ "shard": shard })),
        made(run),
        json!({
            "processor": run.processor,
            "sources": run.shards.map_or(Identity::own_sources(), |shards| shards.sources),
            "target": run.shards.map_or(Identity::own_target(), |shards| shards.target),
        }),
        without_nulls(json!({ "shards": run.shards.map(|shards| shards.count) })),
        json!({
            "title": scene.title(),
            "scene": scene.text(),
            "set": run.sets,
            "model": manifest::model(scene.base()),
            "axes": scene.axes().iter().map(manifest::axis).collect::<Vec<_>>(),
        }),
        without_nulls(json!({ "list": scene.list().map(list) })),
    ])
}

/// Describes the engine and its graphics adapters.
pub(crate) fn made(run: &Run<'_>) -> Value {
    let Made { engine, precision, device } = run.made;
    let adapter = run.adapter.as_ref();
    let cards: Vec<Value> = run.cards.iter().map(card).collect();
    joined([
        json!({ "engine": engine, "precision": precision, "device": device }),
        without_nulls(json!({
            "adapter": adapter.map(|AdapterId { number, pci, .. }| json!({ "number": number, "pci": pci })),
            "cards": (!cards.is_empty()).then_some(cards),
        })),
    ])
}

/// Describes one of several cards: its number in `rattlemap devices`, the cells that it computed in this run, and why it
/// was lost.
fn card(CardReport { adapter: AdapterId { number, name, pci }, cells, lost }: &CardReport) -> Value {
    json!({ "number": number, "name": name, "pci": pci, "cells": cells, "lost": lost })
}

/// Describes the list of cells of a map without axes; `hash` is the SHA-256 of names and values.
fn list(list: &List) -> Value {
    json!({
        "file": LIST,
        "columns": list.parameters().map(|parameter| parameter.name.to_string()).collect::<Vec<_>>(),
        "cells": list.len(),
        "hash": list.hash(),
    })
}

/// Describes the settings of the integration. The numbers of steps are null on the CPU.
pub(crate) fn integration(scene: &Scene, lane_grid: Option<[u32; 2]>) -> Value {
    let settings = scene.integration();
    json!({
        "steps_per_period": match settings.steps_per_period {
            Steps::Auto => None,
            Steps::PerPeriod(steps) => Some(steps),
        },
        "least_steps_used": lane_grid.map(|[least, _]| least),
        "most_steps_used": lane_grid.map(|[_, most]| most),
        "transient_periods": settings.transient_periods,
        "observed_periods": settings.observed_periods,
        "early_stop": settings.early_stop,
        "undecided_periods": settings.undecided_periods,
        "max_period": settings.max_period,
    })
}

/// Seconds that each phase took. `integrate` is the sum over all resumed runs; the others are those of the last run.
pub(crate) fn timings(run: &Run<'_>, writing: Duration) -> Value {
    json!({
        "open": run.opening.as_secs_f64(),
        "integrate": (run.elapsed_before + run.elapsed).as_secs_f64(),
        "write": writing.as_secs_f64(),
    })
}

/// Counts the cells by class, status and number of attractors, and describes the basins.
pub(crate) fn counts(cells: &Cells<'_>) -> Value {
    let classes = names::CLASSES.into_iter().zip(count_classes(cells.classes()));
    let mut statuses: BTreeMap<_, usize> = Status::ALL.iter().map(|&s| (names::status(s), 0)).collect();
    for status in cells.statuses() {
        *statuses.entry(names::status(status)).or_default() += 1;
    }
    let attractors = cells.attractors().map(|list| {
        let mut counts = BTreeMap::<u8, usize>::new();
        list.iter().for_each(|&count| *counts.entry(count).or_default() += 1);
        counts
    });
    joined([
        json!({ "classes": classes.collect::<BTreeMap<_, _>>(), "statuses": statuses }),
        without_nulls(json!({ "attractors": attractors, "basins": basins(cells) })),
    ])
}

/// Describes the attractors of a map of basins, in the order of their labels.
fn basins(cells: &Cells<'_>) -> Option<Vec<Value>> {
    let basins = cells.basins()?;
    let total = basins.labels().len() as f64;
    let describe = |attractor: &Attractor| {
        json!({
            "class": names::class(attractor.class),
            "period": names::period(attractor.class),
            "cells": attractor.cells,
            "share": attractor.cells as f64 / total,
        })
    };
    Some(basins.attractors().iter().map(describe).collect())
}

/// Meaning of the small integers in `cells.npy`.
fn codes() -> Value {
    let numbered = |names: Vec<&'static str>| names.into_iter().zip(0..).collect::<BTreeMap<_, i8>>();
    let mut class = numbered(names::CLASSES.to_vec());
    class.insert("absent", ABSENT);
    json!({
        "class": class,
        "status": numbered(Status::ALL.iter().map(|&status| names::status(status)).collect()),
        "source": numbered(SOURCES.iter().map(|&source| names::source(source)).collect()),
        "symmetric": BTreeMap::from([("false", 0), ("true", 1), ("absent", ABSENT)]),
    })
}
/// An adaptive map: how much was integrated, and how good the rest is.
#[derive(Serialize)]
pub(crate) struct RefinementObject {
    integrated: usize,
    filled: usize,
    rounds: usize,
    audits: Vec<AuditObject>,
}

/// `rate` is the fraction of filled cells that integration shows to be wrong, `interval` its
/// 95 % interval (Wilson); `words` of the sampled cells had been filled with a word, of which
/// `wrong_words` were not theirs; `patterns` and `wrong_patterns` are the same of patterns.
#[derive(Serialize)]
struct AuditObject {
    filled: usize,
    sampled: usize,
    wrong: usize,
    rate: f64,
    interval: [f64; 2],
    words: usize,
    wrong_words: usize,
    patterns: usize,
    wrong_patterns: usize,
    errors: ErrorsObject,
}

/// Absolute differences between what the sampled cells had been filled with and what integration shows; null
/// where filled cells show no such quantity.
#[derive(Serialize)]
struct ErrorsObject {
    lyapunov: Option<DeviationObject>,
    impacts_per_period: Option<DeviationObject>,
    mesh_fraction: Option<DeviationObject>,
}

/// `empty` cells have a value but were filled with none, and are not `compared`.
#[derive(Serialize)]
struct DeviationObject {
    compared: usize,
    empty: usize,
    median: f64,
    p95: f64,
    worst: f64,
    #[serde(flatten)]
    off_by_one: Option<OffByOneObject>,
}

/// Cells whose counts differ by 1 or more.
#[derive(Serialize)]
struct OffByOneObject {
    off_by_one: usize,
    off_by_one_rate: f64,
    off_by_one_interval: [f64; 2],
}

impl DeviationObject {
    fn of(deviation: Deviation) -> DeviationObject {
        let Deviation { compared, empty, median, p95, worst, .. } = deviation;
        DeviationObject { compared, empty, median, p95, worst, off_by_one: None }
    }

    fn of_counts(deviation: Deviation) -> DeviationObject {
        let off_by_one = OffByOneObject {
            off_by_one: deviation.off_by_one,
            off_by_one_rate: deviation.off_by_one_rate(),
            off_by_one_interval: deviation.off_by_one_interval(),
        };
        DeviationObject { off_by_one: Some(off_by_one), ..DeviationObject::of(deviation) }
    }
}

impl From<&Refined> for RefinementObject {
    fn from(refined: &Refined) -> Self {
        let audit = |audit: &Audit| AuditObject {
            filled: audit.filled,
            sampled: audit.sampled,
            wrong: audit.wrong,
            rate: audit.rate(),
            interval: audit.interval(),
            words: audit.words,
            wrong_words: audit.wrong_words,
            patterns: audit.patterns,
            wrong_patterns: audit.wrong_patterns,
            errors: ErrorsObject {
                lyapunov: audit.errors.lyapunov.map(DeviationObject::of),
                impacts_per_period: audit.errors.impacts.map(DeviationObject::of_counts),
                mesh_fraction: audit.errors.mesh.map(DeviationObject::of),
            },
        };
        let Refined { integrated, filled, rounds, ref audits, .. } = *refined;
        RefinementObject { integrated, filled, rounds, audits: audits.iter().map(audit).collect() }
    }
}
