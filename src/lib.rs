//! Parameter maps of vibro-impact oscillators.
//!
//! A layer a module, each on top of those below it:
//!
//! | layer | what it is |
//! | --- | --- |
//! | [`cli`] | arguments and commands |
//! | [`job`] | what every front end needs to run a job |
//! | [`store`] | results on disk: folders, manifests, record files, shards |
//! | [`show`] | how results look: tables, figures, the report; no files |
//! | [`mod@validate`] | how right is a finished map |
//! | [`findings`] | what all records of a map show together |
//! | [`map`] | many motions: scene, plan, schedule, engines |
//! | [`model_file`] | models written down as files |
//! | [`mod@text`] | what people write, with places for errors |
//! | [`gpu`] | the host's side of lanes |
//! | [`record`] | what an engine hands back per cell, and its classes |
//! | [`dynamics`] | one motion, exactly: a package of its own |
//!
//! A map of any [`model`] in a few lines:
//!
//! ```
//! use rattlemap::map::scene::{Quantity, Scene};
//! use rattlemap::job::{self, Processor};
//! use rattlemap::model::Stops;
//!
//! let model = Stops { r: 0.1, k: 1.0, ..Stops::with_restitution(0.8) };
//! let scene = Scene::builder(model)
//!     .axis("F", 0.2..=2.0, 6)
//!     .axis("omega", 0.5..=1.5, 6)
//!     .quantities(&[Quantity::Class, Quantity::Impacts])
//!     .build()?;
//! let map = job::run(&scene, Processor::Cpu)?;
//! for cell in map.cells() {
//!     let (force, omega) = (cell.values[0], cell.values[1]);
//!     println!("{force} {omega}: {:?}, {} impacts", cell.class, cell.record.impacts_per_period);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(
    not(feature = "job"),
    allow(dead_code, unused_imports, reason = "only layers above use some items")
)]
#![warn(clippy::print_stderr, clippy::print_stdout, reason = "output goes where the caller says")]

pub use rattlemap_dynamics as dynamics;
pub use rattlemap_dynamics::{model, motion, orbit, stability, word};

pub mod record;

pub mod text;

pub mod model_file;

#[cfg(feature = "gpu")]
pub mod gpu;

pub mod map;

pub mod findings;

#[cfg(feature = "gpu")]
pub mod validate;

#[cfg(feature = "figures")]
pub mod show;

#[cfg(feature = "files")]
pub mod store;

#[cfg(feature = "job")]
pub mod job;

#[cfg(feature = "cli")]
pub mod cli;

/// Compiles and runs the README's examples as doctests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
