//! Many motions: plans, schedules, engines, starts.

#[path = "../common/mod.rs"]
mod common;

mod audit;
mod models;
mod runs;
mod starts;
