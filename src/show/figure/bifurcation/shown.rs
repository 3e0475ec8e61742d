//! What a diagram shows of a model: a panel per quantity, and the walls by name.

use crate::map::bifurcation::Column;
use crate::show::symbols::symbol;
use crate::show::wall_words::WallWords;
use rattlemap_dynamics::model::{Model, Side, State};
use rattlemap_dynamics::orbit::EventKind;

/// Panels and walls of a diagram.
#[derive(Clone, Debug)]
pub struct Shown {
    pub(crate) panels: Vec<Panel>,
    pub(crate) walls: WallWords,
}

/// One panel: a component of some states.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    pub(crate) label: String,
    component: usize,
    pub(crate) states: States,
}

/// Which states a panel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum States {
    /// Before every crossing of a wall.
    Crossings,
    /// Before every contact.
    Contacts,
    /// At phase 0.
    Strobes,
}

impl Shown {
    /// Displacements at the walls; where these [fix](crate::map::bifurcation::fixed) one of them, its velocity before
    /// contact and the displacements at phase 0.
    pub fn of(model: &dyn Model, fixed: Option<usize>) -> Shown {
        let walls = WallWords::of(model);
        let names: Vec<String> = model.state_names().into_iter().map(symbol).collect();
        let displacements = || (0..names.len()).step_by(2);
        let panel = |label, component, states| Panel { label, component, states };
        let panels = match fixed.map(|i| 2 * i + 1).filter(|velocity| *velocity < names.len()) {
            None => {
                let label = |i: usize| format!("{} at {}", names[i], walls.section());
                displacements().map(|i| panel(label(i), i, States::Crossings)).collect()
            }
            Some(velocity) => {
                let label = format!("velocity before contact, {}", names[velocity]);
                let strobe = |i: usize| panel(format!("{} at phase 0", names[i]), i, States::Strobes);
                let first = panel(label, velocity, States::Contacts);
                [first].into_iter().chain(displacements().map(strobe)).collect()
            }
        };
        Shown { panels, walls }
    }

    /// Whether any panel shows the stroboscopic section.
    pub(crate) fn has_strobes(&self) -> bool {
        self.panels.iter().any(|panel| panel.states == States::Strobes)
    }
}

impl Panel {
    /// Its values in a column, each with the wall where it belongs to one.
    pub(crate) fn values(&self, column: &Column) -> Vec<(f64, Option<Side>)> {
        let of = |state: &State| state[self.component];
        let crossings = |wanted: fn(EventKind) -> bool| -> Vec<(f64, Option<Side>)> {
            let points = column.points.iter().filter(|point| wanted(point.kind));
            points.map(|point| (of(&point.before), Some(point.side))).collect()
        };
        match self.states {
            States::Crossings => crossings(|_| true),
            States::Contacts => crossings(|kind| kind != EventKind::MeshEnd),
            States::Strobes => column.strobes.iter().map(|state| (of(state), None)).collect(),
        }
    }
}
