//! A plan: a scene as numbered cells. Pure.
//!
//! Cell `id = j * count0 + i` has index `i` on the first axis and `j` on the second. It needs a flow, which depends on
//! everything but the contact law, and a law. Cells that differ only in parameters of the law share their flow. Engines
//! get cells in Morton order, so that the cells of a batch are neighbours and behave alike. The cells of a list are one
//! row, in the order of the list.
//!
//! A cell with several starts has as many runs. Run `k` of the cell `id` has the number `k * cell_count + id`, so the
//! first runs are the map itself.

mod morton;
mod parts;
mod start;

pub(crate) use morton::key as morton_key;
pub(crate) use parts::Parts;

use std::ops::Range;
use std::time::Duration;

use rayon::prelude::*;
use thiserror::Error;

pub(crate) use start::followed;

use crate::map::scene::{Axis, Points, Quantity, Refine, Scene, Start, Steps};
use crate::model_file::{is_unforced, several_gaps};
use crate::record::measures::Group;
use crate::record::{Record, Records, valid};
use rattlemap_dynamics::model::{Form, Law, Model, ModelError, Oscillator, State};
use rattlemap_dynamics::orbit::{Budget, Class};
use start::Starts;

/// Largest number of flows that engines store for all batches: less than 1 GB, unless the motion needs thousands of
/// steps per forcing period.
const MOST_STORED_FLOWS: usize = 8_192;

/// A run of a cell: indices of its flow and its law in the plan, and its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Number of the run: `j * count0 + i`, plus the number of cells for each further start.
    pub id: u32,
    /// Index of the flow, below [`Plan::flow_count`].
    pub flow: u32,
    /// Index of the contact law, below [`Plan::law_count`].
    pub law: u32,
    /// State at phase 0.
    pub start: State,
}

/// Quantities that are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Exponent of motion that is not periodic, as a quantity or for the class.
    pub exponent: bool,
    /// Exponent as a quantity.
    pub lyapunov: bool,
    /// Impacts per forcing period.
    pub impacts: bool,
    /// Fraction of the time spent meshing.
    pub mesh: bool,
    /// Whether a cycle is symmetric.
    pub symmetric: bool,
    /// Word of a cycle.
    pub word: bool,
    /// Pattern of a cycle.
    pub pattern: bool,
    /// Measured quantities, by the bits of their [groups](crate::record::measures::GROUPS).
    pub measures: u32,
    /// Last strobe state as a quantity.
    pub state: bool,
    /// Impacts and meshing of each of several gaps.
    pub gaps: bool,
}

impl Needs {
    /// All quantities of a record.
    pub const EVERYTHING: Needs = Needs {
        exponent: true,
        lyapunov: true,
        impacts: true,
        mesh: true,
        symmetric: true,
        word: true,
        pattern: true,
        measures: u32::MAX,
        state: true,
        gaps: true,
    };

    /// Whether a measured quantity is requested.
    pub fn has(&self, group: &Group) -> bool {
        self.measures & group.bit != 0 || self.gaps && group.bit & (valid::IMPACTS | valid::MESH) != 0
    }

    /// Whether one of these measured quantities is requested.
    pub fn has_any(&self, quantities: &[Quantity]) -> bool {
        quantities.iter().filter_map(|quantity| quantity.group()).any(|group| self.has(group))
    }

    /// Whether the motion must be measured: for all measured quantities but the multiplier and the time of a cycle, which are known for a
    /// cycle, and for the contacts of each of several gaps.
    pub fn measures_motion(&self) -> bool {
        let known = [Quantity::Multiplier, Quantity::CycleTime];
        let known =
            known.iter().filter_map(|quantity| quantity.group()).fold(0, |bits, group| bits | group.bit);
        self.gaps || self.measures & !known != 0
    }
}

/// Error: the model has no motion in a cell.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("at {cell}: {reason}; change the parameters")]
pub struct NoMotion {
    /// Values of the swept parameters.
    pub cell: String,
    /// Why there is no motion.
    pub reason: ModelError,
}

/// Checks that the model has a motion in every cell of a scene with one axis.
///
/// # Errors
/// [`NoMotion`] for the first cell without one.
pub fn check_line(scene: &Scene) -> Result<(), NoMotion> {
    let points = scene.points();
    (0..points.counts()[0]).try_for_each(|cell| checked(points, cell))
}

