//! Chooses and opens the engine that computes a map.

mod adapters;

use std::str::FromStr;

use thiserror::Error;

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};
use crate::job::processor;
use crate::map::engine::{Cpu, Engine, EngineError, Gpu, Prepared};
use crate::map::plan::Plan;
use rattlemap_dynamics::model::Form;
use rattlemap_dynamics::named;

pub use adapters::{AdapterError, AdapterRequest, AdapterTextError};

/// A request for an engine. The default leaves everything to the program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EngineRequest {
    /// Kind of engine.
    pub kind: EngineKind,
    /// Precision of the motion. None: f32 on a graphics device, f64 on the processor.
    pub precision: Option<Precision>,
    /// Graphics adapter. None: the environment decides, see [`AdapterChoice::from_environment`]. With
    /// [`EngineKind::Auto`] a named adapter selects the GPU engine.
    pub adapter: Option<AdapterRequest>,
}

named! {
    /// Kind of engine.
    #[derive(Default)]
    pub enum EngineKind {
        /// A hardware GPU for maps that it computes sooner than the processor, else the processor. A software GPU is never chosen.
        #[default]
        Auto = "auto",
        /// Lanes on a graphics device.
        Gpu = "gpu",
        /// The event-driven reference on all processor cores, in f64.
        Cpu = "cpu",
    }
}

/// An open engine and the reason for its choice.
pub struct ChosenEngine<'p> {
    /// The engine, ready to compute cells of the plan.
    pub engine: Engine<'p>,
    /// Reason for the choice. Empty if the request left no choice.
    pub reason: String,
}

impl<'p> ChosenEngine<'p> {
    fn cpu(plan: &'p Plan, reason: impl Into<String>) -> ChosenEngine<'p> {
        ChosenEngine { engine: Engine::Cpu(Cpu::new(plan)), reason: reason.into() }
    }
}

/// An error in choosing or opening an engine.
#[derive(Debug, Error)]
pub enum ChoiceError {
    /// No engine has this name.
    #[error("unknown engine {name:?}; it must be auto, gpu or cpu")]
    UnknownEngine {
        /// The name.
        name: String,
    },
    /// The CPU engine has no f32.
    #[error("--precision f32: the CPU engine computes in f64; leave out --precision, or give --engine gpu")]
    CpuInF32,
    /// `auto` uses only hardware GPUs, and the CPU engine has no f32.
    #[error(
        "--precision f32: there is no hardware GPU, and the CPU engine computes in f64; leave out --precision, or give \
         --engine gpu to use a software driver"
    )]
    AutoInF32,
    /// The CPU engine uses no graphics adapter.
    #[error(
        "--adapter {adapter}: the CPU engine uses no graphics adapter; leave out --adapter, or give --engine gpu"
    )]
    CpuOnAdapter {
        /// The requested adapter.
        adapter: AdapterRequest,
    },
    /// No adapter matches the request.
    #[error(transparent)]
    Adapter(#[from] AdapterError),
    /// The device exists, but cannot be used.
    #[error(transparent)]
    Device(GpuError),
    /// The engine failed while it was prepared.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl ChoiceError {
    /// Whether the request is wrong. Otherwise a device failed.
    pub fn is_usage(&self) -> bool {
        match self {
            ChoiceError::Engine(error) => matches!(error, EngineError::NotOnLanes { .. }),
            error => !matches!(error, ChoiceError::Device(_)),
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

impl FromStr for EngineKind {
    type Err = ChoiceError;

    fn from_str(name: &str) -> Result<EngineKind, ChoiceError> {
        EngineKind::named(name).ok_or_else(|| ChoiceError::UnknownEngine { name: name.to_owned() })
    }
}

/// Rejects requests that no engine can satisfy.
///
/// # Errors
/// [`ChoiceError::CpuInF32`] and [`ChoiceError::CpuOnAdapter`].
pub fn check(request: &EngineRequest) -> Result<(), ChoiceError> {
    match (request.kind, request.precision, &request.adapter) {
        (EngineKind::Cpu, Some(Precision::F32), _) => Err(ChoiceError::CpuInF32),
        (EngineKind::Cpu, _, Some(adapter)) => Err(ChoiceError::CpuOnAdapter { adapter: adapter.clone() }),
        _ => Ok(()),
    }
}

/// Opens the requested engine. `auto` takes a hardware GPU that has the precision if the map has enough cells, else the processor.
/// It decides by the number of cells and cores, and by the kind of card; by a short measurement only on a card that is not known.
///
/// # Errors
/// [`ChoiceError`] if the engine cannot be opened.
pub async fn open<'p>(plan: &'p Plan, request: &EngineRequest) -> Result<ChosenEngine<'p>, ChoiceError> {
    check(request)?;
    if request.kind == EngineKind::Cpu {
        return Ok(ChosenEngine::cpu(plan, ""));
    }
    let precision = request.precision.unwrap_or(Precision::F32);
    let (all, environment) = (gpu::adapters().await, AdapterChoice::from_environment());
    let selection = adapters::select(&all, request.adapter.as_ref(), &environment, precision);
    match (request.kind, &request.adapter) {
        (EngineKind::Auto, None) if request.precision == Some(Precision::F32) => match selection? {
            adapter if gpu::is_hardware(&adapter.info) => {
                open_gpu(plan, precision, adapter.number, "the CPU engine has no f32").await
            }
            _ => Err(ChoiceError::AutoInF32),
        },
        (EngineKind::Auto, None) => choose(plan, precision, &environment, selection).await,
        (EngineKind::Auto, Some(_)) => {
            open_gpu(plan, precision, selection?.number, "--adapter names it").await
        }
        (EngineKind::Gpu | EngineKind::Cpu, _) => open_gpu(plan, precision, selection?.number, "").await,
    }
}

/// Chooses the engine of `auto` if neither an adapter nor f32 is requested.
async fn choose<'p>(
    plan: &'p Plan,
    precision: Precision,
    environment: &AdapterChoice,
    selection: Result<&AdapterReport, AdapterError>,
) -> Result<ChosenEngine<'p>, ChoiceError> {
    let reason = match selection {
        Ok(adapter) if gpu::is_hardware(&adapter.info) => {
            let preferred =
                preferred(Load::of(plan), processor::cores(), precision, is_known(&adapter.info.name));
            match on_card(plan, precision, adapter.number, preferred).await {
                Ok(chosen) => return Ok(chosen),
                Err(reason) => reason,
            }
        }
        Err(AdapterError::NoCardHas { precision, cards, .. }) => {
            format!("no graphics card has {precision} ({cards})")
        }
        // The environment names an adapter that does not exist.
        Err(error) if environment.name.is_some() => return Err(error.into()),
        Err(_) | Ok(_) => {
            let narrowed = gpu::narrowed_by(environment).map_or(String::new(), |text| format!(" ({text})"));
            format!("no hardware GPU{narrowed}")
        }
    };
    Ok(ChosenEngine::cpu(plan, format!("{reason}; using the processor")))
}

