//! Tests of the instruments.
//!
//! The lanes need an adapter; the tests fail without one: see `scripts/test.sh`.

mod cli;
mod order;
mod scale;
mod stress;
