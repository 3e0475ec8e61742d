//! What tests of several layers share: fixtures of one motion, and lanes on a device.
#![allow(dead_code, unused_imports, reason = "every test binary compiles this module and uses a part of it")]

#[path = "../../dynamics/tests/common/mod.rs"]
mod motion;

pub(crate) use motion::*;

pub(crate) mod closed_form;
pub(crate) mod gpu;

/// The gear pair of a run.
pub(crate) fn pair_at(plan: &rattlemap::map::plan::Plan, id: u32) -> rattlemap_dynamics::model::GearPair {
    *plan.model(id).downcast_ref().expect("a map of the gear pair")
}