/// What decides between a card and the processor.
#[derive(Clone, Copy, Debug)]
struct Load {
    /// Number of cells that can be under way together.
    cells: usize,
    is_for_processor: bool,
}

impl Load {
    fn of(plan: &Plan) -> Load {
        // Lanes compare positions with their shift along rigid-body modes.
        let needs_reference = |form| match form {
            Form::Machine(_) => true,
            Form::Pair(pair) => !pair.rigid_modes().modes.is_empty(),
        };
        let is_for_processor = plan.flow_count() > 0 && needs_reference(plan.form(0));
        let cells = match plan.policy().follows() {
            true => plan.counts()[0],
            // Most cells of an adaptive map are filled.
            false if plan.refine().is_some() => plan.run_count() / REFINED,
            false => plan.run_count(),
        };
        Load { cells, is_for_processor }
    }
}

/// An adaptive map integrates about one cell of this many.
const REFINED: usize = 8;

/// Number of cells per processor core below which the processor computes a map sooner. The main map of 262,144 cells takes an H200
/// 3.6 s and sixteen cores 3.0 s; a card with that many lanes waits for its slowest ones (results/h200).
const CELLS_PER_CORE: usize = 19_000;

/// Largest ratio of the times of lanes in f64 and in f32 on cards that compute f64 fast.
const SLOWER_IN_F64: usize = 2;

/// Cards for which [`CELLS_PER_CORE`] was measured.
const KNOWN: [&str; 1] = ["H200"];

/// Returns a number with its thousands apart.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    groups.map(String::from_utf8_lossy).collect::<Vec<_>>().join(",")
}

fn is_known(name: &str) -> bool {
    name.split_whitespace().any(|word| KNOWN.contains(&word))
}

/// The engine that `auto` prefers on a machine with a card, and the reason.
#[derive(Debug, PartialEq, Eq)]
enum Preferred {
    Processor(String),
    Card(String),
    /// The card, if a trial shows that it is much faster.
    Trial,
}

fn preferred(load: Load, cores: usize, precision: Precision, is_known: bool) -> Preferred {
    if load.is_for_processor {
        let reason = "the processor is for models that drift or are not one or two coordinates with one gap";
        return Preferred::Processor(reason.to_owned());
    }
    let least = CELLS_PER_CORE * cores * if precision == Precision::F64 { SLOWER_IN_F64 } else { 1 };
    let (cells, bound) = (grouped(load.cells), grouped(least));
    match (load.cells < least, is_known) {
        (true, _) => Preferred::Processor(format!(
            "{cells} cells at a time: the processor is faster below about {bound}"
        )),
        (false, true) => {
            Preferred::Card(format!("{cells} cells at a time: the card is faster from about {bound} on"))
        }
        (false, false) => Preferred::Trial,
    }
}

