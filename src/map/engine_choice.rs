//! Which engine runs a map: the one that was asked for, or the fastest at hand.

use std::str::FromStr;

use thiserror::Error;
use web_time::{Duration, Instant};

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};
use crate::map::engine::{Cpu, Engine, EngineError, Gpu};
use crate::map::plan::{Cell, Plan};

/// How long engines are tried that cannot be told apart otherwise.
const TRIAL: Duration = Duration::from_millis(200);

/// Cells of one batch of a trial, and forcing periods that each may take.
const TRIAL_CELLS: usize = 128;
const TRIAL_PERIODS: u32 = 64;

/// Maps that the CPU does in less time than this are done before a trial would pay: a software driver compiles for ten
/// seconds.
const WORTH_A_TRIAL: Duration = Duration::from_secs(60);

/// What is asked for: who computes, and how. The default leaves all of it open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ask {
    /// Who computes.
    pub engine: Who,
    /// None leaves it open: f32 on a graphics device, f64 on the processor.
    pub precision: Option<Precision>,
}

/// Engines by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Who {
    /// A hardware GPU if there is one, else the CPU; a software GPU where that is faster on long maps.
    #[default]
    Auto,
    /// Lanes on a graphics device.
    Gpu,
    /// The event-driven reference on all processor cores, in f64.
    Cpu,
}

/// An engine, and why it was taken.
pub struct Chosen<'p> {
    /// Ready to take up cells of the plan.
    pub engine: Engine<'p>,
    /// Empty where there was nothing to choose.
    pub why: String,
}

/// Why there is no engine.
#[derive(Debug, Error)]
pub enum ChoiceError {
    /// No such engine is known.
    #[error("the engine {name:?} is none of auto, gpu and cpu")]
    UnknownEngine {
        /// What was asked for.
        name: String,
    },
    /// The reference computes in f64 alone.
    #[error(
        "--precision f32: the CPU engine computes in f64; leave --precision out, or ask for --engine gpu"
    )]
    CpuInF32,
    /// No adapter fits.
    #[error(transparent)]
    NoAdapter(GpuError),
    /// What was asked for is there, and fails.
    #[error(transparent)]
    Device(GpuError),
    /// The engine fails as it is made ready.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl ChoiceError {
    /// Whether what was asked for is at fault, and another request may do; else a device fails.
    pub fn is_in_the_request(&self) -> bool {
        match self {
            ChoiceError::UnknownEngine { .. } | ChoiceError::CpuInF32 | ChoiceError::NoAdapter(_) => true,
            ChoiceError::Device(_) | ChoiceError::Engine(_) => false,
        }
    }
}

impl From<GpuError> for ChoiceError {
    fn from(error: GpuError) -> ChoiceError {
        match error {
            GpuError::NoAdapter { .. } => ChoiceError::NoAdapter(error),
            _ => ChoiceError::Device(error),
        }
    }
}

impl FromStr for Who {
    type Err = ChoiceError;

    fn from_str(name: &str) -> Result<Who, ChoiceError> {
        match name {
            "auto" => Ok(Who::Auto),
            "gpu" => Ok(Who::Gpu),
            "cpu" => Ok(Who::Cpu),
            _ => Err(ChoiceError::UnknownEngine { name: name.to_owned() }),
        }
    }
}

/// Refuses what no engine can do, before anything else is done.
///
/// # Errors
/// [`ChoiceError::CpuInF32`].
pub fn check(ask: &Ask) -> Result<(), ChoiceError> {
    match (ask.engine, ask.precision) {
        (Who::Cpu, Some(Precision::F32)) => Err(ChoiceError::CpuInF32),
        _ => Ok(()),
    }
}

