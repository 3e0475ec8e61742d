//! One motion: against published facts, an independent program, and what must hold of every motion.

#[path = "../common/mod.rs"]
mod common;

mod any_oscillator;
mod bits;
mod cells;
mod elastic;
mod flow;
mod one_wall;
mod orbits;
mod paper;
mod properties;
mod single_stop;
mod sticking;
mod stops;
mod stress;
mod tangents;
