//! Lanes on a device, compared with the reference and with each other.

#[path = "../common/mod.rs"]
mod common;

/// Random machines and numbers, as the tests of the reference draw them.
#[path = "."]
mod independent {
    #[allow(dead_code, reason = "machines need the numbers alone")]
    #[path = "../../dynamics/tests/core/independent/random.rs"]
    pub(crate) mod random;
}
#[path = "../../dynamics/tests/core/machines/random.rs"]
mod random_machines;

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
