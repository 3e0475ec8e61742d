//! The native module of the Python package `rattlemap`: the library's functions, and the program.
//!
//! What is asked comes as texts and is read by the library, so that errors are the program's. Every computation runs on a
//! thread of its own, free of the interpreter's lock.

mod arrays;
mod bifurcation;
mod engines;
mod folder;
mod map;
mod model;
mod orbit;
mod problem;
mod program;
mod scene;
mod shard;
mod waiting;

use pyo3::prelude::*;
use rattlemap::store::record_file::Identity;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        bifurcation::bifurcation,
        folder::manifest,
        map::{colors, map},
        model::Model,
        orbit::{Orbit, orbit},
        program::{main, missing_variable},
        scene::Scene,
        shard::{check_shards, merge, of_map},
    };

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        waiting::loaded();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("SOURCES", Identity::own_sources())?;
        module.add("TARGET", Identity::own_target())
    }
}
