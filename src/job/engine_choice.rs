//! Which engine runs a map: the one that was asked for, or the fastest at hand.

mod adapters;

use std::str::FromStr;
#[cfg(not(target_arch = "wasm32"))]
use std::sync::Arc;

use thiserror::Error;
use web_time::{Duration, Instant};

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};
#[cfg(not(target_arch = "wasm32"))]
use crate::map::engine::Cards;
use crate::map::engine::{Cpu, Engine, EngineError, Gpu};
use crate::map::plan::{Cell, Plan};

use adapters::Taken;
pub use adapters::{AdapterError, Wanted};

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
    /// None leaves it to the environment, [`AdapterChoice::from_environment`]. With [`Who::Auto`] a graphics device is
    /// taken then.
    pub adapter: Option<Wanted>,
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
    /// Adapters that are left out where all are asked for, a line each.
    pub notes: Vec<String>,
    /// The same of those that fail.
    pub warnings: Vec<String>,
}

impl<'p> Chosen<'p> {
    fn plain(engine: Engine<'p>, why: String) -> Chosen<'p> {
        Chosen { engine, why, notes: Vec::new(), warnings: Vec::new() }
    }
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
    /// The reference runs on no adapter.
    #[error(
        "--adapter {wanted}: the CPU engine runs on no graphics adapter; leave --adapter out, or ask for --engine gpu"
    )]
    CpuOnAdapter {
        /// What was asked for.
        wanted: Wanted,
    },
    /// No adapter fits.
    #[error(transparent)]
    Adapter(#[from] AdapterError),
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
            ChoiceError::UnknownEngine { .. }
            | ChoiceError::CpuInF32
            | ChoiceError::CpuOnAdapter { .. }
            | ChoiceError::Adapter(_) => true,
            ChoiceError::Device(_) | ChoiceError::Engine(_) => false,
        }
    }
}

impl From<GpuError> for ChoiceError {
    fn from(error: GpuError) -> ChoiceError {
        match error {
            GpuError::NoAdapter { .. } => ChoiceError::Adapter(AdapterError::None(error)),
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
/// [`ChoiceError::CpuInF32`] and [`ChoiceError::CpuOnAdapter`].
pub fn check(ask: &Ask) -> Result<(), ChoiceError> {
    match (ask.engine, ask.precision, &ask.adapter) {
        (Who::Cpu, Some(Precision::F32), _) => Err(ChoiceError::CpuInF32),
        (Who::Cpu, _, Some(wanted)) => Err(ChoiceError::CpuOnAdapter { wanted: wanted.clone() }),
        _ => Ok(()),
    }
}

/// Opens the engine that is asked for; `auto` takes a hardware GPU if there is one, else the CPU, or for
/// long maps the faster of it and a software GPU on a few cells of the plan. Where the hardware lacks f64 and f64 is asked
/// for, `auto` takes the CPU, which has it; a software driver is taken beside hardware only where it is named.
///
/// # Errors
/// [`ChoiceError`], with nothing computed.
pub async fn open<'p>(plan: &'p Plan, ask: &Ask) -> Result<Chosen<'p>, ChoiceError> {
    check(ask)?;
    let (who, precision) = (ask.engine, ask.precision.unwrap_or(Precision::F32));
    if who == Who::Cpu {
        return Ok(on_cpu(plan, String::new()));
    }
    let (all, environment) = (gpu::adapters().await, AdapterChoice::from_environment());
    let taken = adapters::take(&all, ask.adapter.as_ref(), &environment, precision);
    let why = match (who, &ask.adapter, ask.precision) {
        (Who::Gpu | Who::Cpu, ..) => "",
        (Who::Auto, Some(_), _) => "by --adapter",
        (Who::Auto, None, Some(Precision::F32)) => "the CPU engine has no f32",
        (Who::Auto, None, _) => return choose(plan, precision, &all, taken).await,
    };
    on_gpu(plan, precision, taken?, why).await
}

fn on_cpu(plan: &Plan, why: String) -> Chosen<'_> {
    Chosen::plain(Engine::Cpu(Cpu::new(plan)), why)
}

async fn on_gpu<'p>(
    plan: &'p Plan,
    precision: Precision,
    taken: Taken,
    why: &str,
) -> Result<Chosen<'p>, ChoiceError> {
    let Taken { numbers, left_out: notes } = taken;
    #[cfg(not(target_arch = "wasm32"))]
    if numbers.len() > 1 {
        let (engine, warnings) = on_cards(plan, precision, &numbers)?;
        return Ok(Chosen { notes, warnings, ..Chosen::plain(engine, why.to_owned()) });
    }
    let device = open_device(precision, numbers[0]).await?;
    let engine = Engine::Gpu(Box::new(Gpu::new(plan, device).await?));
    Ok(Chosen { notes, ..Chosen::plain(engine, why.to_owned()) })
}

