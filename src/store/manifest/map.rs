//! `manifest.json` of a map: everything that its folder can be made from, and the meaning of codes.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use crate::findings::attractors::Attractor;
use crate::gpu::AdapterId;
use crate::map::engine::{Engine, Preparation};
use crate::map::plan::count_classes;
use crate::map::scene::{List, Scene, Steps};
use crate::map::shard::Shard;
use crate::show::cells::{Cells, Finished, Source};
use crate::show::names;
use crate::show::parameters::Parameters;
use crate::show::provenance::Provenance;
use crate::show::refinement;
use crate::show::table::cell_columns::ABSENT;
use crate::store::file_names::LIST;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{self, Head, joined, without_nulls};
use crate::store::record_file::Identity;
use rattlemap_dynamics::orbit::{Class, Status};

/// Everything about the computation of a map that is not in its records.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// The `--set` arguments.
    pub sets: &'a [String],
    /// The engine.
    pub made: Provenance<'a>,
    /// The graphics adapter, if there was one.
    pub adapter: Option<AdapterId>,
    /// Description of the host's processor.
    pub processor: &'a str,
    /// Time that numbering and checking the cells took.
    pub planning: Duration,
    /// Time until the engine was ready.
    pub opening: Duration,
    /// The part of that time after the device was open.
    pub preparation: Preparation,
    /// Time spent integrating in this run.
    pub elapsed: Duration,
    /// Time in which a thread of its own stored records.
    pub storing: Duration,
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
    pub fn new(made: Provenance<'a>, sets: &'a [String], processor: &'a str) -> Run<'a> {
        Run {
            sets,
            made,
            adapter: None,
            processor,
            planning: Duration::ZERO,
            opening: Duration::ZERO,
            preparation: Preparation::default(),
            elapsed: Duration::ZERO,
            storing: Duration::ZERO,
            elapsed_before: Duration::ZERO,
            resumed_cells: 0,
            lane_grid: None,
            without_effect: Vec::new(),
            shards: None,
        }
    }

    /// Adds the adapter and the grid of an engine.
    #[must_use]
    pub fn on(self, engine: &Engine<'_>) -> Run<'a> {
        let (adapter, lane_grid) = (engine.adapter(), engine.steps_per_period());
        Run { adapter, lane_grid, preparation: engine.preparation(), ..self }
    }

    /// Time in which the device was opened.
    pub fn device(&self) -> Duration {
        self.opening.saturating_sub(self.preparation.flows + self.preparation.compile)
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
pub(crate) fn map(cells: &Cells<'_>, run: &Run<'_>, timings: Value, files: &[FileEntry]) -> Value {
    let scene = cells.scene();
    let quantities: Vec<&str> = scene.outputs().quantities.iter().map(|quantity| quantity.name()).collect();
    joined([
        run_and_scene("map", None, run, scene),
        json!({ "parameters": Parameters::of_scene(scene) }),
        without_nulls(json!({ "derived": manifest::derived(scene) })),
        json!({
            "start": manifest::start(scene),
            "integration": integration(scene, run.lane_grid),
            "quantities": quantities,
            "cells": cells.count(),
        }),
        without_nulls(json!({ "measured": manifest::measured(scene) })),
        counts(cells),
        json!({
            "periods": cells.periods(),
            "without_effect": run.without_effect,
            "codes": codes(),
            "elapsed_seconds": (run.elapsed_before + run.elapsed).as_secs_f64(),
            "resumed_cells": run.resumed_cells,
            "refinement": refinement::object(cells),
            "timings": timings,
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
        described_engine(run),
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

/// Describes the engine and its graphics adapter.
pub(crate) fn described_engine(run: &Run<'_>) -> Value {
    let Provenance { engine, precision, device, .. } = run.made;
    let adapter = run.adapter.as_ref();
    joined([
        json!({ "engine": engine, "precision": precision, "device": device }),
        without_nulls(json!({
            "adapter": adapter.map(|AdapterId { number, pci, .. }| json!({ "number": number, "pci": pci })),
        })),
    ])
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
        "confirm_chaos": settings.confirm_chaos,
        "max_period": settings.max_period,
    })
}

/// Seconds that each phase took. `integrate` is the sum over all resumed runs; the others are those of the last run. `records`
/// is the time of the thread that stores records meanwhile. `open` is the sum of `device`, `flows` and `compile`. The `files` are
/// written side by side, within `write`.
pub(crate) fn timings(run: &Run<'_>, writing: Duration, files: BTreeMap<String, Duration>) -> Value {
    let files = files.into_iter().map(|(name, time)| (name, time.as_secs_f64()));
    json!({
        "plan": run.planning.as_secs_f64(),
        "open": run.opening.as_secs_f64(),
        "device": run.device().as_secs_f64(),
        "flows": run.preparation.flows.as_secs_f64(),
        "compile": run.preparation.compile.as_secs_f64(),
        "integrate": (run.elapsed_before + run.elapsed).as_secs_f64(),
        "records": run.storing.as_secs_f64(),
        "write": writing.as_secs_f64(),
        "files": files.collect::<BTreeMap<_, _>>(),
    })
}

/// Counts the cells by class, status, the engine that finished them and number of attractors, and describes the basins.
pub(crate) fn counts(cells: &Cells<'_>) -> Value {
    let classes = Class::NAMES.into_iter().zip(count_classes(cells.classes()));
    let mut statuses: BTreeMap<_, usize> = Status::ALL.iter().map(|status| (status.name(), 0)).collect();
    for status in cells.statuses() {
        *statuses.entry(status.name()).or_default() += 1;
    }
    let attractors = cells.attractors().map(|list| {
        let mut counts = BTreeMap::<u8, usize>::new();
        list.iter().for_each(|&count| *counts.entry(count).or_default() += 1);
        counts
    });
    let names = Finished::ALL.map(Finished::name);
    let finished = cells.finished().map(|counts| names.into_iter().zip(counts).collect::<BTreeMap<_, _>>());
    joined([
        json!({ "classes": classes.collect::<BTreeMap<_, _>>(), "statuses": statuses }),
        without_nulls(json!({ "finished": finished, "attractors": attractors, "basins": basins(cells) })),
    ])
}

/// Describes the attractors of a map of basins, in the order of their labels.
fn basins(cells: &Cells<'_>) -> Option<Vec<Value>> {
    let basins = cells.basins()?;
    let total = basins.labels().len() as f64;
    let describe = |attractor: &Attractor| {
        json!({
            "class": attractor.class.name(),
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
    let mut class = numbered(Class::NAMES.to_vec());
    class.insert("absent", ABSENT);
    json!({
        "class": class,
        "status": numbered(Status::ALL.iter().map(|status| status.name()).collect()),
        "source": numbered(Source::ALL.map(Source::name).to_vec()),
        "finished": BTreeMap::from([("device", 0), ("reference", 1), ("absent", ABSENT)]),
        "symmetric": BTreeMap::from([("false", 0), ("true", 1), ("absent", ABSENT)]),
    })
}
