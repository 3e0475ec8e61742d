//! Figures of maps, diagrams, comparisons and orbits.

pub mod bifurcation;
pub mod compare;
pub mod map;
pub(crate) mod map_layout;
mod map_lines;
pub mod orbit;
#[cfg(test)]
mod pages;
pub mod run_up;
