//! Flows of a plan, solved once if cells share them.

use std::sync::OnceLock;

use crate::map::plan::Plan;
use rattlemap_dynamics::motion::Flow;

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

    /// Calls `function` with a flow, given by its index in the plan.
    pub(crate) fn with<T>(&self, index: u32, function: impl FnOnce(&Flow) -> T) -> T {
        let solve = || Box::new(Flow::new(self.plan.form(index)));
        match self.stored.get(index as usize) {
            Some(stored) => function(stored.get_or_init(solve)),
            None => function(&solve()),
        }
    }
}
