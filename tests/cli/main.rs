//! The program as scripts see it.

mod bench;
mod commands;
#[cfg(unix)]
mod faults;
mod map;
