//! The points of a sweep: the values of the swept quantities in each cell.

use std::sync::Arc;

use super::axis::{Axis, Target};
use super::derived::Derived;
use super::list::List;
use crate::text::expression::Expression;
use rattlemap_dynamics::model::{Model, Parameter, State};
use rattlemap_dynamics::number::significant;

/// All cells of a scene, numbered from 0: along the first axis, then along the second; or in the order of the list.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    /// The model in the first cell.
    base: Box<dyn Model>,
    /// One or two axes; empty for a list.
    axes: Vec<Axis>,
    list: Option<Arc<List>>,
    derived: Derived,
}

impl Points {
    /// Builds the points from a model whose fixed parameters are set.
    pub(super) fn new(base: Box<dyn Model>, axes: Vec<Axis>, list: Option<List>, derived: Derived) -> Points {
        let mut points = Points { base, axes, list: list.map(Arc::new), derived };
        points.base = points.model(0);
        points
    }

    pub(crate) fn base(&self) -> &dyn Model {
        &*self.base
    }

    pub(crate) fn axes(&self) -> &[Axis] {
        &self.axes
    }

    pub(crate) fn list(&self) -> Option<&List> {
        self.list.as_deref()
    }

    pub(crate) fn derived(&self) -> &Derived {
        &self.derived
    }

    /// Returns the numbers of cells along the first and the second axis. A list is one row.
    pub(crate) fn counts(&self) -> [usize; 2] {
        match &self.list {
            Some(list) => [list.len(), 1],
            None => [0, 1].map(|i| self.axes.get(i).map_or(1, Axis::count)),
        }
    }

    /// Returns the indices of a cell on the two axes.
    pub(crate) fn indices(&self, cell: usize) -> [usize; 2] {
        let [columns, _] = self.counts();
        [cell % columns, cell / columns]
    }

    /// Returns the model of a cell.
    pub(crate) fn model(&self, cell: usize) -> Box<dyn Model> {
        let mut model = self.base.clone();
        self.assignments(cell).for_each(|(target, value)| target.set(&mut *model, value));
        self.derived.apply(&mut *model);
        model
    }

    /// Returns the model at any values of the two axes.
    pub(crate) fn model_at(&self, values: [f64; 2]) -> Box<dyn Model> {
        let mut model = self.base.clone();
        self.targets().zip(values).for_each(|(target, value)| target.set(&mut *model, value));
        self.derived.apply(&mut *model);
        model
    }

    /// Whether an expression depends on the parameter `index`, directly or through derived parameters.
    pub(crate) fn follows(&self, expression: &Expression, index: usize) -> bool {
        let uses = expression.uses();
        let rules = self.derived.rules().iter().filter(|rule| uses.contains(&rule.index()));
        uses.contains(&index) || rules.into_iter().any(|rule| rule.follows(index))
    }

    /// Returns the start of a cell: `start` with the swept components replaced.
    pub(crate) fn start(&self, cell: usize, mut start: State) -> State {
        self.assignments(cell).for_each(|(target, value)| target.begin(&mut start, value));
        start
    }

    /// Returns the swept quantities of a cell with their values.
    fn assignments(&self, cell: usize) -> impl Iterator<Item = (Target, f64)> {
        self.targets().zip(self.values(cell))
    }

    /// Whether cells differ in their starts.
    pub(crate) fn sweeps_start(&self) -> bool {
        self.targets().any(Target::is_start)
    }

    /// Returns the swept parameters or components of the start.
    pub(crate) fn swept(&self) -> impl Iterator<Item = &Parameter> {
        let listed = self.list.iter().flat_map(|list| list.parameters());
        self.axes.iter().map(Axis::parameter).chain(listed)
    }

    /// Returns the targets of the axes or columns.
    pub(crate) fn targets(&self) -> impl Iterator<Item = Target> {
        self.axes.iter().map(Axis::target).chain(self.list.iter().flat_map(|list| list.targets()))
    }

    /// Returns the values of the swept quantities in a cell.
    pub(crate) fn values(&self, cell: usize) -> Vec<f64> {
        match &self.list {
            Some(list) => list.row(cell).to_vec(),
            None => self.axes.iter().zip(self.indices(cell)).map(|(axis, i)| axis.value(i)).collect(),
        }
    }

    /// Describes a cell by the values of the swept quantities, such as `e = 0.5, omega = 5.6`.
    pub(crate) fn named(&self, cell: usize) -> String {
        let swept = self.swept().zip(self.values(cell));
        let named = swept.map(|(parameter, value)| format!("{} = {}", parameter.name, significant(value)));
        named.collect::<Vec<_>>().join(", ")
    }

    /// Whether `is_shaped` holds for the parameter `index` or for a parameter that is derived from it.
    pub(crate) fn shapes(&self, index: usize, is_shaped: impl Fn(&Parameter) -> bool) -> bool {
        let rules = self.derived.rules().iter();
        is_shaped(&self.base.parameters()[index])
            || rules.filter(|rule| rule.follows(index)).any(|rule| is_shaped(rule.parameter()))
    }
}
