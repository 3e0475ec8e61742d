//! The audit of filled cells: how many of them are wrong, and by how much?

use super::errors::Errors;
use crate::map::statistics::{TWO_SIDED_95, TWO_SIDED_99, score_interval};

/// What an audit measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Audit {
    /// Filled cells before it.
    pub filled: usize,
    /// Cells of them that were integrated, chosen at random.
    pub sampled: usize,
    /// Those among them that had been filled wrongly: class, period, symmetry where it is
    /// asked for, and the word or pattern where it makes borders.
    pub wrong: usize,
    /// Those that had been filled with a word.
    pub words: usize,
    /// Those that had been filled with another word than their own.
    pub wrong_words: usize,
    /// Those that had been filled with a pattern.
    pub patterns: usize,
    /// Those that had been filled with another pattern than their own.
    pub wrong_patterns: usize,
    /// By how much exponents, impacts and mesh fractions had been filled wrongly.
    pub errors: Errors,
}

/// An audit that finds too many wrong cells, but no more than chance may put into its sample, goes on to
/// this many times the sample: of maps with 0.26 % wrong one in forty is refined for bad luck where
/// 0.3 % are allowed, not one in four; of those with 0.4 % wrong 38 % pass, not 31, and of those with 0.5 %
/// 15, not 13.
const PROLONGED: usize = 16;

impl Audit {
    /// The measured fraction of wrongly filled cells.
    pub fn rate(&self) -> f64 {
        self.wrong as f64 / self.sampled.max(1) as f64
    }

    /// Its 95 % interval: Wilson's score interval (J. Am. Stat. Assoc. 22, 1927), which is
    /// sound for small counts, too. That the sample's size depends on what was found is left out: an audit
    /// that went on may cover 92 %.
    pub fn interval(&self) -> [f64; 2] {
        score_interval(self.wrong, self.sampled, TWO_SIDED_95)
    }

    /// How many cells more are to be audited before it is known whether more than `max_error` of the
    /// filled ones are wrong; `first` were audited at first. At most a quarter of a small map is.
    pub(super) fn more(&self, first: usize, max_error: f64) -> usize {
        let most = (PROLONGED * first).min(self.filled / 4);
        let [surely, _] = score_interval(self.wrong, self.sampled, TWO_SIDED_99);
        let is_open = self.rate() > max_error && surely <= max_error && 2 * self.sampled <= most;
        if is_open { self.sampled } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_audit_goes_on_while_chance_may_have_its_hand_in_it() {
        let more =
            |wrong, sampled, filled| Audit { filled, sampled, wrong, ..Audit::default() }.more(2000, 0.003);
        assert_eq!(more(6, 2000, 900_000), 0, "passed");
        assert_eq!(more(7, 2000, 900_000), 2000);
        assert_eq!(more(13, 2000, 900_000), 0, "surely too many");
        assert_eq!(more(50, 16_000, 900_000), 16_000);
        assert_eq!(more(100, 32_000, 900_000), 0, "long enough");
        assert_eq!(more(7, 2000, 15_000), 0, "a quarter of what is filled");
    }
}
