//! Maps: many motions. A scene says what is asked ([`scene`]); its cells are numbered ([`plan`])
//! and put in order ([`schedule`]); an engine takes them up and hands back records ([`engine`],
//! [`sweep`]). Over one axis it is a bifurcation diagram ([`bifurcation`]); several starts per cell
//! count attractors ([`coexistence`]); where starts are swept each belongs to a basin ([`attractors`]); two maps of one grid are compared ([`compare`]); what changed nothing is named
//! ([`effect`]). [`run`] does all of it at once.

pub use crate::text::{expression, printable};

pub mod random;

pub mod scene;

pub mod plan;
pub mod schedule;
pub mod shard;
#[cfg(feature = "gpu")]
pub mod size;

pub mod engine;
#[cfg(feature = "gpu")]
pub mod engine_choice;
pub mod sweep;

pub mod attractors;
pub mod bifurcation;
pub mod coexistence;
pub mod compare;
pub mod effect;
mod seen;

#[cfg(not(target_arch = "wasm32"))]
mod run;
#[cfg(not(target_arch = "wasm32"))]
pub use run::{Map, MapCell, MapError, Processor, run};
