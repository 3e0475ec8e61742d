//! `rattlemap bench work-precision`.

use anyhow::anyhow;

use crate::cli::BenchOptions;
use crate::error::Failure;

pub(crate) fn run(ask: &BenchOptions) -> Result<(), Failure> {
    Err(anyhow!("{}: not there yet", ask.out("work-precision").display()).into())
}
