//! Models with independent solutions: closed forms, published numbers, and an integrator that shares no code with the
//! engines.
//!
//! Each file contains one kind of model, with equations of its own. A test compares them with the files in `models/`.

mod cycle;

mod ball;
mod branches;
mod chaos_ends;
mod clearance;
mod clutch;
mod curves;
mod drift;
mod elastic;
mod engines;
mod files;
mod friction;
mod laws;
mod loose_gear;
mod machines;
mod mathieu;
mod meissner;
mod models;
mod pieces;
mod random;
mod signals;
mod single_impact;
mod unforced;
