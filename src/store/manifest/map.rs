//! `manifest.json` of a map: everything that its folder can be made from, and the meaning of codes.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use crate::findings::attractors::Attractor;
use crate::gpu::AdapterId;
use crate::map::engine::{CardReport, Engine};
use crate::map::plan::count_classes;
use crate::map::scene::{List, Scene, Steps};
use crate::map::schedule::{Audit, Deviation, Refined};
use crate::show::cells::{Cells, SOURCES};
use crate::show::names;
use crate::show::parameters::Parameters;
use crate::show::table::cell_columns::ABSENT;
use crate::store::file_names::LIST;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{AxisObject, DerivedObject, Head, ModelObject, StartObject, derived, start};
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

/// The manifest of a map. It contains neither paths nor user names.
#[derive(Serialize)]
pub(crate) struct MapManifest<'a> {
    #[serde(flatten)]
    head: Head,
    #[serde(flatten)]
    made: MadeObject<'a>,
    /// The host's processor.
    processor: &'a str,
    /// Hash of the sources that decide the contents of records, and target of their compilation.
    sources: &'a str,
    target: &'a str,
    /// Number of shards of a merged map.
    #[serde(skip_serializing_if = "Option::is_none")]
    shards: Option<u32>,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    model: ModelObject,
    axes: Vec<AxisObject>,
    /// The list of cells of a map without axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    list: Option<ListObject>,
    parameters: Parameters,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    derived: BTreeMap<String, DerivedObject>,
    start: StartObject,
    integration: IntegrationObject,
    quantities: Vec<String>,
    cells: usize,
    classes: BTreeMap<&'static str, usize>,
    statuses: BTreeMap<&'static str, usize>,
    /// Number of cells by the number of attractors that their starts reach.
    #[serde(skip_serializing_if = "Option::is_none")]
    attractors: Option<BTreeMap<u8, usize>>,
    /// Attractors of a map of basins, by label.
    #[serde(skip_serializing_if = "Option::is_none")]
    basins: Option<Vec<BasinObject>>,
    periods: u64,
    /// Swept parameters without effect on any measured quantity.
    without_effect: &'a [String],
    codes: Codes,
    /// Sum over all runs that were resumed.
    elapsed_seconds: f64,
    resumed_cells: usize,
    refinement: Option<RefinementObject>,
    timings: MapTimings,
    files: &'a [FileEntry],
}

/// The engine that computed a map, and its graphics adapters.
#[derive(Serialize)]
pub(crate) struct MadeObject<'a> {
    engine: &'a str,
    precision: &'a str,
    device: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    adapter: Option<AdapterObject<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    cards: Vec<CardObject<'a>>,
}

impl<'a> MadeObject<'a> {
    pub(crate) fn of(run: &'a Run<'_>) -> MadeObject<'a> {
        let Made { engine, precision, device } = run.made;
        MadeObject {
            engine,
            precision,
            device,
            adapter: run.adapter.as_ref().map(AdapterObject::from),
            cards: run.cards.iter().map(CardObject::from).collect(),
        }
    }
}

/// A graphics adapter: its number in `rattlemap devices` and its address on the PCI bus.
#[derive(Serialize)]
struct AdapterObject<'a> {
    number: usize,
    pci: Option<&'a str>,
}

impl<'a> From<&'a AdapterId> for AdapterObject<'a> {
    fn from(adapter: &'a AdapterId) -> AdapterObject<'a> {
        AdapterObject { number: adapter.number, pci: adapter.pci.as_deref() }
    }
}

/// One of several cards: the number of cells that it computed in this run, and why it was lost.
#[derive(Serialize)]
struct CardObject<'a> {
    number: usize,
    name: &'a str,
    pci: Option<&'a str>,
    cells: usize,
    lost: Option<&'a str>,
}

impl<'a> From<&'a CardReport> for CardObject<'a> {
    fn from(card: &'a CardReport) -> CardObject<'a> {
        let CardReport { adapter, cells, lost } = card;
        let AdapterId { number, name, pci } = adapter;
        let (pci, lost) = (pci.as_deref(), lost.as_deref());
        CardObject { number: *number, name, pci, cells: *cells, lost }
    }
}

/// Records and time of earlier runs, in objects that commands print; zero without such runs.
#[derive(Serialize)]
pub(crate) struct ResumedObject {
    runs: usize,
    seconds: f64,
}

impl ResumedObject {
    pub(crate) fn of(run: &Run<'_>) -> ResumedObject {
        ResumedObject { runs: run.resumed_cells, seconds: run.elapsed_before.as_secs_f64() }
    }
}

/// An attractor and the size of its basin.
#[derive(Serialize)]
pub(crate) struct BasinObject {
    class: &'static str,
    period: Option<u32>,
    cells: usize,
    share: f64,
}

/// Returns the attractors of a map of basins, in the order of their labels.
pub(crate) fn basins(cells: &Cells<'_>) -> Option<Vec<BasinObject>> {
    let basins = cells.basins()?;
    let total = basins.labels().len() as f64;
    let object = |attractor: &Attractor| BasinObject {
        class: names::class(attractor.class),
        period: names::period(attractor.class),
        cells: attractor.cells,
        share: attractor.cells as f64 / total,
    };
    Some(basins.attractors().iter().map(object).collect())
}

/// The list of cells of a map without axes.
#[derive(Serialize)]
pub(crate) struct ListObject {
    /// Name of the copy in the folder.
    file: &'static str,
    columns: Vec<String>,
    cells: usize,
    /// SHA-256 over names and values.
    hash: String,
}

