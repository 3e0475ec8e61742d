//! Lists the processor and the graphics adapters of this machine.

use crate::gpu::{self, AdapterChoice, AdapterReport};
use crate::job::engine_choice::{self, EngineRequest};
use crate::job::error::JobError;
use crate::job::processor;
use crate::map::plan::Plan;
use crate::map::scene::{Purpose, Scene};

/// A scene for which `auto` chooses an engine.
const MAIN_MAP: &str = include_str!("../../scenes/e_omega.toml");

/// Processor and graphics adapters of this machine, and the engine that `auto` chooses.
#[derive(Clone, Debug)]
pub struct Devices {
    /// Name and cores of the processor.
    pub processor: String,
    /// Graphics adapters, the best one first.
    pub adapters: Vec<AdapterReport>,
    /// Environment variables that exclude adapters. None if there are none, or an adapter was found.
    pub narrowed_by: Option<String>,
    /// Name of the engine that `auto` chooses.
    pub engine: &'static str,
    /// Its precision.
    pub precision: &'static str,
    /// Reason for the choice.
    pub reason: String,
}

/// Lists the devices, and makes the choice of `auto`.
///
/// # Errors
/// [`JobError::Engine`] if `auto` cannot choose, for instance because the environment names a missing adapter.
pub fn devices() -> Result<Devices, JobError> {
    let scene = Scene::parse(MAIN_MAP, "e_omega", &[], Purpose::Map)?;
    let plan = Plan::new(&scene);
    let adapters = pollster::block_on(gpu::adapters());
    let chosen = pollster::block_on(engine_choice::open(&plan, &EngineRequest::default()))?;
    Ok(Devices {
        processor: processor::described(),
        narrowed_by: gpu::narrowed_by(&AdapterChoice::default()).filter(|_| adapters.is_empty()),
        adapters,
        engine: chosen.engine.name(),
        precision: chosen.engine.precision(),
        reason: chosen.reason,
    })
}
