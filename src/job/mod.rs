//! What every front end needs to run a job: find the model, load the scene, check capacity, choose and open an engine,
//! store records, finish, and explain how to continue. Nothing here prints or parses arguments.

#[cfg(feature = "cli")]
pub mod capacity;
#[cfg(feature = "gpu")]
pub mod engine_choice;
#[cfg(feature = "cli")]
pub mod error;
#[cfg(feature = "cli")]
pub mod forecast;
#[cfg(feature = "cli")]
pub mod model_choice;
#[cfg(feature = "cli")]
pub mod processor;
#[cfg(feature = "files")]
pub mod resumed_engine;
#[cfg(not(target_arch = "wasm32"))]
pub mod run;
#[cfg(feature = "cli")]
pub mod scene_file;

#[cfg(not(target_arch = "wasm32"))]
pub use run::{Map, MapCell, MapError, Processor, run};
