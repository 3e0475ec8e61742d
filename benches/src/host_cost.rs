//! What a map costs the host: time by phase, and the work that a device receives.
//!
//! Every motion of the map is contact-free and ends after one forcing period, so that lanes cost next to nothing and the
//! host's work remains.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use rattlemap::gpu::Traffic;
use rattlemap::job::engine_choice::EngineRequest;
use rattlemap::job::map::MapJob;
use rattlemap::map::engine::{Cpu, Engine, EngineError};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene};
use rattlemap::model::GearPair;
use rattlemap::store::folder::Folder;

use crate::phase::{self, Cost};

/// Amplitude of the force for which the teeth move by a small part of the backlash.
const CONTACT_FREE: f64 = 1e-3;

/// Cells that the engine alone computes at once.
const BATCH: usize = 1 << 16;

/// Costs of a map.
#[derive(Clone, Debug)]
pub struct HostCost {
    /// Number of cells.
    pub cells: usize,
    /// Cost of each phase, in order.
    pub phases: Vec<Cost>,
    /// Work that the device has received. None for maps of the processor.
    pub traffic: Option<Traffic>,
}

/// Computes and writes a map of `counts` cells, of class and exponent or of `all` quantities.
///
/// # Errors
/// If the engine cannot be opened or fails, a file cannot be written, or a contact-free motion does not end after one
/// period.
pub fn run(counts: [u32; 2], all: bool, engine: EngineRequest, out: &Path) -> Result<HostCost> {
    let scene = scene(counts, all)?;
    let job = MapJob::new(&scene, engine);
    let folder = Folder::open(out, true)?;
    let mut phases = Vec::new();
    let plan = phase::run("plan", &mut phases, || job.plan())?;
    let opened = phase::run("open", &mut phases, || job.open(&plan, Some(&folder), Arc::new(())))?;
    let mut run = phase::run("begin", &mut phases, || opened.begin())?;
    phase::run("integrate", &mut phases, || run.integrate(&Arc::default()))?;
    let traffic = match &run.open.engine {
        Engine::Gpu(gpu) => Some(gpu.traffic()),
        _ => None,
    };
    let map = phase::run("survey", &mut phases, || run.finish());
    phase::run("write", &mut phases, || map.write())?;
    let cells = map.cells().count();
    let of = |place| map.cells().record(plan.run_at(place) as usize).periods_run;
    if (0..cells).map(of).any(|periods| periods > 2) {
        bail!("a contact-free cell took more than two forcing periods");
    }
    Ok(HostCost { cells, phases, traffic })
}

/// Computes all cells of the same map with the processor's engine alone, and drops their records.
///
/// # Errors
/// If the engine fails.
pub fn alone(counts: [u32; 2], all: bool) -> Result<Cost> {
    let scene = scene(counts, all)?;
    let plan = Plan::new(&scene);
    let (mut engine, cells) = (Engine::Cpu(Cpu::new(&plan)), plan.cells(0..plan.run_count()));
    let mut compute = || {
        for batch in cells.chunks(BATCH) {
            pollster::block_on(engine.begin(batch))?;
            let mut left = batch.len();
            while left > 0 {
                left -= pollster::block_on(engine.advance(0))?.len();
            }
        }
        Ok(())
    };
    let mut costs = Vec::new();
    phase::run("lanes", &mut costs, &mut compute).map_err(|error: EngineError| error)?;
    Ok(costs.remove(0))
}

/// Builds the scene of a map, of class and exponent or of `all` quantities.
fn scene(counts: [u32; 2], all: bool) -> Result<Scene> {
    use Quantity::{Class, Impacts, Lyapunov, Mesh, Pattern, Symmetric, Word};
    let model = GearPair { force: CONTACT_FREE, ..GearPair::paper(0.5) };
    let builder = Scene::builder(model).axis("e", 0.0..=1.0, counts[0]).axis("omega", 1.0..=12.0, counts[1]);
    let everything = [Class, Lyapunov, Impacts, Mesh, Symmetric, Word, Pattern];
    Ok(if all { builder.quantities(&everything) } else { builder }.build()?)
}
