//! Tests of the validation of finished maps, of correct maps and of maps with planted errors.

pub(crate) mod fixtures;
mod short_cells;

mod chaos_ends;
mod classes_agree;
mod exponentials;
mod half_mesh;
mod independent;
mod kinds;
mod machines;
mod not_finite;
mod replay;
mod short_lanes;
