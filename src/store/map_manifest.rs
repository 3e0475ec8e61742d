//! `manifest.json` of a map: what makes its folder again, and what the codes mean.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use crate::findings::attractors::Attractor;
use crate::gpu::AdapterId;
use crate::map::engine::{CardReport, Engine};
use crate::map::plan::count_classes;
use crate::map::scene::{List, Scene, Steps};
use crate::show::cells::{Cells, Source};
use crate::show::names;
use crate::show::parameters::Parameters;
use crate::show::provenance::Provenance;
use crate::show::refinement;
use crate::show::table::cell_columns::ABSENT;
use crate::store::inventory::FileEntry;
use crate::store::manifest::{AxisObject, DerivedObject, Head, ModelObject, StartObject, derived, start};
use crate::store::map::LIST;
use crate::store::record_file::Identity;
use rattlemap_dynamics::orbit::{Class, Status};

/// Who computed a map and in what time.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// The `--set` arguments.
    pub sets: &'a [String],
    /// Who computed it.
    pub made: Provenance<'a>,
    /// The graphics adapter, where one was at work.
    pub adapter: Option<AdapterId>,
    /// What each card did, where several were at work.
    pub cards: Vec<CardReport>,
    /// The host's processor, in words.
    pub processor: &'a str,
    /// Time until the engine was ready.
    pub opening: Duration,
    /// Time spent integrating in this run.
    pub elapsed: Duration,
    /// And in those that it went on from.
    pub elapsed_before: Duration,
    /// Cells of an earlier run that this one went on from.
    pub resumed_cells: usize,
    /// The least and the most free steps that lanes take per forcing period; none where there is no grid.
    pub lane_grid: Option<[u32; 2]>,
    /// Swept parameters that changed nothing that was measured.
    pub without_effect: Vec<String>,
    /// Of what it was merged, if it was.
    pub merged: Option<Merged<'a>>,
}

impl<'a> Run<'a> {
    /// A run of which no more is known, in no time.
    pub fn new(made: Provenance<'a>, sets: &'a [String], processor: &'a str) -> Run<'a> {
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
            merged: None,
        }
    }

    /// The same by an engine that is still there: on which adapters, by which grid.
    #[must_use]
    pub fn on(self, engine: &Engine<'_>) -> Run<'a> {
        let (adapter, cards, lane_grid) = (engine.adapter(), engine.cards(), engine.steps_per_period());
        Run { adapter, cards, lane_grid, ..self }
    }
}

/// Shards of which a map was merged, and what computed their records.
#[derive(Clone, Copy, Debug)]
pub struct Merged<'a> {
    /// How many.
    pub shards: u32,
    /// A hash of the sources that decide what records hold.
    pub sources: &'a str,
    /// What these were compiled for.
    pub target: &'a str,
}

/// It names neither the machine's paths nor its users.
#[derive(Serialize)]
pub(crate) struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    #[serde(flatten)]
    made: MadeObject<'a>,
    /// Of the host.
    processor: &'a str,
    /// A hash of the sources that decide what records hold, and what they were compiled for.
    sources: &'a str,
    target: &'a str,
    /// Of so many it was merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    shards: Option<u32>,
    title: &'a str,
    scene: &'a str,
    set: &'a [String],
    model: ModelObject,
    axes: Vec<AxisObject>,
    /// The list in the place of axes.
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
    /// Cells by the number of attractors that their starts found.
    #[serde(skip_serializing_if = "Option::is_none")]
    attractors: Option<BTreeMap<u8, usize>>,
    /// Attractors of a map of basins, by label.
    #[serde(skip_serializing_if = "Option::is_none")]
    basins: Option<Vec<BasinObject>>,
    periods: u64,
    /// Swept parameters that changed nothing that was measured.
    without_effect: &'a [String],
    codes: Codes,
    /// Of all runs that the map took.
    elapsed_seconds: f64,
    resumed_cells: usize,
    refinement: Option<Value>,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

/// Who computed a map; on graphics adapters on which, one or several.
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
        let Provenance { engine, precision, device } = run.made;
        MadeObject {
            engine,
            precision,
            device,
            adapter: run.adapter.as_ref().map(AdapterObject::from),
            cards: run.cards.iter().map(CardObject::from).collect(),
        }
    }
}

/// Which of a machine's adapters: its number as `rattlemap devices` lists them, and its place on the bus where it has one.
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

/// What one of several cards did: cells of this run alone, and why it was lost if it was.
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

