//! Computes one motion of a piecewise-linear vibro-impact oscillator exactly.
//!
//! Pure f64: no files, clock, threads or graphics. The modules, in the order in which data flows:
//!
//! - [`model`]: the oscillator and its contact law;
//! - [`mod@pair`]: the fast engine, for up to two coordinates with one gap;
//! - [`mod@machine`]: the general engine;
//! - [`motion`]: the trajectory from event to event, by either engine;
//! - [`stability`]: cycles, Floquet multipliers and Lyapunov exponents;
//! - [`orbit`]: the class of a motion;
//! - [`cycle`]: cycles as boundary value problems;
//! - [`word`]: the symbols of a cycle;
//! - [`number`]: numbers in messages.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "a library writes nothing to the terminal")]

pub mod fused;
mod named;
pub mod number;

pub mod model;

pub mod machine;
pub mod motion;
pub mod pair;

pub mod stability;
pub mod word;

pub mod orbit;

pub mod cycle;
