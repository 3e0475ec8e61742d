//! Instruments: what the project measures about itself.

pub mod work_precision;
