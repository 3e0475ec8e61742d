//! A finished map as rows: the one view that tables, figures and reports are made from.

use crate::findings::attractors::{self, Basins, NONE};
use crate::findings::coexistence;
use crate::map::plan::Plan;
use crate::map::scene::{Continuous, Quantity, Scene};
use crate::map::schedule::Refined;
use crate::record::classify::{classify, status};
use crate::record::{Record, Records, Spelling, valid};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::orbit::{Class, Status};

/// Where a cell's values come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// The cell was integrated.
    Integrated,
    /// It was filled from its neighbours, which agree.
    Filled,
}

/// Every source; its position is its code in tables.
pub(crate) const SOURCES: [Source; 2] = [Source::Integrated, Source::Filled];

/// One row, less word and pattern, which take allocations. What the scene does not ask for, and what the cell does not have, is absent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) indices: [usize; 2],
    pub(crate) class: Option<Class>,
    pub(crate) period: Option<u32>,
    pub(crate) lyapunov: Option<f64>,
    pub(crate) lyapunov_error: Option<f64>,
    pub(crate) impacts_per_period: Option<f64>,
    pub(crate) mesh_fraction: Option<f64>,
    pub(crate) symmetric: Option<bool>,
    pub(crate) status: Status,
    pub(crate) periods_run: u32,
    pub(crate) source: Source,
    /// Attractors that several starts found.
    pub(crate) attractors: Option<u8>,
    /// The one that the start leads to, in a map of basins.
    pub(crate) attractor: Option<u16>,
}

/// What only all records of a map together tell.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Attractors found per cell, by id, where cells have several starts.
    attractors: Option<Vec<u8>>,
    basins: Option<Basins>,
    refined: Option<Refined>,
}

impl Survey {
    /// Surveys a map whose last record has come; `refined` is what became of an adaptive one.
    ///
    /// # Panics
    /// If there are not as many records as runs.
    pub fn of(plan: &Plan, records: &(impl Records + ?Sized), refined: Option<Refined>) -> Survey {
        let filled_from = refined.as_ref().map_or(&[][..], |refined| &refined.filled_from);
        let basins = attractors::basins(plan, records, filled_from);
        Survey { attractors: coexistence::attractors(plan, records), basins, refined }
    }

    /// What became of an adaptive map, and nothing else: for who does not ask for attractors.
    pub fn of_refinement(refined: Option<Refined>) -> Survey {
        Survey { attractors: None, basins: None, refined }
    }

    /// The basins of a map that has them.
    pub fn basins(&self) -> Option<&Basins> {
        self.basins.as_ref()
    }
}

/// A scene, its plan, and one record per run; what is shown of a cell is its first run.
#[derive(Clone, Copy, Debug)]
pub struct Cells<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    records: &'a dyn Records,
    survey: Option<&'a Survey>,
}

impl<'a> Cells<'a> {
    /// A finished map.
    ///
    /// # Panics
    /// If there are not as many records as runs.
    pub fn new(scene: &'a Scene, plan: &'a Plan, records: &'a dyn Records) -> Cells<'a> {
        assert_eq!(plan.run_count(), records.count(), "one record per run");
        Cells { scene, plan, records, survey: None }
    }

    /// The same with what all records together tell.
    #[must_use]
    pub fn surveyed(self, survey: &'a Survey) -> Cells<'a> {
        Cells { survey: Some(survey), ..self }
    }

    /// What became of an adaptive map.
    pub fn refinement(&self) -> Option<&'a Refined> {
        self.survey?.refined.as_ref()
    }

    /// Cells along the two axes; a list is one row.
    pub fn counts(&self) -> [usize; 2] {
        self.plan.counts()
    }

    /// Values of the swept parameters in the cell of the run `id`.
    pub(crate) fn values(&self, id: usize) -> Vec<f64> {
        self.plan.points().values(id % self.plan.cell_count())
    }

    /// Values of the derived parameters there, by name.
    pub(crate) fn derived(&self, id: usize) -> Vec<(&'a str, f64)> {
        let rules = self.plan.points().derived().rules();
        if rules.is_empty() {
            return Vec::new();
        }
        let model = self.plan.model(id as u32);
        rules.iter().map(|rule| (&*rule.parameter().name, model.value(rule.index()))).collect()
    }

    /// The class of every cell, by id.
    pub fn classes(&self) -> impl Iterator<Item = Class> + '_ {
        self.first_runs().map(|record| classify(&record))
    }

