//! The instruments: which is asked for.

mod engines;
mod stability;
mod work_precision;

use crate::cli::Bench;
use crate::error::Failure;

pub(crate) fn run(ask: &Bench) -> Result<(), Failure> {
    match ask {
        Bench::WorkPrecision(ask) => work_precision::run(ask),
        Bench::Engines(ask) => engines::run(ask),
        Bench::Stability(ask) => stability::run(ask),
    }
}