fn checked(points: &Points, cell: usize) -> Result<(), NoMotion> {
    let verdict = points.model(cell).oscillator();
    verdict.map(|_| ()).map_err(|reason| NoMotion { cell: points.named(cell), reason })
}

/// A scene as numbered cells, flows and laws.
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
    /// Time that numbering and checking the cells took; zero if it was not measured.
    pub planning: Duration,
}

impl Plan {
    /// Plans a map. The scene must have been read for a map, and the caller must have checked its size.
    ///
    /// # Panics
    /// If the scene has neither two axes nor a list, or has more runs than a `u32` can number.
    pub fn new(scene: &Scene) -> Plan {
        assert!(scene.axes().len() == 2 || scene.list().is_some(), "a map has two axes, or a list of cells");
        assert!(u32::try_from(scene.run_count()).is_ok(), "cells are numbered by u32");
        let points = scene.points().clone();
        let mut needs = needs(&scene.outputs().quantities);
        // Maps of basins and of shares need the exponent, because chaos is an attractor, too.
        needs.exponent |= scene.is_basin() || scene.sample().is_some();
        // Attractors of a map of shares have their words as names.
        needs.word |= scene.sample().is_some();
        // An adaptive map must not interpolate between motion with and without contact.
        let has_several_gaps = several_gaps(scene.base()).is_some();
        let has_gaps = has_several_gaps && (needs.impacts || needs.mesh);
        let needs_contact = scene.refine().is_some() && (needs.measures != 0 || has_gaps);
        needs.impacts |= needs_contact;
        needs.mesh |= needs_contact;
        needs.gaps = has_several_gaps && (needs.impacts || needs.mesh);
        if is_unforced(scene.base()) {
            needs.measures |= Quantity::CycleTime.group().map_or(0, |group| group.bit);
        }
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
                confirm_chaos: integration.confirm_chaos,
                exponent: needs.exponent,
                shows_exponent: needs.lyapunov,
                quantities: needs.measures_motion(),
            },
            steps: integration.steps_per_period,
            refine: scene.refine(),
            needs,
            planning: Duration::ZERO,
        }
    }

    /// Checks that the model has a motion in every cell. For a model like the gear pair, only overflow or a derived
    /// parameter outside its range can prevent it.
    ///
    /// # Errors
    /// [`NoMotion`] for the first cell without motion.
    pub fn check(&self) -> Result<(), NoMotion> {
        let first = |parts: &Parts| {
            let each = (0..parts.count() as u32).into_par_iter();
            each.find_map_first(|part| checked(&self.points, parts.cell(part)).err())
        };
        first(&self.flows).or_else(|| first(&self.laws)).map_or(Ok(()), Err)
    }

    /// Returns the two axes; empty for a list.
    pub fn axes(&self) -> &[Axis] {
        self.points.axes()
    }

    /// Whether cells are listed. Listed cells with consecutive numbers need not be similar.
    pub fn is_list(&self) -> bool {
        self.points.list().is_some()
    }

    /// Returns the numbers of cells along the two axes. A list is one row.
    pub fn counts(&self) -> [usize; 2] {
        self.points.counts()
    }

    pub(crate) fn points(&self) -> &Points {
        &self.points
    }

    /// Whether this is a map of basins: at least one axis sweeps a component of the start.
    pub fn is_basin(&self) -> bool {
        !self.is_list() && self.points.sweeps_start()
    }

    /// Returns the number of cells.
    pub fn cell_count(&self) -> usize {
        self.points.counts().iter().product()
    }

    /// Returns the cell ids in the order in which engines get them. Further starts have the same order.
    pub fn order(&self) -> Vec<u32> {
        (0..self.cell_count()).map(|place| self.run_at(place)).collect()
    }

    /// Returns the unit of progress: `cells`, or `runs` if cells have several starts.
    pub fn unit(&self) -> &'static str {
        if self.start_count() > 1 { "runs" } else { "cells" }
    }

    /// Returns the number of starts per cell.
    pub fn start_count(&self) -> usize {
        self.starts.count()
    }

    /// Returns the number of runs: one per cell and start.
    pub fn run_count(&self) -> usize {
        self.cell_count() * self.start_count()
    }

    /// Returns the run at a place of the order: all cells with their first start, then with the next.
    pub fn run_at(&self, place: usize) -> u32 {
        let (nth, place) = (place / self.cell_count(), place % self.cell_count());
        let counts = self.counts();
        let [i, j] = morton::at(place, counts);
        (nth * self.cell_count() + j * counts[0] + i) as u32
    }

    /// Returns the policy of the first start of each cell.
    pub fn policy(&self) -> Start {
        self.starts.policy()
    }

    /// Returns the run from whose last state the run `id` starts, if cells follow their neighbours; none for the first
    /// row, which starts at rest.
    pub fn before(&self, id: u32) -> Option<u32> {
        let [columns, rows] = self.counts();
        let (j, columns) = (self.indices(id)[1], columns as u32);
        match self.policy() {
            Start::Up if j > 0 => Some(id - columns),
            Start::Down if j + 1 < rows => Some(id + columns),
            _ => None,
        }
    }

    /// Whether the last states of runs are needed: as a quantity, to distinguish attractors, or as starts of other cells.
    pub fn reads_strobes(&self) -> bool {
        self.needs.state || self.start_count() > 1 || self.is_basin() || self.policy().follows()
    }

    /// Returns the state of the run `id` at phase 0. If cells follow their neighbours, it is the neighbour's last
    /// strobe state from `records`, or rest if the neighbour failed or has no record yet.
    pub fn start(&self, id: u32, records: &(impl Records + ?Sized)) -> State {
        match self.before(id) {
            Some(before) => followed(records.get(before as usize).as_ref()),
            None => self.own_start(id),
        }
    }

    /// Returns the start of a run that follows no neighbour.
    fn own_start(&self, id: u32) -> State {
        let nth = id as usize / self.cell_count();
        match nth {
            0 => self.points.start(id as usize, self.starts.first()),
            _ => self.starts.random(nth, &self.oscillator(self.flow_of(id))),
        }
    }

    /// Returns how long each cell is integrated.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Whether records can be results of this plan. Periods longer than the longest search show damaged records.
    pub fn admits(&self, batch: &[(u32, Record)]) -> bool {
        let longest = self.budget.settings.max_period.max(1);
        batch.iter().all(|(_, record)| record.period <= longest)
    }

    /// Returns the smallest resolution of the lanes' time grid.
    pub fn steps_per_period(&self) -> Steps {
        self.steps
    }

    /// Returns the settings of an adaptive map; none if every cell is integrated.
    pub fn refine(&self) -> Option<Refine> {
        self.refine
    }

    /// Returns the quantities that are computed.
    pub fn needs(&self) -> &Needs {
        &self.needs
    }

    /// Returns the indices of a run's cell on the two axes.
    pub fn indices(&self, id: u32) -> [usize; 2] {
        self.points.indices(id as usize % self.cell_count())
    }

    /// Returns flow, law and start of the run `id`. The start of a run that follows its neighbour is rest here; the
    /// actual start depends on the neighbour's record ([`Plan::start`]).
    pub fn cell(&self, id: u32) -> Cell {
        let (flow, law) = self.parts(id);
        Cell { id, flow, law, start: self.own_start(id) }
    }

    /// Returns flow and law of the run `id`.
    pub(crate) fn parts(&self, id: u32) -> (u32, u32) {
        (self.flow_of(id), self.laws.of(id as usize % self.cell_count()))
    }

    /// Returns the runs at these places of the order, as [`Plan::cell`] does.
    pub fn cells(&self, places: Range<usize>) -> Vec<Cell> {
        places.map(|place| self.cell(self.run_at(place))).collect()
    }

    fn flow_of(&self, id: u32) -> u32 {
        self.flows.of(id as usize % self.cell_count())
    }

    /// Whether lanes have no code for a part of the model, which the reference has.
    #[cfg(feature = "gpu")]
    pub fn needs_reference(&self) -> bool {
        let flows = 0..self.flow_count() as u32;
        flows
            .into_par_iter()
            .any(|flow| crate::gpu::Features::of(self.form(flow)).needing_reference().is_some())
    }

    /// Returns the number of distinct flows.
    pub fn flow_count(&self) -> usize {
        self.flows.count()
    }

    /// Whether several runs share a flow, and all flows can be stored.
    pub fn stores_flows(&self) -> bool {
        stores_flows(self.flow_count() as u64, self.run_count() as u64)
    }

    /// Returns the number of distinct laws.
    pub fn law_count(&self) -> usize {
        self.laws.count()
    }

    /// Returns the oscillator of flow `index`.
    ///
    /// # Panics
    /// If the model has no oscillator there, which [`Plan::check`] detects.
    pub fn oscillator(&self, index: u32) -> Oscillator {
        match self.points.model(self.flows.cell(index)).oscillator() {
            Ok(oscillator) => oscillator,
            Err(error) => panic!("the plan was not checked: {error}"),
        }
    }

    /// Returns the oscillator of flow `index` in the form that its engine takes.
    ///
    /// # Panics
    /// As [`Plan::oscillator`].
    pub fn form(&self, index: u32) -> Form {
        Form::from(&self.oscillator(index))
    }

    /// Returns the contact law `index`.
    pub fn law(&self, index: u32) -> Law {
        self.points.model(self.laws.cell(index)).law()
    }

    /// Returns the model of the run `id`.
    pub fn model(&self, id: u32) -> Box<dyn Model> {
        self.points.model(id as usize % self.cell_count())
    }
}

