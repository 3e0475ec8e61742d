//! A finished map as rows, the input of tables, figures and reports.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::findings::attractors::{self, Basins, NONE};
use crate::findings::coexistence;
use crate::map::plan::Plan;
use crate::map::scene::{Continuous, Quantity, Scene};
use crate::map::schedule::Refined;
use crate::model_file::several_gaps;
use crate::record::classify::{classify, status};
use crate::record::measures::{self, MEASURES};
use crate::record::{Record, Records, valid};
use crate::show::names;
use crate::show::numbers::Number;
use crate::validate::Rate;
use rattlemap_dynamics::model::{Contact, State};
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::{Class, Status};

named! {
    /// Origin of a cell's values.
    pub enum Source {
        /// The cell was integrated.
        Integrated = "integrated",
        /// The cell was filled from its neighbours, which agree.
        Filled = "filled",
    }
}

named! {
    /// The engine that finished a cell of a map of lanes.
    pub enum Finished {
        /// Its lane, on the device.
        Device = "device",
        /// The reference, from a state of the lane.
        Reference = "reference",
    }
}

/// Values of one cell except word and pattern, which need allocations. Values that the scene does not request or the cell does
/// not have are absent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) indices: [usize; 2],
    pub(crate) class: Option<Class>,
    pub(crate) period: Option<u32>,
    pub(crate) lyapunov: Option<f64>,
    pub(crate) lyapunov_error: Option<f64>,
    pub(crate) impacts_per_period: Option<f64>,
    pub(crate) mesh_fraction: Option<f64>,
    /// Measured quantities, by their places in a record.
    pub(crate) measures: [Option<f64>; MEASURES],
    /// Last state at phase 0.
    pub(crate) state: Option<State>,
    pub(crate) symmetric: Option<bool>,
    pub(crate) status: Status,
    pub(crate) periods_run: u32,
    pub(crate) source: Source,
    /// Absent if the cell was filled.
    pub(crate) finished: Option<Finished>,
    /// Number of attractors that several starts reached.
    pub(crate) attractors: Option<u8>,
    /// Label of the attractor that the start leads to, in a map of basins.
    pub(crate) attractor: Option<u16>,
}

impl Finished {
    fn of(record: &Record) -> Finished {
        if record.valid & valid::BY_REFERENCE == 0 { Finished::Device } else { Finished::Reference }
    }
}

/// Results that depend on all records of a map.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Number of attractors per cell, by id, if cells have several starts.
    attractors: Option<Vec<u8>>,
    basins: Option<Basins>,
    refined: Option<Refined>,
}

impl Survey {
    /// Evaluates the records of a finished map. `refined` is the result of an adaptive map.
    ///
    /// # Panics
    /// If the numbers of records and runs differ.
    pub fn of(plan: &Plan, records: &(impl Records + ?Sized), refined: Option<Refined>) -> Survey {
        let filled_from = refined.as_ref().map_or(&[][..], |refined| &refined.filled_from);
        let basins = attractors::basins(plan, records, filled_from);
        Survey { attractors: coexistence::attractors(plan, records), basins, refined }
    }

    /// Returns a survey without attractors, for callers that do not need them.
    pub fn of_refinement(refined: Option<Refined>) -> Survey {
        Survey { attractors: None, basins: None, refined }
    }

    /// Returns the basins, in a map of basins.
    pub fn basins(&self) -> Option<&Basins> {
        self.basins.as_ref()
    }
}

/// A scene, its plan, and one record per run. A cell shows the values of its first run.
#[derive(Clone, Copy, Debug)]
pub struct Cells<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    records: &'a dyn Records,
    survey: Option<&'a Survey>,
    of_lanes: bool,
}

impl<'a> Cells<'a> {
    /// Returns the cells of a finished map.
    ///
    /// # Panics
    /// If the numbers of records and runs differ.
    pub fn new(scene: &'a Scene, plan: &'a Plan, records: &'a dyn Records) -> Cells<'a> {
        assert_eq!(plan.run_count(), records.count(), "one record per run");
        Cells { scene, plan, records, survey: None, of_lanes: false }
    }

    /// Says whether an engine of this name computes lanes. Tables of lanes say which engine finished a cell.
    #[must_use]
    pub fn computed_by(self, engine: &str) -> Cells<'a> {
        Cells { of_lanes: engine == "gpu", ..self }
    }

    /// Whether lanes computed the cells.
    pub(crate) fn are_of_lanes(&self) -> bool {
        self.of_lanes
    }

