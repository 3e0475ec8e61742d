//! Lanes on a device, compared with the reference and with each other.

/// Random machines and numbers, as the tests of the reference draw them.
#[path = "../../dynamics/tests/core"]
mod random_models {
    pub(crate) mod independent {
        #[allow(dead_code, reason = "machines need the numbers alone")]
        pub(crate) mod random;
    }
    pub(crate) mod machines {
        #[allow(dead_code, reason = "the tests of the reference use the rest")]
        pub(crate) mod random;
    }
}

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