/// Whether several runs share a flow, and all flows can be stored.
pub(crate) fn stores_flows(flows: u64, runs: u64) -> bool {
    flows < runs && flows <= MOST_STORED_FLOWS as u64
}

fn needs(quantities: &[Quantity]) -> Needs {
    let has = |quantity| quantities.contains(&quantity);
    Needs {
        // The exponent distinguishes chaos from a cycle that was not found. Lanes compute the multiplier together with it.
        exponent: [Quantity::Lyapunov, Quantity::Class, Quantity::Multiplier].into_iter().any(has),
        lyapunov: has(Quantity::Lyapunov),
        impacts: has(Quantity::Impacts) || has(Quantity::ImpactRate),
        mesh: has(Quantity::Mesh),
        symmetric: has(Quantity::Symmetric),
        word: has(Quantity::Word),
        pattern: has(Quantity::Pattern),
        measures: quantities
            .iter()
            .filter_map(|quantity| quantity.group())
            .fold(0, |bits, group| bits | group.bit),
        state: has(Quantity::State),
        gaps: false,
    }
}

/// Counts the classes, in the order of [`Class::NAMES`].
pub fn count_classes(classes: impl Iterator<Item = Class>) -> [usize; Class::NAMES.len()] {
    let mut counts = [0; Class::NAMES.len()];
    for class in classes {
        counts[class.index()] += 1;
    }
    counts
}