impl From<&List> for ListObject {
    fn from(list: &List) -> ListObject {
        ListObject {
            file: LIST,
            columns: list.parameters().map(|parameter| parameter.name.to_string()).collect(),
            cells: list.len(),
            hash: list.hash().to_owned(),
        }
    }
}

/// Seconds that each phase took. `integrate` is the sum over all resumed runs; `open` and `write` are those of the last run.
/// Validation and repair add their own.
#[derive(Serialize)]
pub(crate) struct MapTimings {
    open: f64,
    integrate: f64,
    write: f64,
}

impl MapTimings {
    pub(crate) fn of(run: &Run<'_>, writing: Duration) -> MapTimings {
        MapTimings {
            open: run.opening.as_secs_f64(),
            integrate: (run.elapsed_before + run.elapsed).as_secs_f64(),
            write: writing.as_secs_f64(),
        }
    }
}

/// Settings of the integration.
#[derive(Serialize)]
pub(crate) struct IntegrationObject {
    /// Number that the scene asks for; null for `auto`.
    steps_per_period: Option<u32>,
    /// Numbers that lanes took, over all flows; null on the CPU.
    least_steps_used: Option<u32>,
    most_steps_used: Option<u32>,
    transient_periods: u32,
    observed_periods: u32,
    early_stop: bool,
    undecided_periods: u32,
    max_period: u32,
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

/// Meaning of the small integers in `cells.npy`.
#[derive(Serialize)]
struct Codes {
    class: BTreeMap<&'static str, i8>,
    status: BTreeMap<&'static str, i8>,
    source: BTreeMap<&'static str, i8>,
    symmetric: BTreeMap<&'static str, i8>,
}

/// Returns the manifest of a map.
pub(crate) fn map<'a>(
    cells: &Cells<'a>,
    run: &'a Run<'a>,
    writing: Duration,
    files: &'a [FileEntry],
) -> MapManifest<'a> {
    let scene = cells.scene();
    MapManifest {
        head: Head::of("map"),
        made: MadeObject::of(run),
        processor: run.processor,
        sources: run.shards.map_or(Identity::own_sources(), |shards| shards.sources),
        target: run.shards.map_or(Identity::own_target(), |shards| shards.target),
        shards: run.shards.map(|shards| shards.count),
        title: scene.title(),
        scene: scene.text(),
        set: run.sets,
        model: ModelObject::of(scene.base()),
        axes: scene.axes().iter().map(AxisObject::from).collect(),
        list: scene.list().map(ListObject::from),
        parameters: Parameters::of_scene(scene),
        derived: derived(scene),
        start: start(scene),
        integration: integration(scene, run.lane_grid),
        quantities: scene.outputs().quantities.iter().map(|q| format!("{q:?}").to_lowercase()).collect(),
        cells: cells.counts().iter().product(),
        classes: names::CLASSES.into_iter().zip(count_classes(cells.classes())).collect(),
        statuses: statuses(cells),
        attractors: cells.attractors().map(attractor_counts),
        basins: basins(cells),
        periods: cells.periods(),
        without_effect: &run.without_effect,
        codes: codes(),
        elapsed_seconds: (run.elapsed_before + run.elapsed).as_secs_f64(),
        resumed_cells: run.resumed_cells,
        refinement: cells.refinement().map(RefinementObject::from),
        timings: MapTimings::of(run, writing),
        files,
    }
}

/// Returns the settings of the integration of a scene.
pub(crate) fn integration(scene: &Scene, lane_grid: Option<[u32; 2]>) -> IntegrationObject {
    let settings = scene.integration();
    IntegrationObject {
        steps_per_period: match settings.steps_per_period {
            Steps::Auto => None,
            Steps::PerPeriod(steps) => Some(steps),
        },
        least_steps_used: lane_grid.map(|[least, _]| least),
        most_steps_used: lane_grid.map(|[_, most]| most),
        transient_periods: settings.transient_periods,
        observed_periods: settings.observed_periods,
        early_stop: settings.early_stop,
        undecided_periods: settings.undecided_periods,
        max_period: settings.max_period,
    }
}

/// Counts the cells by status.
pub(crate) fn statuses(cells: &Cells<'_>) -> BTreeMap<&'static str, usize> {
    let mut counts: BTreeMap<_, _> = Status::ALL.iter().map(|&s| (names::status(s), 0)).collect();
    for status in cells.statuses() {
        *counts.entry(names::status(status)).or_default() += 1;
    }
    counts
}

/// Counts the cells by their number of attractors.
pub(crate) fn attractor_counts(list: &[u8]) -> BTreeMap<u8, usize> {
    let mut counts = BTreeMap::new();
    list.iter().for_each(|&count| *counts.entry(count).or_default() += 1);
    counts
}

fn codes() -> Codes {
    let numbered = |names: Vec<&'static str>| names.into_iter().zip(0..).collect::<BTreeMap<_, _>>();
    let mut class = numbered(names::CLASSES.to_vec());
    class.insert("absent", ABSENT);
    Codes {
        class,
        status: numbered(Status::ALL.iter().map(|&status| names::status(status)).collect()),
        source: numbered(SOURCES.iter().map(|&source| names::source(source)).collect()),
        symmetric: [("false", 0), ("true", 1), ("absent", ABSENT)].into_iter().collect(),
    }
}
