//! An integrator of machines by matrix exponentials that shares only the description of the machine with the program, its checks, and the
//! comparison with the program on random machines.

mod act;
mod agree;
mod build;
mod checks;
mod cycles;
mod engine;
mod joint;
mod motion;
pub(crate) mod random;
mod rest;
mod system;
