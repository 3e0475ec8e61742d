//! Parameter maps of vibro-impact oscillators.
//!
//! Modules in the order in which data flows through them: a scene says what is asked
//! ([`scene`]) and becomes numbered cells ([`plan`]), a model is described ([`model`]), its
//! flow is solved in closed form ([`flow`]), the reference jumps from event to event on it
//! ([`mod@reference`]), lanes on a graphics device do so on a grid of their own ([`gpu`]), and
//! what the reference meets is read as an orbit ([`orbit`], [`word`], [`stability`]) or a
//! bifurcation diagram
//! ([`bifurcation`]). A map's cells are numbered ([`plan`]) and put in order ([`schedule`]),
//! go through an engine ([`engine`], [`sweep`]) and come back as records ([`record`],
//! [`classify`], [`coexistence`]); a sample of them is replayed ([`mod@validate`]). All of it is then written
//! down ([`output`]); [`mod@bench`] measures it.

pub mod bench;
pub mod bifurcation;
pub mod certificate;
pub mod classify;
pub mod coexistence;
pub mod engine;
pub mod flow;
mod fused;
pub mod gpu;
pub mod limits;
pub mod model;
pub mod orbit;
pub mod output;
pub mod plan;
mod random;
pub mod record;
pub mod reference;
pub mod scene;
pub mod schedule;
pub mod size;
pub mod stability;
pub mod sweep;
pub mod validate;
pub mod word;

/// Compiles and runs the README's example as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
