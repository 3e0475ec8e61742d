//! Parameters in JSON: an object with a field per parameter; meanings and units of all names of a model.

use std::collections::BTreeMap;

use serde::{Serialize, Serializer};

use crate::map::scene::Scene;
use crate::model_file::gap_columns;
use rattlemap_dynamics::model::Model;

/// Names and values of parameters, in the order of the model's table.
pub struct Parameters(Vec<(String, f64)>);

impl Parameters {
    /// Returns all parameters of a model.
    pub fn of(model: &dyn Model) -> Parameters {
        let all = model.parameters().iter().enumerate();
        Parameters(all.map(|(index, p)| (p.name.to_string(), model.value(index))).collect())
    }

    /// Returns the fixed parameters of a scene.
    pub fn of_scene(scene: &Scene) -> Parameters {
        Parameters(scene.fixed().map(|(parameter, value)| (parameter.name.to_string(), value)).collect())
    }
}

/// Returns the meanings of parameters and components of the state by name.
pub fn meanings(model: &dyn Model) -> BTreeMap<String, String> {
    let parameters = model.parameters().iter().map(|p| (p.name.to_string(), p.meaning.to_string()));
    let (names, bodies) = (model.state_names(), model.bodies());
    let states = names.iter().enumerate().map(|(i, name)| {
        let what = if i % 2 == 0 { "displacement" } else { "velocity" };
        let body = bodies.get(i / 2).filter(|body| !names.contains(body));
        let meaning = body.map_or(what.to_owned(), |body| format!("{what} of {body}"));
        ((*name).to_owned(), meaning)
    });
    parameters.chain(states).collect()
}

/// Returns the units of parameters, components of the state, gap and time by name; none if the model has no units.
pub(crate) fn units(model: &dyn Model) -> Option<BTreeMap<String, String>> {
    let units = model.units();
    let parameters = model.parameters().iter().map(|p| (&*p.name, p.unit.as_ref().map(ToString::to_string)));
    let states = model.state_names().into_iter().enumerate().map(|(i, name)| (name, units.component(i)));
    let gaps = gap_columns(model);
    let of_gaps = gaps.iter().flat_map(|[z, w]| [(&**z, units.gap.clone()), (&**w, units.gap_velocity())]);
    let all = parameters.chain(states).chain(of_gaps).chain([("t", units.time.clone())]);
    let named: BTreeMap<_, _> = all.filter_map(|(name, unit)| Some((name.to_owned(), unit?))).collect();
    (!named.is_empty()).then_some(named)
}

impl Serialize for Parameters {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}