/// Speed of lanes on an unknown card, relative to the processor, from which on `auto` takes the card. The measured speed varies, and the
/// choice should not.
const MUCH_FASTER: f64 = 2.0;

/// Opens a card if `preferred` says so. Otherwise returns why the processor computes the map.
async fn on_card<'p>(
    plan: &'p Plan,
    precision: Precision,
    number: usize,
    preferred: Preferred,
) -> Result<ChosenEngine<'p>, String> {
    let reason = match preferred {
        Preferred::Processor(reason) => return Err(reason),
        Preferred::Card(reason) => Some(reason),
        Preferred::Trial => None,
    };
    let opened = open_gpu(plan, precision, number, reason.as_deref().unwrap_or_default()).await;
    let mut chosen = opened.map_err(|error| error.to_string())?;
    if let (None, Engine::Gpu(lanes)) = (reason, &mut chosen.engine) {
        let ratio = lanes.speed().await.map_err(|error| error.to_string())?;
        if ratio < MUCH_FASTER {
            return Err(format!(
                "a trial on the card was {ratio:.1} times as fast, and less than {MUCH_FASTER} does not count"
            ));
        }
        chosen.reason = format!("a trial on the card was {ratio:.1} times as fast as the processor");
    }
    Ok(chosen)
}

async fn open_gpu<'p>(
    plan: &'p Plan,
    precision: Precision,
    number: usize,
    reason: &str,
) -> Result<ChosenEngine<'p>, ChoiceError> {
    #[cfg(not(target_arch = "wasm32"))]
    let (prepared, device) = {
        let open = || pollster::block_on(open_device(precision, number));
        let (prepared, device) = rayon::join(|| Prepared::new(plan), open);
        (prepared, device?)
    };
    #[cfg(target_arch = "wasm32")]
    let (prepared, device) = (Prepared::new(plan), open_device(precision, number).await?);
    let engine = Engine::Gpu(Box::new(Gpu::prepared(prepared, device).await?));
    Ok(ChosenEngine { engine, reason: reason.to_owned() })
}

async fn open_device(precision: Precision, number: usize) -> Result<gpu::Gpu, ChoiceError> {
    Ok(gpu::Gpu::open(precision, &AdapterChoice::numbered(number)).await?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::test_plan;

    #[test]
    fn a_card_needs_many_cells() {
        let map = |cells| Load { cells, is_for_processor: false };
        let choose = |load, cores, precision, is_known| preferred(load, cores, precision, is_known);
        let small = choose(map(10_000), 16, Precision::F32, true);
        let Preferred::Processor(reason) = small else { panic!("{small:?}") };
        assert_eq!(reason, "10,000 cells at a time: the processor is faster below about 304,000");
        assert!(matches!(choose(map(1 << 20), 16, Precision::F32, true), Preferred::Card(_)));
        assert_eq!(choose(map(1 << 20), 16, Precision::F32, false), Preferred::Trial);
        // Fewer cores take longer; f64 needs more cells.
        assert!(matches!(choose(map(50_000), 2, Precision::F32, true), Preferred::Card(_)));
        assert!(matches!(choose(map(50_000), 2, Precision::F64, true), Preferred::Processor(_)));
        let machine = Load { is_for_processor: true, ..map(1 << 24) };
        assert!(matches!(choose(machine, 1, Precision::F32, true), Preferred::Processor(_)));
        assert!(is_known("NVIDIA H200") && !is_known("NVIDIA GH200"));
    }

    /// Rows that depend on each other, and adaptive maps, keep fewer cells under way.
    #[test]
    fn only_cells_that_can_run_together_count() {
        let load = |more: &str| Load::of(&test_plan([("e", 8), ("omega", 100)], more)).cells;
        assert_eq!(load(""), 800);
        assert_eq!(load("[start]\npolicy = \"up\"\n"), 8);
        assert_eq!(load("[refine]\n"), 100);
    }

    #[test]
    fn errors_of_the_request_are_told_from_failures_of_a_device() {
        assert!(ChoiceError::CpuInF32.is_usage());
        let request = EngineRequest {
            kind: EngineKind::Cpu,
            adapter: Some(AdapterRequest::Number(0)),
            ..EngineRequest::default()
        };
        assert!(check(&request).is_err_and(|error| error.is_usage()));
        assert!(
            "gpu2".parse::<EngineKind>().unwrap_err().to_string().contains("it must be auto, gpu or cpu")
        );
        let no = GpuError::NoAdapter { wanted: "at all".into(), remedy: "r".into(), found: "none".into() };
        assert!(ChoiceError::from(no).is_usage());
        assert!(!ChoiceError::from(GpuError::Lost { message: "gone".into() }).is_usage());
    }
}
