//! Pairs on lanes: constants of the motion in closed form.

pub(super) mod constants;
mod coordinates;

pub(super) use constants::{Change, PAIRS_PER_HARMONIC, PairConstants, phasors, speed};
