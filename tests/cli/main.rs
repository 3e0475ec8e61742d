//! The program as scripts see it.

mod bench;
mod columns;
mod commands;
#[cfg(unix)]
mod faults;
mod map;
#[cfg(target_os = "linux")]
mod measure_gpu;
mod models;
mod text;
mod your_gears;
