//! The instruments: ask, measure, write, judge.

pub(crate) mod scale;
pub(crate) mod stress;
pub(crate) mod work_precision;
