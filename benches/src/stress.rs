//! Numerical stress: tests of both engines where computations of this kind tend to fail.
//!
//! Each of the eight parts compares errors with bounds: long runs ([`long_runs`]), the laws of impact ([`impacts`]), the
//! approach to grazing ([`grazing`]), chatter as restitution goes to one ([`chatter`]), stiff meshing ([`stiffness`]), coarse
//! grids ([`grid`]), the work of single cells ([`work`]) and random parameters ([`fuzz`]). The correct answer is a closed form
//! if there is one, else the reference's result. The allowed error follows from how far the reference itself moves when starts
//! and parameters move within rounding. `tests/instruments` runs every part.

mod cells;
pub mod chatter;
pub mod fuzz;
pub mod grazing;
pub mod grid;
pub mod impacts;
mod lanes;
pub mod long_runs;
mod readout;
pub mod stiffness;
pub mod work;

pub use lanes::Lanes;

use rattlemap::record::distance::is_within;

/// Seed of all random cells. It is constant, so every run computes the same cells.
const SEED: u64 = 1;

/// Errors of a part, each with the largest value that it may have.
#[derive(Clone, Debug, Default)]
pub struct Checks {
    list: Vec<Check>,
}

#[derive(Clone, Debug)]
struct Check {
    what: String,
    error: f64,
    bar: f64,
}

impl Checks {
    /// Adds an error that may be at most `bar`. One that is not finite is never allowed.
    fn add(&mut self, error: f64, bar: f64, what: impl Into<String>) {
        self.list.push(Check { what: what.into(), error, bar });
    }

    /// Adds a condition.
    fn require(&mut self, holds: bool, what: impl Into<String>) {
        self.add(if holds { 0.0 } else { f64::INFINITY }, 0.0, what);
    }

    /// Returns the number of errors and conditions.
    pub fn count(&self) -> usize {
        self.list.len()
    }

    /// Describes the errors above their bounds and the conditions that do not hold.
    pub fn failures(&self) -> Vec<String> {
        let failed = self.list.iter().filter(|check| !is_within(check.error, check.bar));
        failed.map(|Check { what, error, bar }| format!("{what}: {error:e} above {bar:e}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_is_not_finite_fails() {
        let mut checks = Checks::default();
        checks.add(1.0, 1.0, "good");
        checks.require(true, "good");
        assert!(checks.failures().is_empty());
        for error in [f64::NAN, f64::INFINITY, 1.5] {
            let bar = if error.is_finite() { 1.0 } else { f64::INFINITY };
            checks.add(error, bar, "bad");
        }
        checks.require(false, "bad");
        assert_eq!((checks.failures().len(), checks.count()), (4, 6));
    }
}
