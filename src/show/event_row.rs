//! Events of a motion as rows of tables: those at walls and those of friction, in order of time.

use crate::model_file::several_gaps;
use crate::show::names;
use rattlemap_dynamics::model::{Model, Side, State};
use rattlemap_dynamics::motion::Slips;
use rattlemap_dynamics::orbit::{Event, SlipPoint};

/// One event.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EventRow {
    /// Name of the kind.
    pub(crate) kind: &'static str,
    /// Time since the start of the rows' window, and since the last phase 0.
    pub(crate) t: f64,
    pub(crate) t_mod_period: f64,
    pub(crate) before: State,
    pub(crate) after: State,
    pub(crate) place: Place,
}

/// The place of an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// A wall: its gap and side, the side of the lasting contact after the event, and the impulse on the gap, which is negative at a
    /// right wall.
    Wall { gap: usize, side: Side, meshing: Option<Side>, impulse: Option<f64> },
    /// An element with dry friction, and the modes of all elements after the event.
    Element { element: usize, slips: Slips },
}

/// Names of the gaps and of the friction elements of a model, in columns of their own.
pub(crate) struct PlaceNames {
    /// None for a model with one gap.
    gaps: Option<Vec<String>>,
    /// None for a model without friction.
    pub(crate) elements: Option<Vec<String>>,
}

impl EventRow {
    /// Returns 1 or -1 for the right or the left wall; none for friction.
    pub(crate) fn side_code(&self) -> Option<i8> {
        match self.place {
            Place::Wall { side, .. } => Some(names::side_code(side)),
            Place::Element { .. } => None,
        }
    }

    pub(crate) fn impulse(&self) -> Option<f64> {
        match self.place {
            Place::Wall { impulse, .. } => impulse,
            Place::Element { .. } => None,
        }
    }
}

impl PlaceNames {
    /// Returns the names of a model. A single element is `friction`; several ones are counted from 1.
    pub(crate) fn of(model: &dyn Model) -> PlaceNames {
        let count = model.oscillator().map_or(0, |oscillator| oscillator.friction.len());
        let name = |n: usize| if count == 1 { "friction".to_owned() } else { format!("friction_{n}") };
        let elements = (count > 0).then(|| (1..=count).map(name).collect());
        PlaceNames { gaps: several_gaps(model), elements }
    }

    /// Returns the columns of this model with the name for an event, or for no event. A name that an event does not have is empty.
    pub(crate) fn columns(&self, place: Option<Place>) -> Vec<(&'static str, &str)> {
        let [gap, element] = match place {
            Some(Place::Wall { gap, .. }) => [Some(gap), None],
            Some(Place::Element { element, .. }) => [None, Some(element)],
            None => [None; 2],
        };
        let columns = [("gap", &self.gaps, gap), ("element", &self.elements, element)].into_iter();
        let own = columns.filter_map(|(column, names, nth)| Some((column, names.as_ref()?, nth)));
        own.map(|(column, names, nth)| (column, nth.map_or("", |nth| names[nth].as_str()))).collect()
    }
}

/// Returns the events at walls and those of friction, in order of time.
pub(crate) fn rows(model: &dyn Model, events: &[Event], slips: &[SlipPoint]) -> Vec<EventRow> {
    let oscillator = model.oscillator().ok();
    let at_wall = |event: &Event| {
        let Event { gap, side, t, t_mod_period, before, after, meshing, .. } = *event;
        let impulse = oscillator.as_ref().map(|oscillator| oscillator.gap_impulse(gap, [&before, &after]));
        let place = Place::Wall { gap, side, meshing, impulse };
        EventRow { kind: event.kind.name(), t, t_mod_period, before, after, place }
    };
    let of_friction = |slip: &SlipPoint| {
        let SlipPoint { kind, element, t, t_mod_period, state, slips } = *slip;
        let place = Place::Element { element, slips };
        EventRow { kind: kind.name(), t, t_mod_period, before: state, after: state, place }
    };
    let mut rows: Vec<EventRow> = events.iter().map(at_wall).chain(slips.iter().map(of_friction)).collect();
    rows.sort_by(|a, b| a.t.total_cmp(&b.t));
    rows
}
