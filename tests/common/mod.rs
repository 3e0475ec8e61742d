//! Helpers that tests of several layers share: fixtures of one motion, and lanes on a device.

#[path = "../../dynamics/tests/common/mod.rs"]
mod motion;

pub(crate) use motion::*;
use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::Model;

pub(crate) mod closed_form;
pub(crate) mod gpu;

/// Returns a model in `models/` with these values of parameters.
pub(crate) fn built_in(name: &str, values: &[(&str, f64)]) -> FileModel {
    let mut model = FileModel::built_in(name).expect("built in");
    values.iter().for_each(|&(name, value)| model.set(name, value).expect("a parameter"));
    model
}

/// Returns the gear pair of a run.
pub(crate) fn pair_at(plan: &rattlemap::map::plan::Plan, id: u32) -> rattlemap_dynamics::model::GearPair {
    let model = plan.model(id);
    let mut pair = rattlemap_dynamics::model::GearPair::paper(0.0);
    let names = model.parameters().iter().map(|parameter| &parameter.name);
    names.for_each(|name| pair.set(name, model.get(name).unwrap()).expect("a map of the gear pair"));
    pair
}
