//! Many motions: plans, schedules, engines, starts.

#[path = "../common/mod.rs"]
mod common;

mod audit;
mod axes;
mod basins;
mod models;
mod runs;
mod starts;
