//! Results of an audit: how many filled cells are wrong, and by how much.

use super::errors::Errors;
use crate::map::statistics::{TWO_SIDED_95, TWO_SIDED_99, score_interval};

/// Results of an audit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Audit {
    /// Number of filled cells before the audit.
    pub filled: usize,
    /// Number of random filled cells that were integrated.
    pub sampled: usize,
    /// Number of sampled cells with a wrong filled value: class, period, symmetry if the scene requests it, and word or
    /// pattern if its changes are borders.
    pub wrong: usize,
    /// Number of sampled cells with a filled word.
    pub words: usize,
    /// Number of sampled cells with a wrong filled word.
    pub wrong_words: usize,
    /// Number of sampled cells with a filled pattern.
    pub patterns: usize,
    /// Number of sampled cells with a wrong filled pattern.
    pub wrong_patterns: usize,
    /// Errors of filled exponents, impacts and mesh fractions.
    pub errors: Errors,
}

/// Largest sample of an audit, in multiples of the first. An audit goes on if it finds too many wrong cells, but
/// possibly by chance. With 0.3 % allowed and 0.26 % wrong, one map in forty is then refined needlessly instead of one
/// in four. With 0.4 % wrong 38 % of the maps pass instead of 31 %; with 0.5 % wrong 15 % instead of 13 %.
const PROLONGED: usize = 16;

impl Audit {
    /// Returns the measured fraction of wrong filled cells.
    pub fn rate(&self) -> f64 {
        self.wrong as f64 / self.sampled.max(1) as f64
    }

    /// Returns the 95 % interval of [`Audit::rate`]. It ignores that the size of the sample depends on earlier results:
    /// after a longer audit its coverage may be 92 %.
    pub fn interval(&self) -> [f64; 2] {
        score_interval(self.wrong, self.sampled, TWO_SIDED_95)
    }

    /// Returns the number of further cells to audit until it is known whether more than `max_error` of the filled cells
    /// are wrong. `first` is the size of the first sample. At most a quarter of the filled cells is audited. The 99 %
    /// interval is used because the test is repeated and a needless refinement is expensive.
    pub(super) fn more(&self, first: usize, max_error: f64) -> usize {
        let most = (PROLONGED * first).min(self.filled / 4);
        let [low, _] = score_interval(self.wrong, self.sampled, TWO_SIDED_99);
        let is_open = self.rate() > max_error && low <= max_error && 2 * self.sampled <= most;
        if is_open { self.sampled } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_audit_goes_on_while_the_result_may_be_due_to_chance() {
        let more =
            |wrong, sampled, filled| Audit { filled, sampled, wrong, ..Audit::default() }.more(2000, 0.003);
        assert_eq!(more(6, 2000, 900_000), 0, "passed");
        assert_eq!(more(7, 2000, 900_000), 2000);
        assert_eq!(more(13, 2000, 900_000), 0, "significantly too many");
        assert_eq!(more(50, 16_000, 900_000), 16_000);
        assert_eq!(more(100, 32_000, 900_000), 0, "long enough");
        assert_eq!(more(7, 2000, 15_000), 0, "a quarter of what is filled");
    }
}
