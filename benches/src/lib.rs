//! Instruments: measurements that anybody can repeat.

pub mod stress;
pub mod work_precision;