    /// Adds the results that depend on all records.
    #[must_use]
    pub fn surveyed(self, survey: &'a Survey) -> Cells<'a> {
        Cells { survey: Some(survey), ..self }
    }

    /// Returns the result of an adaptive map.
    pub fn refinement(&self) -> Option<&'a Refined> {
        self.survey?.refined.as_ref()
    }

    /// Returns how often chaos ends, per forcing period, in a map that continues chaotic cells; none if no cell was continued.
    ///
    /// This is the maximum-likelihood rate of an exponential law: the number of ends, divided by the periods in which chaos was
    /// seen after all other periods. Cells that are still chaotic count with their periods.
    pub(crate) fn chaos_ends(&self) -> Option<Rate> {
        let from = self.plan.budget().decided_by();
        let records = (0..self.records.count()).into_par_iter().map(|run| self.records.record(run));
        // Only chaotic cells get more periods.
        let continued = records.filter(|record| record.periods_run > from);
        let (ends, periods) = continued
            .map(|record| {
                let has_ended = !matches!(classify(&record), Class::Chaotic | Class::Failed);
                (usize::from(has_ended), (record.periods_run - from) as usize)
            })
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        (periods > 0).then(|| Rate::new(ends, periods))
    }

    /// Returns the numbers of cells along the two axes. A list is one row.
    pub fn counts(&self) -> [usize; 2] {
        self.plan.counts()
    }

    /// Returns the number of cells.
    pub fn count(&self) -> usize {
        self.plan.cell_count()
    }

    /// Returns a parallel iterator over the ids of all cells.
    pub(crate) fn ids(&self) -> rayon::range::Iter<usize> {
        (0..self.count()).into_par_iter()
    }

    /// Returns the values of the swept parameters in the cell of the run `id`.
    pub(crate) fn values(&self, id: usize) -> Vec<f64> {
        self.plan.points().values(id % self.plan.cell_count())
    }

    /// Returns names and values of the derived parameters in the cell of the run `id`.
    pub(crate) fn derived(&self, id: usize) -> Vec<(&'a str, f64)> {
        let rules = self.plan.points().derived().rules();
        if rules.is_empty() {
            return Vec::new();
        }
        let model = self.plan.model(id as u32);
        rules.iter().map(|rule| (&*rule.parameter().name, model.value(rule.index()))).collect()
    }

