//! What every front end needs to run a job: find the model, load the scene, check the machine, open an engine, store
//! records, finish, list, check, compare and validate. Nothing here prints or parses arguments.

#[cfg(feature = "job")]
pub mod check;
#[cfg(feature = "job")]
pub mod compare;
#[cfg(feature = "job")]
pub mod devices;
#[cfg(feature = "job")]
pub mod dry_run;
#[cfg(feature = "gpu")]
pub mod engine_choice;
#[cfg(feature = "job")]
pub mod environment;
#[cfg(feature = "job")]
pub mod error;
#[cfg(feature = "job")]
mod finished;
#[cfg(feature = "job")]
pub mod forecast;
#[cfg(feature = "job")]
pub mod map;
#[cfg(feature = "job")]
pub mod model_choice;
#[cfg(feature = "job")]
pub mod models;
#[cfg(feature = "job")]
pub mod observer;
#[cfg(feature = "job")]
pub mod processor;
#[cfg(feature = "job")]
pub mod run;
#[cfg(feature = "job")]
pub mod scene_file;
#[cfg(feature = "job")]
pub mod size;
#[cfg(feature = "job")]
pub mod validate;

#[cfg(feature = "job")]
pub use run::{Map, MapCell, Processor, run};
