//! One motion of a piecewise-linear vibro-impact oscillator, exactly.
//!
//! Pure f64: no files, clock, threads or graphics. In the order in which data flows: an
//! oscillator and its law of contact ([`model`]), its flow in closed form ([`flow`]), steps shown to be
//! free of events ([`certificate`]), the trajectory from event to event ([`mod@reference`]),
//! tangents, cycles and their multipliers ([`stability`]), what a motion is ([`orbit`]), and what
//! its cycle is called ([`word`]).

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "output goes where the caller says")]

pub mod fused;

pub mod model;

pub mod certificate;
pub mod flow;
pub mod reference;

pub mod stability;
pub mod word;

pub mod orbit;
