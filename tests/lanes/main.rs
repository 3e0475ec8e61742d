//! Lanes on a device, compared with the reference and with each other.

#[path = "../common/mod.rs"]
mod common;

mod chatter;
mod classes;
mod counters;
mod counting;
mod early_stops;
mod engines_agree;
mod independence;
mod kinds;
mod measures;
mod resonance;
mod shaders;
mod stored;
mod work;
