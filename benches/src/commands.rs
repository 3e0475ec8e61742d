//! The instruments' commands.

pub(crate) mod host_cost;
pub(crate) mod machines;
pub(crate) mod work_precision;
