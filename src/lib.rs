//! Parameter maps of vibro-impact oscillators.
//!
//! Modules in the order in which data flows through them, a layer at a time: a scene says what
//! is asked ([`scene`]) of which oscillator ([`model`]); its flow is solved in closed form
//! ([`flow`]), the reference jumps from event to event on it ([`mod@reference`]), and what it
//! meets is read as an orbit ([`orbit`], [`word`], [`stability`]). A map's cells are numbered
//! ([`plan`]) and put in order ([`schedule`]), go through an engine ([`engine`], [`sweep`]),
//! the reference or lanes on a graphics device with a grid of their own ([`gpu`]), and come back
//! as records ([`record`], [`classify`], [`coexistence`]); a sample of them is replayed
//! ([`mod@validate`]). Over one axis it is a bifurcation diagram ([`bifurcation`]). All of it is
//! written down ([`output`]); [`mod@bench`] measures it.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "output goes where the caller says")]

mod fused;
pub mod limits;
mod random;

pub mod model;
pub mod scene;

pub mod certificate;
pub mod flow;
pub mod reference;

pub mod orbit;
pub mod stability;
pub mod word;

pub mod plan;
pub mod schedule;
pub mod size;

pub mod engine;
pub mod gpu;
pub mod sweep;

pub mod classify;
pub mod coexistence;
pub mod record;

pub mod bifurcation;
pub mod validate;

pub mod output;

pub mod bench;

/// Compiles and runs the README's example as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
