//! The instruments, one test binary.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

mod cli;
mod order;
mod scale;
mod stress;
