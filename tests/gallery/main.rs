//! Models whose truth is not ours: closed forms, published numbers, and an integrator that shares nothing with the engines.
//!
//! Each file has one kind of model. The equations are written down anew there; that the files in `models/` say the same is a
//! test of its own.

#[path = "../common/mod.rs"]
mod common;
mod cycle;

mod ball;
mod clearance;
mod elastic;
mod engines;
mod files;
mod random;
mod single_impact;
