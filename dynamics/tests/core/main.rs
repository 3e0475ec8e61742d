//! Tests of single motions: against published results, closed forms, an independent program, and invariants.

#[path = "../common/mod.rs"]
mod common;

mod any_oscillator;
mod bits;
mod cells;
mod dependent;
mod elastic;
mod flow;
mod friction;
mod independent;
mod instants;
mod machine;
mod machines;
mod one_wall;
mod orbits;
mod paper;
mod properties;
mod pushing;
mod quantities;
mod resonance;
mod run_up;
mod single_stop;
mod stages;
mod sticking;
mod stops;
mod stress;
mod tangents;
mod walls;
