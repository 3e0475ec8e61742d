//! Helpers that tests of several layers share: fixtures of one motion, and lanes on a device.
#![allow(dead_code, unused_imports, reason = "every test binary compiles this module and uses a part of it")]

#[path = "../../dynamics/tests/common/mod.rs"]
mod motion;

pub(crate) use motion::*;

pub(crate) mod closed_form;
pub(crate) mod gpu;

/// Returns the gear pair of a run.
pub(crate) fn pair_at(plan: &rattlemap::map::plan::Plan, id: u32) -> rattlemap_dynamics::model::GearPair {
    use rattlemap_dynamics::model::Model;
    let model = plan.model(id);
    let mut pair = rattlemap_dynamics::model::GearPair::paper(0.0);
    let names = model.parameters().iter().map(|parameter| &parameter.name);
    names.for_each(|name| pair.set(name, model.get(name).unwrap()).expect("a map of the gear pair"));
    pair
}
