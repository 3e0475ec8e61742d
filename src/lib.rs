//! Parameter maps of vibro-impact oscillators.
//!
//! Modules in the order in which data flows through them: a scene says what is asked
//! ([`scene`]), a model is described ([`model`]), its flow is solved in closed form
//! ([`flow`]), the reference jumps from event to event on it ([`mod@reference`]), lanes on a
//! graphics device do so on a grid of their own ([`gpu`], [`record`]), and what the reference
//! meets is read as an orbit ([`orbit`], [`word`], [`stability`]) or a bifurcation diagram
//! ([`bifurcation`]), then written down ([`output`]).

pub mod bifurcation;
mod certificate;
pub mod flow;
pub mod gpu;
pub mod model;
pub mod orbit;
pub mod output;
pub mod record;
pub mod reference;
pub mod scene;
pub mod stability;
pub mod word;
