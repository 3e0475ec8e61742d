//! Lanes on a device, compared with the reference and with each other.

mod chatter;
mod classes;
mod confirm_chaos;
mod counters;
mod counting;
mod early_stops;
mod engines_agree;
mod features;
mod growth;
mod independence;
mod kinds;
mod machines;
mod measures;
mod neutral;
mod resonance;
mod shaders;
mod standard_errors;
mod stored;
mod work;
