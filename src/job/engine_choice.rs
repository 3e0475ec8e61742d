//! Chooses and opens the engine that computes a map.

mod adapters;

use std::str::FromStr;

use thiserror::Error;

use crate::gpu::{self, AdapterChoice, AdapterReport, GpuError, Precision};
use crate::map::engine::{Cpu, Engine, EngineError, Gpu, Prepared};
use crate::map::plan::Plan;
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
        /// A hardware GPU if there is one, else the processor. A software GPU is never chosen.
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
            match open_gpu(plan, precision, adapter.number, "a hardware GPU").await {
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
