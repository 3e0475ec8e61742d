//! Labels of starts in an adaptive map of basins: their attractors.

use std::collections::HashMap;

use super::label::Label;
use crate::map::catalogue::{Catalogue, Outcome};
use crate::map::plan::Plan;
use crate::record::Record;
use rattlemap_dynamics::model::Law;
use rattlemap_dynamics::motion::Flow;

/// Kind of a start that leads to the first cycle of the catalogue. Further cycles have the following numbers.
const FIRST_CYCLE: u32 = 4;
/// Added to the period: kind of a start that leads to a cycle outside of the catalogue.
const FIRST_UNRESOLVED: u32 = 1 << 24;

/// Known attractors. They belong to one oscillator, because an adaptive map of basins sweeps only starts.
pub(super) struct BasinLabels {
    flow: Box<Flow>,
    law: Law,
    catalogue: Catalogue,
    /// Labels of records that have not been accepted yet.
    prepared: HashMap<u32, Label>,
}

impl BasinLabels {
    /// Begins the labels of a map of basins; none for other maps.
    pub(super) fn of(plan: &Plan) -> Option<BasinLabels> {
        plan.is_basin().then(|| {
            let cell = plan.cell(0);
            let flow = Box::new(Flow::new(&plan.oscillator(cell.flow)));
            let (catalogue, prepared) = (Catalogue::of(&flow), HashMap::new());
            BasinLabels { flow, law: plan.law(cell.law), catalogue, prepared }
        })
    }

    /// Labels records that are accepted next, in parallel, because some need Newton's method.
    pub(super) fn prepare(&mut self, records: &[(u32, Record)]) {
        let found = self.catalogue.learn(&self.flow, self.law, records.len(), |nth| records[nth].1.clone());
        let ids = records.iter().map(|(id, _)| *id);
        self.prepared.extend(ids.zip(found.into_iter().map(label)));
    }

    pub(super) fn label(&mut self, id: u32, record: &Record) -> Label {
        let prepared = self.prepared.remove(&id);
        prepared.unwrap_or_else(|| {
            let found = self.catalogue.learn(&self.flow, self.law, 1, |_| record.clone());
            found.into_iter().next().map_or(Label::default(), label)
        })
    }
}

fn label(found: Outcome) -> Label {
    Label::of_kind(match found {
        Outcome::Failed => 1,
        Outcome::Undecided => 2,
        Outcome::Chaos => 3,
        Outcome::Torus => 4,
        Outcome::Cycle(nth) => FIRST_CYCLE + nth,
        Outcome::Unresolved(period) => FIRST_UNRESOLVED + period,
    })
}
