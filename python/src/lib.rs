//! The native module of the Python package `rattlemap`: the library's functions, and the program.
//!
//! Scenes and models arrive as texts and are parsed by the library, so that error messages are the program's. Every
//! computation runs on its own thread, without the interpreter's lock.

mod arrays;
mod bifurcation;
mod devices;
mod explore;
mod finished;
mod map;
mod model;
mod orbit;
mod problem;
mod program;
mod scene;
mod shard;
mod task;
mod worker;

use pyo3::prelude::*;
use rattlemap::store::record_file::Identity;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        bifurcation::bifurcation,
        devices::devices,
        explore::explore_page,
        finished::{check_folder, compare, curves, manifest, validate},
        map::{colors, map},
        model::{Model, models},
        orbit::{Orbit, orbit},
        program::{main, missing_variable},
        scene::Scene,
        shard::{check_shards, merge, of_map},
    };

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        worker::store_process();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("SOURCES", Identity::own_sources())?;
        module.add("TARGET", Identity::own_target())
    }
}