/// An attractor and the size of its basin.
#[derive(Serialize)]
pub(crate) struct BasinObject {
    class: &'static str,
    period: Option<u32>,
    cells: usize,
    share: f64,
}

/// The attractors of a map of basins, in the order of their labels.
pub(crate) fn basins(cells: &Cells<'_>) -> Option<Vec<BasinObject>> {
    let basins = cells.basins()?;
    let total = basins.labels().len() as f64;
    let object = |attractor: &Attractor| BasinObject {
        class: attractor.class.name(),
        period: names::period(attractor.class),
        cells: attractor.cells,
        share: attractor.cells as f64 / total,
    };
    Some(basins.attractors().iter().map(object).collect())
}

/// Which cells there are, where they are listed.
#[derive(Serialize)]
pub(crate) struct ListObject {
    /// The copy in the folder, which has the same values.
    file: &'static str,
    columns: Vec<String>,
    cells: usize,
    /// SHA-256 of names and values.
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

/// Seconds by phase; `integrate` of all runs that the map took, the others of the last. Validation adds its own.
#[derive(Serialize)]
pub(crate) struct TimingsObject {
    pub(crate) open: f64,
    pub(crate) integrate: f64,
    pub(crate) write: f64,
}

#[derive(Serialize)]
pub(crate) struct IntegrationObject {
    /// As the scene asks; null for as many as the motion needs.
    steps_per_period: Option<u32>,
    /// As lanes took them, over all flows; null on the CPU.
    least_steps_used: Option<u32>,
    most_steps_used: Option<u32>,
    transient_periods: u32,
    observed_periods: u32,
    early_stop: bool,
    undecided_periods: u32,
    max_period: u32,
}

/// What small integers in `cells.npy` stand for.
#[derive(Serialize)]
struct Codes {
    class: BTreeMap<&'static str, i8>,
    status: BTreeMap<&'static str, i8>,
    source: BTreeMap<&'static str, i8>,
    symmetric: BTreeMap<&'static str, i8>,
}

/// The manifest of a map that `run` has made.
pub(crate) fn map<'a>(
    cells: &Cells<'a>,
    run: &'a Run<'a>,
    writing: Duration,
    files: &'a [FileEntry],
) -> Manifest<'a> {
    let scene = cells.scene();
    Manifest {
        head: Head::of("map"),
        made: MadeObject::of(run),
        processor: run.processor,
        sources: run.merged.map_or(Identity::own_sources(), |merged| merged.sources),
        target: run.merged.map_or(Identity::own_target(), |merged| merged.target),
        shards: run.merged.map(|merged| merged.shards),
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
        cells: cells.count(),
        classes: Class::NAMES.into_iter().zip(count_classes(cells.classes())).collect(),
        statuses: statuses(cells),
        attractors: cells.attractors().map(tally),
        basins: basins(cells),
        periods: cells.periods(),
        without_effect: &run.without_effect,
        codes: codes(),
        elapsed_seconds: (run.elapsed_before + run.elapsed).as_secs_f64(),
        resumed_cells: run.resumed_cells,
        refinement: cells.refinement().map(refinement::object),
        timings: TimingsObject {
            open: run.opening.as_secs_f64(),
            integrate: (run.elapsed_before + run.elapsed).as_secs_f64(),
            write: writing.as_secs_f64(),
        },
        files,
    }
}

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

pub(crate) fn statuses(cells: &Cells<'_>) -> BTreeMap<&'static str, usize> {
    let mut counts: BTreeMap<_, _> = Status::ALL.iter().map(|s| (s.name(), 0)).collect();
    for status in cells.statuses() {
        *counts.entry(status.name()).or_default() += 1;
    }
    counts
}

pub(crate) fn tally(list: &[u8]) -> BTreeMap<u8, usize> {
    let mut counts = BTreeMap::new();
    list.iter().for_each(|&count| *counts.entry(count).or_default() += 1);
    counts
}

fn codes() -> Codes {
    let numbered = |names: Vec<&'static str>| names.into_iter().zip(0..).collect::<BTreeMap<_, _>>();
    let mut class = numbered(Class::NAMES.to_vec());
    class.insert("absent", ABSENT);
    Codes {
        class,
        status: numbered(Status::ALL.iter().map(|status| status.name()).collect()),
        source: numbered(Source::ALL.map(Source::name).to_vec()),
        symmetric: [("false", 0), ("true", 1), ("absent", ABSENT)].into_iter().collect(),
    }
}
