//! Labels of starts in a map of basins, while it is made: what their attractors are.

use std::collections::HashMap;

use super::label::Label;
use crate::map::catalogue::{Catalogue, Outcome};
use crate::map::plan::Plan;
use crate::record::Record;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::Law;

/// Kinds below are those of starts without a cycle; those above of cycles without a place.
const FIRST_CYCLE: u32 = 4;
const FIRST_UNRESOLVED: u32 = 1 << 24;

/// The attractors that are known, all of one oscillator: an adaptive map of basins sweeps starts alone.
pub(super) struct BasinLabels {
    flow: Box<Flow>,
    law: Law,
    catalogue: Catalogue,
    /// Labels of records that have not been taken up yet.
    prepared: HashMap<u32, Label>,
}

impl BasinLabels {
    /// None where the map is of something else.
    pub(super) fn of(plan: &Plan) -> Option<BasinLabels> {
        plan.is_basin().then(|| {
            let cell = plan.cell(0);
            let flow = Box::new(Flow::new(&plan.oscillator(cell.flow)));
            let (catalogue, prepared) = (Catalogue::of(&flow), HashMap::new());
            BasinLabels { flow, law: plan.law(cell.law), catalogue, prepared }
        })
    }

    /// Labels of records that are taken up next: side by side, for some of them take Newton's method.
    pub(super) fn prepare(&mut self, records: &[(u32, Record)]) {
        let found = self.catalogue.learn(&self.flow, self.law, records.len(), |nth| records[nth].1);
        let ids = records.iter().map(|(id, _)| *id);
        self.prepared.extend(ids.zip(found.into_iter().map(label)));
    }

    pub(super) fn label(&mut self, id: u32, record: &Record) -> Label {
        let prepared = self.prepared.remove(&id);
        prepared.unwrap_or_else(|| {
            let found = self.catalogue.learn(&self.flow, self.law, 1, |_| *record);
            found.into_iter().next().map_or(Label::default(), label)
        })
    }
}

fn label(found: Outcome) -> Label {
    Label::of_kind(match found {
        Outcome::Failed => 1,
        Outcome::Undecided => 2,
        Outcome::Chaos => 3,
        Outcome::Cycle(nth) => FIRST_CYCLE + nth,
        Outcome::Unresolved(period) => FIRST_UNRESOLVED + period,
    })
}
