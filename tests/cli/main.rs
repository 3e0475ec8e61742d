//! The program as scripts see it.

mod bench;
mod bifurcation;
#[cfg(unix)]
mod cards;
mod columns;
mod commands;
mod common;
mod compare;
#[cfg(unix)]
mod faults;
mod from_start;
#[cfg(unix)]
mod interrupts;
mod labels;
mod map;
#[cfg(target_os = "linux")]
mod measure_gpu;
mod models;
mod orbit_tables;
#[cfg(target_os = "linux")]
mod power_cuts;
mod run_up;
#[cfg(target_os = "linux")]
mod slurm;
mod systems;
mod text;
mod your_gears;
