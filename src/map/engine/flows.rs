//! Flows of a plan, solved once where cells share them.

use std::sync::OnceLock;

use crate::map::plan::Plan;
use rattlemap_dynamics::flow::Flow;

/// The flows of a plan; any thread may ask.
pub(crate) struct Flows<'p> {
    plan: &'p Plan,
    /// Solved when first needed; empty where every cell has its own.
    kept: Vec<OnceLock<Box<Flow>>>,
}

impl<'p> Flows<'p> {
    pub(crate) fn new(plan: &'p Plan) -> Flows<'p> {
        let kept = if plan.stores_flows() { plan.flow_count() } else { 0 };
        Flows { plan, kept: (0..kept).map(|_| OnceLock::new()).collect() }
    }

    /// What `of` makes of the flow with this index in the plan.
    pub(crate) fn with<T>(&self, index: u32, of: impl FnOnce(&Flow) -> T) -> T {
        let solve = || Box::new(Flow::new(&self.plan.oscillator(index)));
        match self.kept.get(index as usize) {
            Some(kept) => of(kept.get_or_init(solve)),
            None => of(&solve()),
        }
    }
}
