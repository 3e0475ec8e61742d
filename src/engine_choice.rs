//! Which engine runs a map: the one that was asked for, or the fastest at hand.

use std::time::{Duration, Instant};

use anyhow::anyhow;
use rattlemap::engine::{Cpu, Engine, EngineError, Gpu};
use rattlemap::gpu::{self, AdapterChoice, AdapterReport, Precision};
use rattlemap::plan::{Batch, Plan};

use crate::cli::{EngineChoice, EngineOptions};
use crate::error::Failure;

/// How long engines are tried that cannot be told apart otherwise.
const TRIAL: Duration = Duration::from_millis(200);

/// Cells of one batch of a trial.
const TRIAL_CELLS: usize = 128;

/// An engine, and why it was taken.
pub(crate) struct Chosen<'p> {
    pub(crate) engine: Engine<'p>,
    /// Empty where there was nothing to choose.
    pub(crate) why: String,
}

/// Refuses what no engine can do, before anything else is done.
pub(crate) fn check(asked: &EngineOptions) -> Result<(), Failure> {
    match (asked.engine, asked.precision) {
        (EngineChoice::Cpu, Some(Precision::F32)) => Err(Failure::Usage(anyhow!(
            "--precision f32: the CPU engine computes in f64; leave --precision out, or ask for --engine gpu"
        ))),
        _ => Ok(()),
    }
}

/// Opens the engine that is asked for; `auto` takes a hardware GPU if there is one, else the
/// faster of the CPU and a software GPU on a few cells of the plan.
pub(crate) fn open<'p>(plan: &'p Plan, asked: &EngineOptions) -> Result<Chosen<'p>, Failure> {
    check(asked)?;
    let precision = asked.precision.unwrap_or(Precision::F32);
    let plain = |engine| Chosen { engine, why: String::new() };
    match asked.engine {
        EngineChoice::Cpu => Ok(plain(Engine::Cpu(Cpu::new(plan)))),
        EngineChoice::Gpu => open_gpu(plan, precision).map(plain),
        EngineChoice::Auto => choose(plan, asked.precision),
    }
}

fn open_gpu(plan: &Plan, precision: Precision) -> Result<Engine<'_>, Failure> {
    let device = pollster::block_on(gpu::Gpu::open(precision, &AdapterChoice::from_environment()))
        .map_err(|error| Failure::Usage(error.into()))?;
    let engine = Gpu::new(plan, device).map_err(|error| Failure::Run(error.into()))?;
    Ok(Engine::Gpu(Box::new(engine)))
}

fn choose(plan: &Plan, precision: Option<Precision>) -> Result<Chosen<'_>, Failure> {
    let wanted = precision.unwrap_or(Precision::F32);
    let adapters = pollster::block_on(gpu::adapters());
    let best = adapters.iter().find(|adapter| adapter.precisions.contains(&wanted));
    if precision == Some(Precision::F32) || best.is_some_and(is_hardware) {
        let only = if best.is_some_and(is_hardware) { "a hardware GPU" } else { "the CPU engine has no f32" };
        return match open_gpu(plan, wanted) {
            Ok(engine) => Ok(Chosen { why: only.to_owned(), engine }),
            // The reference needs no driver.
            Err(failure) if precision != Some(Precision::F32) => {
                Ok(Chosen { engine: Engine::Cpu(Cpu::new(plan)), why: failure.to_string() })
            }
            Err(failure) => Err(failure),
        };
    }
    let cpu = Engine::Cpu(Cpu::new(plan));
    if best.is_none() {
        let why = format!("no graphics adapter with {}", wanted.name());
        return Ok(Chosen { engine: cpu, why });
    }
    match open_gpu(plan, wanted) {
        Ok(gpu) => faster(plan, cpu, gpu),
        Err(failure) => Ok(Chosen { engine: cpu, why: failure.to_string() }),
    }
}

fn is_hardware(adapter: &AdapterReport) -> bool {
    gpu::is_hardware(&adapter.info)
}

/// The faster of two engines on the same cells.
fn faster<'p>(plan: &'p Plan, cpu: Engine<'p>, gpu: Engine<'p>) -> Result<Chosen<'p>, Failure> {
    let mut tried = Vec::new();
    for mut engine in [cpu, gpu] {
        let rate = rate(plan, &mut engine).map_err(|error| Failure::Run(error.into()))?;
        tried.push((rate, engine));
    }
    let says = |(rate, engine): &(f64, Engine<'_>)| {
        format!("{rate:.0} cells/s on {} ({})", engine.name(), engine.precision())
    };
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let why = format!("on trial {}", tried.iter().map(says).collect::<Vec<_>>().join(", "));
    match tried.into_iter().next() {
        Some((_, engine)) => Ok(Chosen { engine, why }),
        None => unreachable!("two were tried"),
    }
}

/// Cells per second on cells spread over the plan.
fn rate(plan: &Plan, engine: &mut Engine<'_>) -> Result<f64, EngineError> {
    let clock = Instant::now();
    let mut cells = 0;
    while clock.elapsed() < TRIAL {
        pollster::block_on(engine.run(&spread(plan, cells)))?;
        cells += TRIAL_CELLS;
    }
    Ok(cells as f64 / clock.elapsed().as_secs_f64())
}

/// Cells at places far from each other.
fn spread(plan: &Plan, from: usize) -> Batch {
    let count = plan.cell_count() as u64;
    // An odd multiplier near the golden section of 2^32 scatters consecutive numbers.
    let id = |n: usize| plan.order()[(((n as u64 * 2_654_435_761) % (1 << 32) * count) >> 32) as usize];
    let cells = (from..from + TRIAL_CELLS).map(|n| plan.cell(id(n))).collect();
    Batch { places: 0..TRIAL_CELLS, cells }
}
