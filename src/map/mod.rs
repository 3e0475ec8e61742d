//! Maps: many motions. A scene says what is asked ([`scene`]); its cells are numbered ([`plan`])
//! and put in order ([`schedule`]); an engine takes them up and hands back records ([`engine`],
//! [`sweep`]). Over one axis it is a bifurcation diagram ([`bifurcation`]). [`run`] computes a whole map in one call.

pub use crate::text::{expression, printable};

pub mod random;

pub mod scene;

pub mod plan;
pub mod schedule;
pub mod shard;

pub mod engine;
pub mod sweep;

pub mod bifurcation;
pub mod catalogue;
pub mod cycle;
