//! How right is a finished map: maps that are right, and maps with planted errors.

#[path = "../common/mod.rs"]
mod common;
mod computed;
mod judged;
mod short_cells;

mod classes_agree;
mod half_mesh;
mod independent;
mod kinds;
mod not_finite;
mod replay;
mod short_lanes;