    /// Returns the class of every cell, by id.
    pub fn classes(&self) -> impl Iterator<Item = Class> + '_ {
        self.first_runs().map(|record| classify(&record))
    }

    /// Returns the status of every cell, by id.
    pub fn statuses(&self) -> impl Iterator<Item = Status> + '_ {
        self.first_runs().map(|record| status(&record))
    }

    /// Returns how many integrated cells of lanes each engine finished; none if no lanes computed the cells.
    pub fn finished(&self) -> Option<[usize; 2]> {
        if !self.of_lanes {
            return None;
        }
        let mut counts = [0; 2];
        let integrated = self.first_runs().filter(|record| record.valid & valid::FILLED == 0);
        integrated.for_each(|record| counts[Finished::of(&record) as usize] += 1);
        Some(counts)
    }

    /// Returns the number of integrated forcing periods of all runs.
    pub fn periods(&self) -> u64 {
        (0..self.runs()).map(|id| u64::from(self.record(id).periods_run)).sum()
    }

    /// Returns the number of runs, one per cell and start.
    pub fn runs(&self) -> usize {
        self.records.count()
    }

    fn first_runs(&self) -> impl Iterator<Item = Record> + '_ {
        (0..self.count()).map(|id| self.record(id))
    }

    /// Returns the number of attractors per cell, by id, if they were counted.
    pub fn attractors(&self) -> Option<&'a [u8]> {
        self.survey?.attractors.as_deref()
    }

    /// Returns the basins, in a map of basins.
    pub fn basins(&self) -> Option<&'a Basins> {
        self.survey?.basins.as_ref()
    }

    /// Returns the start state of the run `id`.
    pub(crate) fn start(&self, id: usize) -> State {
        self.plan.start(id as u32, self.records)
    }

    /// Whether a run does not start from the scene's own state, because the start is swept, random or a neighbour's attractor.
    pub(crate) fn has_own_start(&self, id: usize) -> bool {
        self.scene.sweeps_start() || self.plan.policy().follows() || id >= self.plan.cell_count()
    }

    /// Returns the scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Whether the scene requests a quantity.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.scene.outputs().quantities.contains(&quantity)
    }

    /// Returns the record of the run `id`.
    pub fn record(&self, id: usize) -> Record {
        self.records.record(id)
    }

    /// Returns the numbers that the scene requests besides exponent, impacts and meshing.
    pub fn numbers(&self) -> Vec<Number> {
        Number::of(self.scene.base(), &self.scene.outputs().quantities)
    }

    /// Returns the gap whose contact the class map shows, and its name; none for a model with one gap. Unless the scene names one, it is
    /// the first one with a wall that has an impact law, else the first.
    pub(crate) fn contact_gap(&self) -> Option<(usize, String)> {
        let names = several_gaps(self.scene.base())?;
        let oscillator = self.plan.model(0).oscillator().ok()?;
        let has_impacts = |gap: &usize| {
            let walls = oscillator.gaps[*gap].walls.iter().flatten();
            walls.into_iter().any(|wall| wall.contact == Contact::Impact)
        };
        let gap = self.scene.contact_gap().or_else(|| (0..names.len()).find(has_impacts)).unwrap_or(0);
        Some((gap, names.get(gap)?.clone()))
    }

    /// Returns the impacts per unit time of the run `id`.
    pub(crate) fn impact_rate(&self, id: usize) -> Option<f64> {
        let record = self.record(id);
        let is_shown = self.shows_averages(&record) && record.valid & valid::IMPACTS != 0;
        if let Some(time) = record.cycle_time() {
            return is_shown.then_some(record.impacts_per_period / time);
        }
        let omega = || self.plan.model(id as u32).oscillator().ok().map(|oscillator| oscillator.omega);
        Some(record.impacts_per_period * is_shown.then(omega)?? / TAU)
    }

    /// Whether the continuous quantities of a record are shown: it was integrated, or filled cells are interpolated.
    fn shows_averages(&self, record: &Record) -> bool {
        let is_filled = record.valid & valid::FILLED != 0;
        !is_filled || self.scene.refine().is_none_or(|refine| refine.continuous == Continuous::Interpolated)
    }

    /// Returns the values of the run `id` except word and pattern.
    pub(crate) fn row(&self, id: usize) -> Row {
        let record = &self.record(id);
        let indices = self.plan.indices(id as u32);
        let class = classify(record);
        let periodic = matches!(class, Class::Periodic { .. });
        let is_filled = record.valid & valid::FILLED != 0;
        let shows = self.shows_averages(record);
        let measured = |quantity, bit, value: f64| {
            (shows && self.has(quantity) && record.valid & bit != 0 && names::is_told(value)).then_some(value)
        };
        let mut measures = [None; MEASURES];
        let needs = self.plan.needs();
        if shows && (needs.measures != 0 || needs.gaps) {
            let all = measures::all().chain(measures::of_gaps());
            all.for_each(|measure| {
                measures[measure.place] = measure.of(record).filter(|value| !value.is_nan())
            });
        }
        let has_state = self.has(Quantity::State) && !status(record).is_failure();
        let has_class = self.has(Quantity::Class);
        let lyapunov = measured(Quantity::Lyapunov, valid::LYAPUNOV, record.lyapunov);
        Row {
            indices,
            class: has_class.then_some(class),
            period: (has_class && periodic).then_some(record.period),
            lyapunov,
            // Only averages have a standard error. The exponent of a cycle is computed from its multipliers, and that of a filled
            // cell is interpolated.
            lyapunov_error: lyapunov
                .filter(|_| !periodic && !is_filled && record.lyapunov_error.is_finite())
                .map(|_| record.lyapunov_error),
            impacts_per_period: measured(Quantity::Impacts, valid::IMPACTS, record.impacts_per_period),
            mesh_fraction: measured(Quantity::Mesh, valid::MESH, record.mesh_fraction),
            measures,
            state: record.state().filter(|_| has_state),
            symmetric: (self.has(Quantity::Symmetric) && record.valid & valid::SYMMETRIC != 0)
                .then_some(record.symmetric != 0),
            status: status(record),
            periods_run: record.periods_run,
            source: if is_filled { Source::Filled } else { Source::Integrated },
            finished: (!is_filled).then(|| Finished::of(record)),
            attractors: self.attractors().and_then(|list| list.get(id).copied()),
            attractor: self
                .basins()
                .and_then(|basins| basins.labels().get(id).copied())
                .filter(|&label| label != NONE),
        }
    }
}
