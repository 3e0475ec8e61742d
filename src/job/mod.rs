//! Jobs of every front end: find the model, load the scene, check the machine, open an engine, store records, finish,
//! list, check, compare and validate. This layer prints nothing and parses no arguments.

pub mod check;
pub mod compare;
pub mod curves;
pub mod devices;
pub mod engine_choice;
pub mod environment;
pub mod error;
pub mod explore;
mod finished;
pub mod forecast;
pub mod map;
pub mod model_choice;
pub mod model_engine;
pub mod models;
pub mod observer;
pub mod processor;
pub mod refined_cycle;
pub mod run;
pub mod scene_file;
pub mod size;
pub mod validate;

pub use run::{Map, MapCell, Processor, run};
