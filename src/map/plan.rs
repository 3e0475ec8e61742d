//! What has to be computed: a scene as numbered cells. Pure.
//!
//! Cell `id = j * count0 + i` has index `i` on the first axis and `j` on the second. It
//! needs a flow, which depends on everything but the contact law, and a law; cells that
//! differ in parameters of the law alone share their flow. Engines get cells in
//! Morton order: whatever the batch, its cells are neighbours and behave alike.
//!
//! A cell with several starts is as many runs. Run `k` of the cell `id` has the number
//! `k * cell_count + id`, so that the first runs are the map itself.

mod morton;
mod start;

pub(crate) use morton::key as morton_key;

use std::ops::Range;

use rayon::prelude::*;
use thiserror::Error;

pub(crate) use start::followed;

use crate::map::scene::{Axis, Quantity, Refine, Scene, Start, Steps};
use crate::record::Record;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, Model, ModelError, Oscillator, State};
use rattlemap_dynamics::orbit::{Budget, Class};
use start::Starts;

/// Most flows that engines keep for all batches: below 1 GB but for motion that needs thousands of steps per forcing
/// period.
const KEPT_FLOWS: usize = 8_192;

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

/// What a cell is made of.
#[derive(Clone, Copy)]
enum Part {
    Flow,
    Law,
}

/// A scene as cells, flows and laws.
#[derive(Clone, Debug)]
pub struct Plan {
    base: Box<dyn Model>,
    axes: [Axis; 2],
    starts: Starts,
    budget: Budget,
    steps: Steps,
    refine: Option<Refine>,
    needs: Needs,
    order: Vec<u32>,
}

impl Plan {
    /// Plans a map. The scene must have been read for a map, and its [`Size`](crate::map::size::Size) accepted.
    ///
    /// # Panics
    /// If the scene has not two axes, or more runs than a `u32` numbers: reading a scene for a
    /// map and asking its size rule that out.
    pub fn new(scene: &Scene) -> Plan {
        let [first, second] = scene.axes() else { panic!("a map has two axes") };
        assert!(u32::try_from(scene.run_count()).is_ok(), "cells are numbered by u32");
        let needs = needs(&scene.outputs().quantities);
        let integration = scene.integration();
        Plan {
            base: scene.base().boxed(),
            axes: [first.clone(), second.clone()],
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
            order: morton::order(first.count(), second.count()),
        }
    }

    /// Looks for cells in which the model has no motion. A model that has one wherever its parameters are
    /// in their ranges, as the gear pair but for overflow, has none.
    ///
    /// # Errors
    /// [`NoMotion`] for one of them, before anything is computed.
    pub fn check(&self) -> Result<(), NoMotion> {
        let flows = (0..self.flow_count() as u32).into_par_iter();
        flows.try_for_each(|flow| self.verdict(Part::Flow, flow))?;
        (0..self.law_count() as u32).into_par_iter().try_for_each(|law| self.verdict(Part::Law, law))
    }