/// Opens the engine that is asked for; `auto` takes a hardware GPU if there is one, else the CPU, or for
/// long maps the faster of it and a software GPU on a few cells of the plan.
///
/// # Errors
/// [`ChoiceError`], with nothing computed.
pub async fn open<'p>(plan: &'p Plan, ask: &Ask) -> Result<Chosen<'p>, ChoiceError> {
    check(ask)?;
    let precision = ask.precision.unwrap_or(Precision::F32);
    let plain = |engine| Chosen { engine, why: String::new() };
    match ask.engine {
        Who::Cpu => Ok(plain(Engine::Cpu(Cpu::new(plan)))),
        Who::Gpu => open_gpu(plan, precision).await.map(plain),
        Who::Auto => choose(plan, ask.precision).await,
    }
}

async fn open_gpu(plan: &Plan, precision: Precision) -> Result<Engine<'_>, ChoiceError> {
    Ok(Engine::Gpu(Box::new(Gpu::new(plan, open_device(precision).await?).await?)))
}

async fn open_device(precision: Precision) -> Result<gpu::Gpu, ChoiceError> {
    Ok(gpu::Gpu::open(precision, &AdapterChoice::from_environment()).await?)
}

async fn choose(plan: &Plan, precision: Option<Precision>) -> Result<Chosen<'_>, ChoiceError> {
    let wanted = precision.unwrap_or(Precision::F32);
    let choice = AdapterChoice::from_environment();
    let adapters = gpu::adapters().await;
    let fits =
        |adapter: &&AdapterReport| choice.allows(&adapter.info) && adapter.precisions.contains(&wanted);
    let best = adapters.iter().find(fits);
    if choice.name.is_some() && best.is_none() || precision == Some(Precision::F32) {
        let why = "the CPU engine has no f32".to_owned();
        return open_gpu(plan, wanted).await.map(|engine| Chosen { engine, why });
    }
    let cpu = |why| Chosen { engine: Engine::Cpu(Cpu::new(plan)), why };
    match best {
        None => {
            let narrowed =
                gpu::narrowed_by(&choice).map_or(String::new(), |narrowed| format!("; {narrowed}"));
            Ok(cpu(format!("no graphics adapter with {}{narrowed}", wanted.name())))
        }
        // The reference needs no driver.
        Some(best) if gpu::is_hardware(&best.info) => Ok(open_gpu(plan, wanted).await.map_or_else(
            |error| cpu(error.to_string()),
            |engine| Chosen { engine, why: "a hardware GPU".to_owned() },
        )),
        Some(_) => Ok(faster(plan, wanted).await.unwrap_or_else(|error| cpu(error.to_string()))),
    }
}

/// The CPU where it has soon done the map, else the faster of it and a software GPU.
async fn faster(plan: &Plan, precision: Precision) -> Result<Chosen<'_>, ChoiceError> {
    let trial = plan.shortened(TRIAL_PERIODS);
    let on_cpu = rate(&trial, &mut Engine::Cpu(Cpu::new(&trial))).await?;
    if !is_worth_a_trial(plan, on_cpu) {
        let why = format!(
            "no hardware GPU, and soon done: {on_cpu:.0} cells/s on trial, {TRIAL_PERIODS} periods each"
        );
        return Ok(Chosen { engine: Engine::Cpu(Cpu::new(plan)), why });
    }
    on_trial(plan, &trial, precision, on_cpu).await
}

/// Whether the CPU has enough to do, which does so many cells of a trial in a second.
fn is_worth_a_trial(plan: &Plan, on_cpu: f64) -> bool {
    let budget = plan.budget();
    // Most cells that may stop early have done so by then.
    let trials = if budget.early_stop { 1.0 } else { f64::from(budget.periods()) / f64::from(TRIAL_PERIODS) };
    plan.run_count() as f64 * trials > on_cpu * WORTH_A_TRIAL.as_secs_f64()
}

