//! Tests of the instruments.
//!
//! The lanes need an adapter; the tests fail without one: see `scripts/test.sh`.

mod cli;
mod host_cost;
mod order;
mod stress;
