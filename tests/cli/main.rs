//! The program as scripts see it.

mod bench;
mod commands;
mod map;
mod text;
