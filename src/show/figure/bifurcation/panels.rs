//! Panels of a diagram: which quantities of a model it shows.

use crate::map::bifurcation::Column;
use crate::show::symbols::{symbol, with_unit};
use crate::show::wall_labels::WallLabels;
use rattlemap_dynamics::model::{Model, Side, State};
use rattlemap_dynamics::orbit::EventKind;

/// Panels and wall labels of a diagram.
#[derive(Clone, Debug)]
pub struct Panels {
    pub(crate) list: Vec<Panel>,
    pub(crate) walls: WallLabels,
}

/// A panel: one component of certain states.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    pub(crate) label: String,
    component: usize,
    pub(crate) states: States,
}

/// States that a panel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum States {
    /// States before every crossing of a wall.
    Crossings,
    /// States before every contact.
    Contacts,
    /// States at phase 0.
    Strobes,
}

impl Panels {
    /// Returns the panels of a model: displacements at the walls. If the walls [fix](crate::map::bifurcation::fixed) one of the
    /// displacements, the panels show its velocity before contact and the displacements at phase 0 instead.
    pub fn of(model: &dyn Model, fixed: Option<usize>) -> Panels {
        let walls = WallLabels::of(model);
        let names: Vec<String> = model.state_names().into_iter().map(symbol).collect();
        let displacements = || (0..names.len()).step_by(2);
        let units = model.units();
        let panel = |label: String, component, states| Panel {
            label: with_unit(&label, units.component(component).as_deref()),
            component,
            states,
        };
        let list = match fixed.map(|i| 2 * i + 1).filter(|velocity| *velocity < names.len()) {
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
        Panels { list, walls }
    }

    /// Whether a panel shows states at phase 0.
    pub(crate) fn has_strobes(&self) -> bool {
        self.list.iter().any(|panel| panel.states == States::Strobes)
    }
}

impl Panel {
    /// Returns the values in a column, with the wall of each unless it is a state at phase 0.
    pub(crate) fn values(&self, column: &Column) -> Vec<(f64, Option<Side>)> {
        let component = |state: &State| state[self.component];
        let crossings = |wanted: fn(EventKind) -> bool| -> Vec<(f64, Option<Side>)> {
            let points = column.points.iter().filter(|point| wanted(point.kind));
            points.map(|point| (component(&point.before), Some(point.side))).collect()
        };
        match self.states {
            States::Crossings => crossings(|_| true),
            States::Contacts => crossings(|kind| kind != EventKind::MeshEnd),
            States::Strobes => column.strobes.iter().map(|state| (component(state), None)).collect(),
        }
    }
}
