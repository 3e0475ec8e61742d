//! What has to be computed: a scene as numbered cells. Pure.
//!
//! Cell `id = j * count0 + i` has index `i` on the first axis and `j` on the second. It
//! needs a flow, which depends on everything but the contact law, and a law; cells that
//! differ in parameters of the law alone share their flow. Engines get cells in
//! Morton order: whatever the batch, its cells are neighbours and behave alike. The cells of a list are one row:
//! they have the numbers of their places in it, and come in that order.
//!
//! A cell with several starts is as many runs. Run `k` of the cell `id` has the number
//! `k * cell_count + id`, so that the first runs are the map itself.

mod morton;
mod parts;
mod start;

pub(crate) use morton::key as morton_key;
pub(crate) use parts::Parts;

use std::ops::Range;

use rayon::prelude::*;
use thiserror::Error;

pub(crate) use start::followed;

use crate::map::scene::{Axis, Points, Quantity, Refine, Scene, Start, Steps};
use crate::record::{Record, Records};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, Model, ModelError, Oscillator, State};
use rattlemap_dynamics::orbit::{Budget, Class};
use start::Starts;

/// Most flows that engines keep for all batches: below 1 GB but for motion that needs thousands of steps per forcing
/// period.
const MOST_STORED_FLOWS: usize = 8_192;

/// What a run of a cell is made of: indices of its flow and its law in the plan, and its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// `j * count0 + i`; for further starts of that cell, as many times the number of cells more.
    pub id: u32,
    /// Which flow it moves on, below [`Plan::flow_count`].
    pub flow: u32,
    /// Which contact law it obeys, below [`Plan::law_count`].
    pub law: u32,
    /// The state in which it starts at phase 0.
    pub start: State,
}

/// Which quantities somebody asks for; nothing else is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// An exponent for motion that is not periodic: for its own sake or for the class.
    pub exponent: bool,
    /// The exponent for its own sake.
    pub lyapunov: bool,
    /// Impacts per forcing period.
    pub impacts: bool,
    /// Fraction of the time spent meshing.
    pub mesh: bool,
    /// Whether a cycle is its own mirror image.
    pub symmetric: bool,
    /// The cycle's word.
    pub word: bool,
    /// Its pattern.
    pub pattern: bool,
}

impl Needs {
    /// All that a record can tell.
    pub const EVERYTHING: Needs = Needs {
        exponent: true,
        lyapunov: true,
        impacts: true,
        mesh: true,
        symmetric: true,
        word: true,
        pattern: true,
    };
}

/// A cell in which the model has no motion.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("at {cell}: {reason}; change the parameters")]
pub struct NoMotion {
    /// The axes' values there.
    pub cell: String,
    /// Why there is no motion.
    pub reason: ModelError,
}

/// Looks for cells of a scene with one axis in which the model has no motion.
///
/// # Errors
/// [`NoMotion`] for the first of them.
pub fn check_line(scene: &Scene) -> Result<(), NoMotion> {
    let points = scene.points();
    (0..points.counts()[0]).try_for_each(|cell| checked(points, cell))
}

fn checked(points: &Points, cell: usize) -> Result<(), NoMotion> {
    let verdict = Flow::validate(&*points.model(cell));
    verdict.map(|_| ()).map_err(|reason| NoMotion { cell: points.named(cell), reason })
}

/// A scene as cells, flows and laws.
#[derive(Clone, Debug)]
pub struct Plan {
    points: Points,
    flows: Parts,
    laws: Parts,
    starts: Starts,
    budget: Budget,
    steps: Steps,
    refine: Option<Refine>,
    needs: Needs,
}

impl Plan {
    /// Plans a map. The scene must have been read for a map, and its [`Size`](crate::map::size::Size) accepted.
    ///
    /// # Panics
    /// If the scene has neither two axes nor a list, or more runs than a `u32` numbers: reading a scene for a
    /// map and asking its size rule that out.
    pub fn new(scene: &Scene) -> Plan {
        assert!(scene.axes().len() == 2 || scene.list().is_some(), "a map has two axes, or a list of cells");
        assert!(u32::try_from(scene.run_count()).is_ok(), "cells are numbered by u32");
        let points = scene.points().clone();
        let mut needs = needs(&scene.outputs().quantities);
        // Chaos is an attractor, too.
        needs.exponent |= scene.is_basin();
        let integration = scene.integration();
        Plan {
            flows: Parts::flows(&points),
            laws: Parts::laws(&points),
            points,
            starts: Starts::new(scene.start(), scene.draw()),
            budget: Budget {
                settings: scene.orbit_settings(),
                early_stop: integration.early_stop,
                undecided_periods: integration.undecided_periods,
                exponent: needs.exponent,
                shows_exponent: needs.lyapunov,
            },
            steps: integration.steps_per_period,
            refine: scene.refine(),
            needs,
        }
    }

