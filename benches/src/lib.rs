//! Instruments: measurements that anybody can repeat.

pub mod scale;
pub mod stress;
pub mod work_precision;
