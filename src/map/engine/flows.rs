//! Flows of a plan, solved once if cells share them.

use std::collections::HashSet;
use std::sync::OnceLock;

use crate::map::plan::{Cell, Plan};
use rattlemap_dynamics::motion::Flow;

/// Number of flows above which those without cells under way are dropped. A flow of the gear pair takes 65 kB.
const MANY: usize = 512;

/// The flows of a plan, for use by several threads.
pub(crate) struct Flows<'p> {
    plan: &'p Plan,
    /// Flows, each solved when first needed; empty if they are too many or not shared.
    stored: Vec<OnceLock<Box<Flow>>>,
}

impl<'p> Flows<'p> {
    pub(crate) fn new(plan: &'p Plan) -> Flows<'p> {
        let stored = if plan.stores_flows() { plan.flow_count() } else { 0 };
        Flows { plan, stored: (0..stored).map(|_| OnceLock::new()).collect() }
    }

    /// Drops the flows that none of these cells has, if there are many. Neighbours share flows, so the next cells need few of them.
    pub(crate) fn keep(&mut self, cells: &[Cell]) {
        if self.stored.iter().filter(|flow| flow.get().is_some()).count() > MANY {
            let used: HashSet<u32> = cells.iter().map(|cell| cell.flow).collect();
            for (_, flow) in (0..).zip(&mut self.stored).filter(|(index, _)| !used.contains(index)) {
                flow.take();
            }
        }
    }

    /// Calls `function` with a flow, given by its index in the plan.
    pub(crate) fn with<T>(&self, index: u32, function: impl FnOnce(&Flow) -> T) -> T {
        let solve = || Box::new(Flow::new(self.plan.form(index)));
        match self.stored.get(index as usize) {
            Some(stored) => function(stored.get_or_init(solve)),
            None => function(&solve()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::test_plan;

    #[test]
    fn many_flows_are_kept_only_for_cells_under_way() {
        let plan = test_plan([("e", 2), ("omega", MANY + 1)], "");
        let mut flows = Flows::new(&plan);
        let solved = |flows: &Flows<'_>| flows.stored.iter().filter(|flow| flow.get().is_some()).count();
        let cells = plan.cells(0..plan.cell_count());
        for (count, kept) in [(MANY, MANY), (MANY + 1, 3)] {
            (0..count as u32).for_each(|flow| flows.with(flow, |_| ()));
            flows.keep(&cells[..6]);
            assert_eq!(solved(&flows), kept);
        }
    }
}
