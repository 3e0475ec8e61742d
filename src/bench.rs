//! Instruments: measurements that anybody can repeat. `rattlemap bench` runs them.

pub mod engines;
pub mod stability;
pub mod statistics;
pub mod work_precision;
