//! The audit of filled cells: how many of them are wrong?

use crate::random::Random;

/// What an audit measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Audit {
    /// Filled cells before it.
    pub filled: usize,
    /// Cells of them that were integrated, chosen at random.
    pub sampled: usize,
    /// Those among them that had been filled wrongly: class, period, symmetry where it is
    /// asked for, and the word where it makes borders.
    pub wrong: usize,
    /// Those that had been filled with a word.
    pub words: usize,
    /// Those that had been filled with another word than their own.
    pub wrong_words: usize,
}

/// The 97.5 % point of the normal distribution.
const TWO_SIDED_95: f64 = 1.959964;

impl Audit {
    /// The measured fraction of wrongly filled cells.
    pub fn rate(&self) -> f64 {
        self.wrong as f64 / self.sampled.max(1) as f64
    }

    /// Its 95 % interval: Wilson's score interval (J. Am. Stat. Assoc. 22, 1927), which is
    /// sound for small counts, too.
    pub fn interval(&self) -> [f64; 2] {
        let (n, rate, z2) = (self.sampled.max(1) as f64, self.rate(), TWO_SIDED_95 * TWO_SIDED_95);
        let centre = rate + z2 / (2.0 * n);
        let half = TWO_SIDED_95 * (rate * (1.0 - rate) / n + z2 / (4.0 * n * n)).sqrt();
        [((centre - half) / (1.0 + z2 / n)).max(0.0), ((centre + half) / (1.0 + z2 / n)).min(1.0)]
    }
}

/// `count` of the `candidates`, chosen at random by `seed`.
pub(super) fn sample(mut candidates: Vec<u32>, count: usize, seed: u64) -> Vec<u32> {
    Random::new(seed).draw(&mut candidates, count);
    candidates.truncate(count);
    candidates
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_the_textbook() {
        let audit = |wrong, sampled| Audit { filled: 10_000, sampled, wrong, words: 0, wrong_words: 0 };
        // R: binom::binom.confint(10, 1000, methods = "wilson")
        let [low, high] = audit(10, 1000).interval();
        assert!((low - 0.005_441).abs() < 1e-5 && (high - 0.018_309).abs() < 1e-5, "{low} {high}");
        let [low, high] = audit(0, 2000).interval();
        assert!(low < 1e-12 && (high - 0.001_917).abs() < 1e-5, "{high}");
    }
}
