//! An integrator of machines by matrix exponentials, checks of it, and its comparison with the program on random machines. It shares only
//! the description of the machine with the program.

mod act;
pub(crate) mod agree;
mod build;
mod checks;
mod curves;
pub(crate) mod cycle;
mod cycles;
pub(crate) mod engine;
mod friction;
mod joint;
pub(crate) mod motion;
pub(crate) mod random;
mod rest;
mod roots;
mod series;
pub(crate) mod system;