/// All of these adapters that can be opened, side by side; what is to be said of others.
///
/// # Errors
/// The first one's, if there is none.
#[cfg(not(target_arch = "wasm32"))]
fn on_cards(
    plan: &Plan,
    precision: Precision,
    numbers: &[usize],
) -> Result<(Engine<'static>, Vec<String>), ChoiceError> {
    let plan = Arc::new(plan.clone());
    let open = |number: usize| {
        let plan = Arc::clone(&plan);
        pollster::block_on(async {
            let device = open_device(precision, number).await?;
            let id = device.id();
            Ok::<_, ChoiceError>((id, Box::new(Gpu::shared(plan, device).await?)))
        })
    };
    let opened: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = numbers.iter().map(|&number| scope.spawn(move || open(number))).collect();
        threads.into_iter().map(|thread| thread.join()).collect()
    });
    let (mut cards, mut warnings, mut first_error) = (Vec::new(), Vec::new(), None);
    for (number, opened) in numbers.iter().zip(opened) {
        match opened.unwrap_or_else(|panic| std::panic::resume_unwind(panic)) {
            Ok(card) => cards.push(card),
            Err(error) => {
                warnings.push(format!("warning: adapter {number} is left out: {error}"));
                first_error.get_or_insert(error);
            }
        }
    }
    let engine = match (cards.len(), first_error) {
        (0, Some(error)) => return Err(error),
        (1, _) => Engine::Gpu(cards.remove(0).1),
        _ => {
            let engines = cards.into_iter().map(|(id, gpu)| (id, Engine::Gpu(gpu)));
            Engine::Cards(Box::new(Cards::new(engines.collect())))
        }
    };
    Ok((engine, warnings))
}

async fn open_device(precision: Precision, number: usize) -> Result<gpu::Gpu, ChoiceError> {
    Ok(gpu::Gpu::open(precision, &AdapterChoice::numbered(number)).await?)
}

/// What `auto` takes, where nothing but perhaps f64 is asked for.
async fn choose<'p>(
    plan: &'p Plan,
    precision: Precision,
    all: &[AdapterReport],
    taken: Result<Taken, AdapterError>,
) -> Result<Chosen<'p>, ChoiceError> {
    let environment = AdapterChoice::from_environment();
    let taken = match taken {
        Ok(taken) => taken,
        Err(AdapterError::NoCardHas { precision, cards, .. }) => {
            return Ok(on_cpu(plan, format!("no graphics card here has {precision}: {cards}")));
        }
        // It was named.
        Err(error) if environment.name.is_some() => return Err(error.into()),
        Err(_) => {
            let narrowed =
                gpu::narrowed_by(&environment).map_or(String::new(), |narrowed| format!("; {narrowed}"));
            return Ok(on_cpu(plan, format!("no graphics adapter with {}{narrowed}", precision.name())));
        }
    };
    let first = taken.numbers[0];
    let chosen = if gpu::is_hardware(&all[first].info) {
        on_gpu(plan, precision, taken, "a hardware GPU").await
    } else {
        faster(plan, precision, first).await
    };
    // The reference needs no driver.
    Ok(chosen.unwrap_or_else(|error| on_cpu(plan, error.to_string())))
}

/// The CPU where it has soon done the map, else the faster of it and a software GPU.
async fn faster(plan: &Plan, precision: Precision, adapter: usize) -> Result<Chosen<'_>, ChoiceError> {
    let trial = plan.shortened(TRIAL_PERIODS);
    let cpu_rate = rate(&trial, &mut Engine::Cpu(Cpu::new(&trial))).await?;
    if !is_worth_a_trial(plan, cpu_rate) {
        let why = format!(
            "no hardware GPU, and soon done: {cpu_rate:.0} cells/s on trial, {TRIAL_PERIODS} periods each"
        );
        return Ok(on_cpu(plan, why));
    }
    on_trial(plan, &trial, (precision, adapter), cpu_rate).await
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
    (precision, adapter): (Precision, usize),
    cpu_rate: f64,
) -> Result<Chosen<'p>, ChoiceError> {
    let device = open_device(precision, adapter).await?;
    let mut lanes = Engine::Gpu(Box::new(Gpu::new(trial, device).await?));
    // The first batch compiles the shader.
    lanes.run(&spread(trial, 0, 1)).await?;
    let gpu_rate = rate(trial, &mut lanes).await?;
    let name = precision.name();
    let why = format!(
        "on trial {cpu_rate:.0} cells/s on cpu (f64), {gpu_rate:.0} cells/s on gpu ({name}), {TRIAL_PERIODS} periods each"
    );
    match lanes {
        Engine::Gpu(lanes) if gpu_rate > cpu_rate => {
            let engine = Engine::Gpu(Box::new(Gpu::new(plan, lanes.into_device()).await?));
            Ok(Chosen::plain(engine, why))
        }
        _ => Ok(on_cpu(plan, why)),
    }
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
        let ask = Ask { engine: Who::Cpu, adapter: Some(Wanted::All), ..Ask::default() };
        assert!(check(&ask).is_err_and(|error| error.is_in_the_request()));
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
        for (cpu_rate, name) in [(1e9, "cpu"), (1e-3, "gpu")] {
            let chosen = pollster::block_on(on_trial(&plan, &trial, (Precision::F32, 0), cpu_rate))
                .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(chosen.engine.name(), name, "{}", chosen.why);
            assert!(
                chosen.why.contains("cells/s on cpu (f64)") && chosen.why.contains("cells/s on gpu (f32)")
            );
        }
    }
}