    /// The status of every cell, by id.
    pub fn statuses(&self) -> impl Iterator<Item = Status> + '_ {
        self.first_runs().map(|record| status(&record))
    }

    /// Forcing periods integrated, over all runs.
    pub fn periods(&self) -> u64 {
        (0..self.runs()).map(|id| u64::from(self.record(id).periods_run)).sum()
    }

    /// Runs, one per cell and start.
    pub fn runs(&self) -> usize {
        self.records.count()
    }

    fn first_runs(&self) -> impl Iterator<Item = Record> + '_ {
        (0..self.plan.cell_count()).map(|id| self.record(id))
    }

    /// Attractors found per cell, by id, if they were counted.
    pub(crate) fn attractors(&self) -> Option<&'a [u8]> {
        self.survey?.attractors.as_deref()
    }

    /// The basins of a map that has them.
    pub(crate) fn basins(&self) -> Option<&'a Basins> {
        self.survey?.basins.as_ref()
    }

    /// The state in which the run `id` starts.
    pub(crate) fn start(&self, id: usize) -> State {
        self.plan.start(id as u32, self.records)
    }

    /// Whether a run's start is not the scene's own: it is swept, follows a neighbour or was drawn.
    pub(crate) fn has_own_start(&self, id: usize) -> bool {
        self.scene.sweeps_start() || self.plan.policy().follows() || id >= self.plan.cell_count()
    }

    pub(crate) fn scene(&self) -> &'a Scene {
        self.scene
    }

    pub(crate) fn asks(&self, quantity: Quantity) -> bool {
        self.scene.outputs().quantities.contains(&quantity)
    }

    pub(crate) fn record(&self, id: usize) -> Record {
        self.records.record(id)
    }

    /// The word of the cell `id`, if it was asked for and there is one.
    pub(crate) fn word(&self, id: usize) -> Option<Spelling> {
        if self.asks(Quantity::Word) { self.record(id).spelling() } else { None }
    }

    /// The pattern of the cell `id`, likewise.
    pub(crate) fn pattern(&self, id: usize) -> Option<Spelling> {
        if self.asks(Quantity::Pattern) { self.record(id).pattern() } else { None }
    }

    /// The row of the run `id`, less its word.
    pub(crate) fn row(&self, id: usize) -> Row {
        let record = &self.record(id);
        let indices = self.plan.indices(id as u32);
        let class = classify(record);
        let periodic = matches!(class, Class::Periodic { .. });
        let is_filled = record.valid & valid::FILLED != 0;
        let shows = !is_filled
            || self.scene.refine().is_none_or(|refine| refine.continuous == Continuous::Interpolated);
        let asked = |quantity, bit, value: f64| {
            (shows && self.asks(quantity) && record.valid & bit != 0 && value.is_finite()).then_some(value)
        };
        let asks_class = self.asks(Quantity::Class);
        let lyapunov = asked(Quantity::Lyapunov, valid::LYAPUNOV, record.lyapunov);
        Row {
            indices,
            class: asks_class.then_some(class),
            period: (asks_class && periodic).then_some(record.period),
            lyapunov,
            // The exponent of a cycle comes from its multipliers: there is no average. Nor is there one
            // of a filled cell, whose exponent nobody measured.
            lyapunov_error: lyapunov
                .filter(|_| !periodic && !is_filled && record.lyapunov_error.is_finite())
                .map(|_| record.lyapunov_error),
            impacts_per_period: asked(Quantity::Impacts, valid::IMPACTS, record.impacts_per_period),
            mesh_fraction: asked(Quantity::Mesh, valid::MESH, record.mesh_fraction),
            symmetric: (self.asks(Quantity::Symmetric) && record.valid & valid::SYMMETRIC != 0)
                .then_some(record.symmetric != 0),
            status: status(record),
            periods_run: record.periods_run,
            source: if is_filled { Source::Filled } else { Source::Integrated },
            attractors: self.attractors().and_then(|list| list.get(id).copied()),
            attractor: self
                .basins()
                .and_then(|basins| basins.labels().get(id).copied())
                .filter(|&label| label != NONE),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::scene::Purpose;
    use crate::record::RecordStore;
    use crate::show::{layers, words};
    use proptest::prelude::*;
    use rattlemap_dynamics::word::Word;

    const CELLS: usize = 12;

    fn scene(quantities: &[&str]) -> Scene {
        let axis = |name| format!("[[axis]]\nparameter = '{name}'\nmin = 0.2\nmax = 0.8\n");
        let text = format!(
            "{}count = 4\n{}count = 3\n[outputs]\nquantities = {quantities:?}\n",
            axis("e"),
            axis("omega")
        );
        Scene::parse(&text, "s", &[], Purpose::Map).unwrap()
    }

    /// Of any bits, as far as engines set them.
    fn record() -> impl Strategy<Value = Record> {
        let number = || prop_oneof![any::<f64>(), -1.0..1.0f64, Just(f64::NEG_INFINITY), Just(0.0)];
        let numbers = [number(), number(), number(), number()];
        let small = (0u32..65, any::<u32>(), 0u32..12, 0u32..2, 0u32..512);
        let words = ["[1-6]{0,70}", "[1-6]{0,6}"];
        (numbers, small, words).prop_map(|(numbers, small, words)| {
            let [lyapunov, lyapunov_error, impacts_per_period, mesh_fraction] = numbers;
            let (period, periods_run, status, symmetric, bits) = small;
            let mut record = Record { lyapunov, lyapunov_error, ..Record::default() };
            record.set_word(&Word::cyclic(words[0].as_bytes()));
            record.set_pattern(&Word::cyclic(words[1].as_bytes()));
            let seen = Record { impacts_per_period, mesh_fraction, symmetric, ..record };
            Record { period, periods_run, status, valid: bits, ..seen }
        })
    }

    proptest! {
        /// What tables and figures show is the same, however records are kept.
        #[test]
        fn rows_are_the_same_from_a_store(
            quantities in prop::sample::subsequence(
                vec!["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"], 1..=7),
            records in prop::collection::vec(record(), CELLS),
        ) {
            let scene = scene(&quantities);
            let plan = Plan::new(&scene);
            let mut store = RecordStore::new(CELLS, false);
            records.iter().enumerate().for_each(|(id, record)| store.put(id, record));
            let (a, b) = (Cells::new(&scene, &plan, &records), Cells::new(&scene, &plan, &store));
            for id in 0..CELLS {
                // NaN, too, is as it was.
                prop_assert_eq!(format!("{:?}", a.row(id)), format!("{:?}", b.row(id)));
                prop_assert_eq!((a.word(id), a.pattern(id)), (b.word(id), b.pattern(id)));
            }
            prop_assert_eq!(a.periods(), b.periods());
            let shown = |cells: &Cells<'_>| layers::of(cells, &words::read(cells)).into_iter().map(|layer| layer.indices);
            prop_assert!(shown(&a).eq(shown(&b)));
        }
    }
}
