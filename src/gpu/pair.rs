//! Pairs on lanes: constants of the motion in closed form.

pub(super) mod constants;
mod coordinates;
mod pushing;

pub(super) use constants::{Change, PAIRS_PER_HARMONIC, Page, PairConstants, phasors, speed};
pub(super) use pushing::has_negative_preload;