    fn verdict(&self, part: Part, index: u32) -> Result<(), NoMotion> {
        let model = self.part_model(part, index);
        Flow::validate(&*model).map(|_| ()).map_err(|reason| {
            let value = |axis: &Axis| {
                let name = &*axis.parameter().name;
                format!("{name} = {:?}", model.get(name).unwrap_or(f64::NAN))
            };
            NoMotion { cell: self.axes.each_ref().map(value).join(", "), reason }
        })
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

    /// The two axes.
    pub fn axes(&self) -> &[Axis; 2] {
        &self.axes
    }

    /// How many cells there are.
    pub fn cell_count(&self) -> usize {
        self.order.len()
    }

    /// Cell ids in the order in which engines get them; for further starts the same again.
    pub fn order(&self) -> &[u32] {
        &self.order
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
        (nth * self.cell_count()) as u32 + self.order[place]
    }

    /// How cells start: the first run of each.
    pub fn policy(&self) -> Start {
        self.starts.policy()
    }

    /// The run that the run `id` starts from the last state of, if cells follow their
    /// neighbours; none at the end where following begins.
    pub fn before(&self, id: u32) -> Option<u32> {
        let (j, columns) = (self.indices(id)[1], self.axes[0].count() as u32);
        match self.policy() {
            Start::Up if j > 0 => Some(id - columns),
            Start::Down if j + 1 < self.axes[1].count() => Some(id + columns),
            _ => None,
        }
    }

    /// The state in which the run `id` starts at phase 0. `records`, by run, are read only
    /// where cells follow their neighbours: there the neighbour's last strobe state, or rest
    /// where the neighbour failed or has no record yet.
    pub fn start(&self, id: u32, records: &[Record]) -> State {
        match self.before(id) {
            Some(before) => followed(records.get(before as usize)),
            None => self.own_start(id),
        }
    }

    /// The start of a run that follows no neighbour.
    fn own_start(&self, id: u32) -> State {
        let nth = id as usize / self.cell_count();
        match nth {
            0 => self.starts.first(),
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
        let (cell, count) = (id as usize % self.cell_count(), self.axes[0].count());
        [cell % count, cell / count]
    }

    /// What the run `id` is made of. One that follows its neighbour starts at rest here: only
    /// the neighbour's record says where it does ([`Plan::start`]).
    pub fn cell(&self, id: u32) -> Cell {
        Cell { id, flow: self.flow_of(id), law: self.part(id, Part::Law), start: self.own_start(id) }
    }

    /// The runs at these places of the order, each made as [`Plan::cell`] says.
    pub fn cells(&self, places: Range<usize>) -> Vec<Cell> {
        places.map(|place| self.cell(self.run_at(place))).collect()
    }

    fn flow_of(&self, id: u32) -> u32 {
        self.part(id, Part::Flow)
    }

    /// Which axes a part of a cell depends on.
    fn shaping(&self, part: Part) -> [bool; 2] {
        self.axes.each_ref().map(|axis| match part {
            Part::Flow => axis.parameter().shapes.oscillator(),
            Part::Law => axis.parameter().shapes.law(),
        })
    }

    /// The index among laws, or among flows, of a run's cell.
    fn part(&self, id: u32, part: Part) -> u32 {
        let [i, j] = self.indices(id);
        match self.shaping(part) {
            [true, true] => id % self.cell_count() as u32,
            [true, false] => i as u32,
            [false, true] => j as u32,
            [false, false] => 0,
        }
    }

    /// How many distinct flows there are.
    pub fn flow_count(&self) -> usize {
        self.count(Part::Flow)
    }

    /// Whether several runs share a flow, and all flows can be kept.
    pub fn keeps_flows(&self) -> bool {
        keeps_flows(self.flow_count() as u64, self.run_count() as u64)
    }

    /// How many distinct laws there are.
    pub fn law_count(&self) -> usize {
        self.count(Part::Law)
    }

    fn count(&self, part: Part) -> usize {
        let counts = self.axes.iter().zip(self.shaping(part));
        counts.map(|(axis, shapes)| if shapes { axis.count() } else { 1 }).product()
    }

    /// The oscillator of flow `index`.
    ///
    /// # Panics
    /// If the model has none there: [`Plan::check`] tells before.
    pub fn oscillator(&self, index: u32) -> Oscillator {
        match self.part_model(Part::Flow, index).oscillator() {
            Ok(oscillator) => oscillator,
            Err(error) => panic!("a plan that was not checked: {error}"),
        }
    }

    /// The contact law `index`.
    pub fn law(&self, index: u32) -> Law {
        self.part_model(Part::Law, index).law()
    }

    /// The model as far as a part of a cell depends on it.
    fn part_model(&self, part: Part, index: u32) -> Box<dyn Model> {
        self.model_at(self.shaping(part), index)
    }

    /// The base with the axes in `which` set to flat index `index` among them.
    fn model_at(&self, which: [bool; 2], index: u32) -> Box<dyn Model> {
        let mut model = self.base.clone();
        let mut rest = index as usize;
        for (axis, _) in self.axes.iter().zip(which).filter(|(_, chosen)| *chosen) {
            axis.set(&mut *model, rest % axis.count());
            rest /= axis.count();
        }
        model
    }

    /// The model of the run `id`.
    pub fn model(&self, id: u32) -> Box<dyn Model> {
        self.model_at([true; 2], id % self.cell_count() as u32)
    }
}

/// Whether several runs share a flow, and all flows can be kept.
pub(crate) fn keeps_flows(flows: u64, runs: u64) -> bool {
    flows < runs && flows <= KEPT_FLOWS as u64
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
        let mut ids = plan.order().to_vec();
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..35));
    }
}
