//! Results that need all records of a map, or of several maps: attractors and their basins, coexistence, hysteresis,
//! differences between two maps, and parameters without effect.

pub mod attractors;
pub mod coexistence;
pub mod compare;
pub mod effect;
pub mod hysteresis;