/// Plans a map over two parameters from 0.5 to 1, with further lines of the scene.
#[cfg(test)]
pub(crate) fn test_plan(axes: [(&str, usize); 2], more: &str) -> Plan {
    let [first, second] = axes.map(|(name, count)| {
        format!("[[axis]]\nparameter = '{name}'\nmin = 0.5\nmax = 1.0\ncount = {count}\n")
    });
    let text = format!("{first}{second}{more}");
    Plan::new(&Scene::parse(&text, "s", &[], crate::map::scene::Purpose::Map).unwrap())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_the_flow_and_law_of_its_model() {
        for (first, second, flows, laws) in
            [("e", "omega", 5, 3), ("omega", "e", 3, 5), ("e", "mesh_speed", 1, 15), ("k", "omega", 15, 1)]
        {
            let e = if [first, second].contains(&"e") { "" } else { "[parameters]\ne = 0.5\n" };
            let plan = test_plan([(first, 3), (second, 5)], e);
            assert_eq!((plan.flow_count(), plan.law_count()), (flows, laws), "{first} {second}");
            for id in 0..15 {
                let (cell, model) = (plan.cell(id), plan.model(id));
                let [i, j] = plan.indices(id);
                assert_eq!(model.get(first).unwrap(), plan.axes()[0].value(i));
                assert_eq!(model.get(second).unwrap(), plan.axes()[1].value(j));
                assert_eq!(plan.form(cell.flow), Form::from(&model.oscillator().unwrap()));
                assert_eq!(plan.law(cell.law), model.law());
            }
        }
    }

    #[test]
    fn the_order_is_that_of_the_keys_and_has_every_cell_once() {
        let plan = test_plan([("e", 7), ("omega", 5)], "");
        let keys: Vec<u64> = plan.order().iter().map(|&id| morton_key(plan.indices(id))).collect();
        assert!(keys.is_sorted());
        let mut ids = plan.order();
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..35));
    }
}