    /// Looks for cells in which the model has no motion. A model that has one wherever its parameters are
    /// in their ranges, as the gear pair but for overflow, has none, unless a derived parameter leaves its range.
    ///
    /// # Errors
    /// [`NoMotion`] for one of them, before anything is computed.
    pub fn check(&self) -> Result<(), NoMotion> {
        let verdict = |parts: &Parts| {
            let each = (0..parts.count() as u32).into_par_iter();
            each.try_for_each(|part| checked(&self.points, parts.cell(part)))
        };
        verdict(&self.flows)?;
        verdict(&self.laws)
    }

    /// The same cells with at most `periods` forcing periods each, half of them observed: for
    /// trials.
    pub fn shortened(&self, periods: u32) -> Plan {
        let mut plan = self.clone();
        let settings = &mut plan.budget.settings;
        settings.transient_periods = settings.transient_periods.min(periods / 2);
        settings.observed_periods = settings.observed_periods.min(periods / 2);
        settings.max_period = settings.max_period.min(settings.observed_periods / 2);
        plan.budget.undecided_periods = 0;
        plan
    }

    /// The two axes; none where cells are listed.
    pub fn axes(&self) -> &[Axis] {
        self.points.axes()
    }

    /// Whether cells are listed: those of neighbouring numbers are no neighbours then.
    pub fn is_list(&self) -> bool {
        self.points.list().is_some()
    }

    /// Cells along the two axes; a list is one row.
    pub fn counts(&self) -> [usize; 2] {
        self.points.counts()
    }

    pub(crate) fn points(&self) -> &Points {
        &self.points
    }

    /// Whether it is a map of basins: an axis sweeps a component of the start.
    pub fn is_basin(&self) -> bool {
        !self.is_list() && self.points.sweeps_start()
    }

    /// How many cells there are.
    pub fn cell_count(&self) -> usize {
        self.points.counts().iter().product()
    }

    /// Cell ids in the order in which engines get them; for further starts the same again.
    pub fn order(&self) -> Vec<u32> {
        (0..self.cell_count()).map(|place| self.run_at(place)).collect()
    }

    /// What is counted while a map is made: cells, or runs where cells have several starts.
    pub fn unit(&self) -> &'static str {
        if self.start_count() > 1 { "runs" } else { "cells" }
    }

    /// Starts per cell.
    pub fn start_count(&self) -> usize {
        self.starts.count()
    }

    /// How many runs there are: one per cell and start.
    pub fn run_count(&self) -> usize {
        self.cell_count() * self.start_count()
    }

    /// The run at this place of the order: every cell with its first start, then with the next.
    pub fn run_at(&self, place: usize) -> u32 {
        let (nth, place) = (place / self.cell_count(), place % self.cell_count());
        let counts = self.counts();
        let [i, j] = morton::at(place, counts);
        (nth * self.cell_count() + j * counts[0] + i) as u32
    }

    /// How cells start: the first run of each.
    pub fn policy(&self) -> Start {
        self.starts.policy()
    }

    /// The run that the run `id` starts from the last state of, if cells follow their
    /// neighbours; none at the end where following begins.
    pub fn before(&self, id: u32) -> Option<u32> {
        let [columns, rows] = self.counts();
        let (j, columns) = (self.indices(id)[1], columns as u32);
        match self.policy() {
            Start::Up if j > 0 => Some(id - columns),
            Start::Down if j + 1 < rows => Some(id + columns),
            _ => None,
        }
    }

    /// Whether anybody reads the last states of runs that have ended: to tell attractors apart, or to go on from them.
    pub fn reads_strobes(&self) -> bool {
        self.start_count() > 1 || self.is_basin() || self.policy().follows()
    }

    /// The state in which the run `id` starts at phase 0. `records`, by run, are read only
    /// where cells follow their neighbours: there the neighbour's last strobe state, or rest
    /// where the neighbour failed or has no record yet.
    pub fn start(&self, id: u32, records: &(impl Records + ?Sized)) -> State {
        let of = |before: u32| {
            let before = before as usize;
            (before < records.count()).then(|| records.record(before))
        };
        match self.before(id) {
            Some(before) => followed(of(before).as_ref()),
            None => self.own_start(id),
        }
    }

    /// The start of a run that follows no neighbour.
    fn own_start(&self, id: u32) -> State {
        let nth = id as usize / self.cell_count();
        match nth {
            0 => self.points.start(id as usize, self.starts.first()),
            _ => self.starts.drawn(nth, &self.oscillator(self.flow_of(id))),
        }
    }

    /// How long each cell is integrated.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Whether records may be of this plan's runs: periods that nobody searched for come of damage or malice alone.
    pub fn admits(&self, kept: &[(u32, Record)]) -> bool {
        let longest = self.budget.settings.max_period.max(1);
        kept.iter().all(|(_, record)| record.period <= longest)
    }

    /// How fine the grid of the lanes is at least.
    pub fn steps_per_period(&self) -> Steps {
        self.steps
    }

    /// How the map is refined; none if every cell is integrated.
    pub fn refine(&self) -> Option<Refine> {
        self.refine
    }

    /// What is asked for.
    pub fn needs(&self) -> &Needs {
        &self.needs
    }

    /// Indices on the two axes of a run's cell.
    pub fn indices(&self, id: u32) -> [usize; 2] {
        self.points.indices(id as usize % self.cell_count())
    }

    /// What the run `id` is made of. One that follows its neighbour starts at rest here: only
    /// the neighbour's record says where it does ([`Plan::start`]).
    pub fn cell(&self, id: u32) -> Cell {
        let law = self.laws.of(id as usize % self.cell_count());
        Cell { id, flow: self.flow_of(id), law, start: self.own_start(id) }
    }

    /// The runs at these places of the order, each made as [`Plan::cell`] says.
    pub fn cells(&self, places: Range<usize>) -> Vec<Cell> {
        places.map(|place| self.cell(self.run_at(place))).collect()
    }

    fn flow_of(&self, id: u32) -> u32 {
        self.flows.of(id as usize % self.cell_count())
    }

    /// How many distinct flows there are.
    pub fn flow_count(&self) -> usize {
        self.flows.count()
    }

    /// Whether several runs share a flow, and all flows can be kept.
    pub fn stores_flows(&self) -> bool {
        stores_flows(self.flow_count() as u64, self.run_count() as u64)
    }

    /// How many distinct laws there are.
    pub fn law_count(&self) -> usize {
        self.laws.count()
    }

    /// The oscillator of flow `index`.
    ///
    /// # Panics
    /// If the model has none there: [`Plan::check`] tells before.
    pub fn oscillator(&self, index: u32) -> Oscillator {
        match self.points.model(self.flows.cell(index)).oscillator() {
            Ok(oscillator) => oscillator,
            Err(error) => panic!("a plan that was not checked: {error}"),
        }
    }

    /// The contact law `index`.
    pub fn law(&self, index: u32) -> Law {
        self.points.model(self.laws.cell(index)).law()
    }

    /// The model of the run `id`.
    pub fn model(&self, id: u32) -> Box<dyn Model> {
        self.points.model(id as usize % self.cell_count())
    }
}

