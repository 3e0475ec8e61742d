//! Tests of the validation of finished maps, of correct maps and of maps with planted errors.

#[path = "../common/mod.rs"]
mod common;
mod fixtures;
#[allow(dead_code, reason = "the tests of the reference use the rest")]
#[path = "../../dynamics/tests/core/independent/motion.rs"]
mod motion;
#[path = "../../dynamics/tests/core/independent/random.rs"]
mod random;
mod short_cells;

mod chaos_ends;
mod classes_agree;
mod exponentials;
mod half_mesh;
mod independent;
mod kinds;
mod not_finite;
mod replay;
mod short_lanes;
