//! Chooses and opens the engine that computes a map.

mod adapters;

use std::str::FromStr;

use thiserror::Error;

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};
#[cfg(not(target_arch = "wasm32"))]
use crate::map::engine::Cards;
use crate::map::engine::{Cpu, Engine, EngineError, Gpu, Prepared};
use crate::map::plan::Plan;

use adapters::Selection;
pub use adapters::{AdapterError, AdapterRequest};

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

/// Kind of engine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EngineKind {
    /// A hardware GPU if there is one, else the processor. A software GPU is never chosen.
    #[default]
    Auto,
    /// Lanes on a graphics device.
    Gpu,
    /// The event-driven reference on all processor cores, in f64.
    Cpu,
}

/// An open engine and the reason for its choice.
pub struct ChosenEngine<'p> {
    /// The engine, ready to compute cells of the plan.
    pub engine: Engine<'p>,
    /// Reason for the choice. Empty if the request left no choice.
    pub reason: String,
    /// One line for each adapter that was not used because it differs from the first one.
    pub notes: Vec<String>,
    /// One line for each adapter that was not used because it could not be opened.
    pub warnings: Vec<String>,
}

impl<'p> ChosenEngine<'p> {
    fn new(engine: Engine<'p>, reason: String) -> ChosenEngine<'p> {
        ChosenEngine { engine, reason, notes: Vec::new(), warnings: Vec::new() }
    }

    fn cpu(plan: &'p Plan, reason: impl Into<String>) -> ChosenEngine<'p> {
        ChosenEngine::new(Engine::Cpu(Cpu::new(plan)), reason.into())
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
        match name {
            "auto" => Ok(EngineKind::Auto),
            "gpu" => Ok(EngineKind::Gpu),
            "cpu" => Ok(EngineKind::Cpu),
            _ => Err(ChoiceError::UnknownEngine { name: name.to_owned() }),
        }
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

/// Opens the requested engine. `auto` takes a hardware GPU if there is one that has the precision, else the processor.
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
            selection if is_hardware(&selection, &all) => {
                open_gpu(plan, precision, selection, "the CPU engine has no f32").await
            }
            _ => Err(ChoiceError::AutoInF32),
        },
        (EngineKind::Auto, None) => choose(plan, precision, &all, &environment, selection).await,
        (EngineKind::Auto, Some(_)) => open_gpu(plan, precision, selection?, "--adapter names it").await,
        (EngineKind::Gpu | EngineKind::Cpu, _) => open_gpu(plan, precision, selection?, "").await,
    }
}

fn is_hardware(selection: &Selection, all: &[AdapterReport]) -> bool {
    gpu::is_hardware(&all[selection.numbers[0]].info)
}

/// Chooses the engine of `auto` if neither an adapter nor f32 is requested.
async fn choose<'p>(
    plan: &'p Plan,
    precision: Precision,
    all: &[AdapterReport],
    environment: &AdapterChoice,
    selection: Result<Selection, AdapterError>,
) -> Result<ChosenEngine<'p>, ChoiceError> {
    let reason = match selection {
        Ok(selection) if is_hardware(&selection, all) => {
            match open_gpu(plan, precision, selection, "a hardware GPU").await {
                Ok(chosen) => return Ok(chosen),
                Err(error) => error.to_string(),
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

async fn open_gpu<'p>(
    plan: &'p Plan,
    precision: Precision,
    selection: Selection,
    reason: &str,
) -> Result<ChosenEngine<'p>, ChoiceError> {
    let Selection { numbers, left_out: notes } = selection;
    #[cfg(not(target_arch = "wasm32"))]
    if numbers.len() > 1 {
        let (engine, warnings) = open_cards(plan, precision, &numbers)?;
        return Ok(ChosenEngine { engine, reason: reason.to_owned(), notes, warnings });
    }
    #[cfg(not(target_arch = "wasm32"))]
    let (prepared, device) = {
        let open = || pollster::block_on(open_device(precision, numbers[0]));
        let (prepared, device) = rayon::join(|| Prepared::new(plan), open);
        (prepared, device?)
    };
    #[cfg(target_arch = "wasm32")]
    let (prepared, device) = (Prepared::new(plan), open_device(precision, numbers[0]).await?);
    let engine = Engine::Gpu(Box::new(Gpu::prepared(prepared, device).await?));
    Ok(ChosenEngine { notes, ..ChosenEngine::new(engine, reason.to_owned()) })
}

/// Opens several adapters as one engine. Returns one warning for each adapter that cannot be opened.
///
/// # Errors
/// The error of the first adapter if none can be opened.
#[cfg(not(target_arch = "wasm32"))]
fn open_cards(
    plan: &Plan,
    precision: Precision,
    numbers: &[usize],
) -> Result<(Engine<'static>, Vec<String>), ChoiceError> {
    let prepared = Prepared::new(plan).into_owned();
    let open = |number: usize| {
        let prepared = prepared.clone();
        pollster::block_on(async {
            let device = open_device(precision, number).await?;
            let id = device.id();
            Ok::<_, ChoiceError>((id, Box::new(Gpu::prepared(prepared, device).await?)))
        })
    };
    let opened: Vec<_> = std::thread::scope(|scope| {
        let open = &open;
        let spawn = |&number: &usize| {
            let thread = std::thread::Builder::new().spawn_scoped(scope, move || open(number));
            // If no thread can be started, this one opens the device.
            thread.map_err(|_| open(number))
        };
        let threads: Vec<_> = numbers.iter().map(spawn).collect();
        threads.into_iter().map(|thread| thread.map_or_else(Ok, |thread| thread.join())).collect()
    });
    let (mut cards, mut warnings, mut first_error) = (Vec::new(), Vec::new(), None);
    for (number, opened) in numbers.iter().zip(opened) {
        match opened.unwrap_or_else(|panic| std::panic::resume_unwind(panic)) {
            Ok(card) => cards.push(card),
            Err(error) => {
                warnings.push(format!("adapter {number} is left out: {error}"));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_request_are_told_from_failures_of_a_device() {
        assert!(ChoiceError::CpuInF32.is_usage());
        let request = EngineRequest {
            kind: EngineKind::Cpu,
            adapter: Some(AdapterRequest::All),
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
