//! Maps: many motions, one for each cell of a parameter plane.
//!
//! A scene defines the map ([`scene`]); a plan numbers its cells ([`plan`]); a schedule orders them ([`schedule`]); an
//! engine computes their records ([`engine`], [`sweep`]). A scene over one axis is a bifurcation diagram
//! ([`bifurcation`]).

pub mod random;
pub(crate) mod statistics;

pub mod scene;

pub mod plan;
pub mod schedule;
pub mod shard;
#[cfg(feature = "files")]
pub mod shares;

pub mod engine;
pub mod sweep;

pub mod bifurcation;
pub mod branches;
pub mod catalogue;
pub mod curves;
pub mod cycle;
