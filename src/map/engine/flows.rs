//! Flows of a plan. A flow that several cells share is solved once.

use std::sync::OnceLock;

use crate::map::plan::Plan;
use rattlemap_dynamics::flow::Flow;

/// The flows of a plan, for any number of threads.
pub(crate) struct Flows<'p> {
    plan: &'p Plan,
    /// Flows that have been solved, by index; empty if they are not kept.
    kept: Vec<OnceLock<Box<Flow>>>,
}

impl<'p> Flows<'p> {
    pub(crate) fn new(plan: &'p Plan) -> Flows<'p> {
        let kept = if plan.keeps_flows() { plan.flow_count() } else { 0 };
        Flows { plan, kept: (0..kept).map(|_| OnceLock::new()).collect() }
    }

    /// Calls `of` with the flow of this index.
    pub(crate) fn with<T>(&self, index: u32, of: impl FnOnce(&Flow) -> T) -> T {
        let solve = || Box::new(Flow::new(&self.plan.oscillator(index)));
        match self.kept.get(index as usize) {
            Some(kept) => of(kept.get_or_init(solve)),
            None => of(&solve()),
        }
    }
}