/// Whether several runs share a flow, and all flows can be kept.
pub(crate) fn stores_flows(flows: u64, runs: u64) -> bool {
    flows < runs && flows <= MOST_STORED_FLOWS as u64
}

fn needs(quantities: &[Quantity]) -> Needs {
    let asked = |quantity| quantities.contains(&quantity);
    Needs {
        // Without it chaos cannot be told from a cycle that was not found.
        exponent: asked(Quantity::Lyapunov) || asked(Quantity::Class),
        lyapunov: asked(Quantity::Lyapunov),
        impacts: asked(Quantity::Impacts),
        mesh: asked(Quantity::Mesh),
        symmetric: asked(Quantity::Symmetric),
        word: asked(Quantity::Word),
        pattern: asked(Quantity::Pattern),
    }
}

/// How many cells are in each class: periodic, chaotic, undecided, failed.
pub fn count_classes(classes: impl Iterator<Item = Class>) -> [usize; 4] {
    let mut counts = [0; 4];
    for class in classes {
        counts[class.index()] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::scene::Purpose;

    fn plan(first: &str, second: &str, counts: [usize; 2]) -> Plan {
        let axis = |name, count| {
            format!("[[axis]]\nparameter = '{name}'\nmin = 0.25\nmax = 0.75\ncount = {count}\n")
        };
        let text = axis(first, counts[0]) + &axis(second, counts[1]);
        let e = if first == "e" || second == "e" { vec![] } else { vec!["e=0.5".to_owned()] };
        Plan::new(&Scene::parse(&text, "s", &e, Purpose::Map).unwrap())
    }

    #[test]
    fn every_cell_has_the_flow_and_law_of_its_model() {
        for (first, second, flows, laws) in
            [("e", "omega", 5, 3), ("omega", "e", 3, 5), ("e", "mesh_speed", 1, 15), ("k", "omega", 15, 1)]
        {
            let plan = plan(first, second, [3, 5]);
            assert_eq!((plan.flow_count(), plan.law_count()), (flows, laws), "{first} {second}");
            for id in 0..15 {
                let (cell, model) = (plan.cell(id), plan.model(id));
                let [i, j] = plan.indices(id);
                assert_eq!(model.get(first).unwrap(), plan.axes()[0].value(i));
                assert_eq!(model.get(second).unwrap(), plan.axes()[1].value(j));
                assert_eq!(plan.oscillator(cell.flow), model.oscillator().unwrap());
                assert_eq!(plan.law(cell.law), model.law());
            }
        }
    }

    #[test]
    fn the_order_is_that_of_the_keys_and_has_every_cell_once() {
        let plan = plan("e", "omega", [7, 5]);
        let keys: Vec<u64> = plan.order().iter().map(|&id| morton_key(plan.indices(id))).collect();
        assert!(keys.is_sorted());
        let mut ids = plan.order();
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..35));
    }
}