/// The faster of the CPU, whose rate is known, and a software GPU on the same cells, for a few periods each.
async fn on_trial<'p>(
    plan: &'p Plan,
    trial: &Plan,
    precision: Precision,
    on_cpu: f64,
) -> Result<Chosen<'p>, ChoiceError> {
    let device = open_device(precision).await?;
    let mut lanes = Engine::Gpu(Box::new(Gpu::new(trial, device).await?));
    // The first batch compiles the shader.
    lanes.run(&spread(trial, 0, 1)).await?;
    let on_gpu = rate(trial, &mut lanes).await?;
    let name = precision.name();
    let why = format!(
        "on trial {on_cpu:.0} cells/s on cpu (f64), {on_gpu:.0} cells/s on gpu ({name}), {TRIAL_PERIODS} periods each"
    );
    let engine = match lanes {
        Engine::Gpu(lanes) if on_gpu > on_cpu => {
            Engine::Gpu(Box::new(Gpu::new(plan, lanes.into_device()).await?))
        }
        _ => Engine::Cpu(Cpu::new(plan)),
    };
    Ok(Chosen { engine, why })
}

/// Cells per second on cells spread over the plan.
async fn rate(plan: &Plan, engine: &mut Engine<'_>) -> Result<f64, EngineError> {
    let clock = Instant::now();
    let mut cells = 0;
    while clock.elapsed() < TRIAL {
        engine.run(&spread(plan, cells, TRIAL_CELLS)).await?;
        cells += TRIAL_CELLS;
    }
    Ok(cells as f64 / clock.elapsed().as_secs_f64())
}

/// Cells at places far from each other.
fn spread(plan: &Plan, from: usize, count: usize) -> Vec<Cell> {
    let all = plan.cell_count() as u64;
    // An odd multiplier near the golden section of 2^32 scatters consecutive numbers.
    let id = |n: usize| plan.run_at((((n as u64 * 2_654_435_761) % (1 << 32) * all) >> 32) as usize);
    (from..from + count).map(|n| plan.cell(id(n))).collect()
}

#[cfg(test)]
mod tests {
    use crate::map::scene::{Purpose, Scene};

    use super::*;

    fn plan(sets: &[&str]) -> Plan {
        let text = "[[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 64\n\
                    [[axis]]\nparameter = 'omega'\nmin = 11.0\nmax = 12.0\ncount = 64\n";
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        Plan::new(&Scene::parse(text, "s", &sets, Purpose::Map).unwrap())
    }

    #[test]
    fn a_trial_has_to_pay() {
        // 4,096 cells in a minute are 68 in a second.
        assert!(!is_worth_a_trial(&plan(&[]), 70.0));
        assert!(is_worth_a_trial(&plan(&[]), 66.0));
        // By brute force each of them takes 528 periods, 8.25 times those of a trial.
        let brute = plan(&["integration.early_stop=false"]);
        assert!(!is_worth_a_trial(&brute, 70.0 * 8.25));
        assert!(is_worth_a_trial(&brute, 66.0 * 8.25));
    }

    #[test]
    fn what_is_at_fault_is_told() {
        assert!(ChoiceError::CpuInF32.is_in_the_request());
        assert!("gpu2".parse::<Who>().unwrap_err().to_string().contains("none of auto, gpu and cpu"));
        let no = GpuError::NoAdapter { wanted: "at all".into(), remedy: "r".into(), found: "none".into() };
        assert!(ChoiceError::from(no).is_in_the_request());
        assert!(!ChoiceError::from(GpuError::Lost { message: "gone".into() }).is_in_the_request());
    }

    /// A long budget does not lengthen it.
    #[test]
    fn a_trial_takes_the_faster() {
        let plan = plan(&["integration.transient_periods=100000"]);
        let trial = plan.shortened(TRIAL_PERIODS);
        for (on_cpu, name) in [(1e9, "cpu"), (1e-3, "gpu")] {
            let chosen = pollster::block_on(on_trial(&plan, &trial, Precision::F32, on_cpu))
                .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(chosen.engine.name(), name, "{}", chosen.why);
            assert!(
                chosen.why.contains("cells/s on cpu (f64)") && chosen.why.contains("cells/s on gpu (f32)")
            );
        }
    }
}
