//! An integrator of machines by matrix exponentials that shares only the description of the machine with the program, and random machines.

mod act;
mod build;
mod checks;
mod motion;
mod random;
mod system;
