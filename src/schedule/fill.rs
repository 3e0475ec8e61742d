//! Filling a block whose corners agree.

use super::blocks::Block;
use super::label::word_of;
use crate::classify::classify;
use crate::orbit::Class;
use crate::record::{Record, valid};

/// What fills one block: what does not depend on the cell is found once.
pub(super) struct Filling<'r> {
    block: Block,
    corners: [&'r Record; 4],
    /// What all corners know, by the bits of [`valid`].
    valid: u32,
    /// Whether the cells next to each corner get averages.
    averages: [bool; 4],
}

impl<'r> Filling<'r> {
    /// From the records of a block's corners, in the order of [`Block::corners`].
    pub(super) fn new(block: &Block, corners: [&'r Record; 4]) -> Filling<'r> {
        let common = corners.iter().fold(u32::MAX, |bits, corner| bits & corner.valid);
        let mut valid = common & !valid::STROBE | valid::FILLED;
        let first = word_of(corners[0]);
        if corners[1..].iter().any(|corner| word_of(corner) != first) {
            valid &= !valid::WORD;
        }
        let averages = corners.map(|nearest| {
            let class = classify(&Record { valid, ..*nearest });
            // Of undecided cells an average might be a decision.
            let decided = matches!(class, Class::Periodic { .. } | Class::Chaotic);
            decided && corners.iter().all(|corner| classify(corner) == class)
        });
        Filling { block: *block, corners, valid, averages }
    }

    /// The record of a cell of the block: the nearest corner's, with bilinear averages of what
    /// varies continuously inside a region. A word is filled where all corners have the same.
    pub(super) fn record(&self, [i, j]: [usize; 2]) -> Record {
        let share = |at: usize, [from, to]: [usize; 2]| {
            if to > from { (at - from) as f64 / (to - from) as f64 } else { 0.0 }
        };
        let (u, v) = (share(i, self.block.i), share(j, self.block.j));
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let nearest = usize::from(u >= 0.5) + 2 * usize::from(v >= 0.5);
        let average = |field: fn(&Record) -> f64| {
            self.corners.iter().zip(weights).map(|(corner, weight)| weight * field(corner)).sum::<f64>()
        };
        let filled = Record { periods_run: 0, strobe: [0.0; 4], valid: self.valid, ..*self.corners[nearest] };
        if !self.averages[nearest] {
            return filled;
        }
        Record {
            lyapunov: average(|corner| corner.lyapunov),
            lyapunov_error: average(|corner| corner.lyapunov_error),
            impacts_per_period: average(|corner| corner.impacts_per_period),
            mesh_fraction: average(|corner| corner.mesh_fraction),
            ..filled
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::word::Word;

    fn corner(lyapunov: f64) -> Record {
        let valid = valid::PERIOD | valid::LYAPUNOV | valid::STROBE;
        Record { period: 2, lyapunov, valid, periods_run: 99, ..Record::default() }
    }

    #[test]
    fn continuous_quantities_are_interpolated() {
        let block = Block { i: [0, 4], j: [0, 2] };
        let corners = [0.0, 4.0, 2.0, 6.0].map(corner);
        for [i, j] in block.cells() {
            let record = Filling::new(&block, corners.each_ref()).record([i, j]);
            assert!((record.lyapunov - (i + j) as f64).abs() < 1e-12);
            assert_eq!((record.period, record.periods_run), (2, 0));
            assert_eq!(record.valid, valid::PERIOD | valid::LYAPUNOV | valid::FILLED);
        }
    }

    #[test]
    fn what_one_corner_does_not_know_is_not_filled() {
        let block = Block { i: [0, 2], j: [0, 2] };
        let mut corners = [0.0; 4].map(corner);
        corners[3].valid &= !valid::LYAPUNOV;
        assert_eq!(Filling::new(&block, corners.each_ref()).record([0, 0]).valid & valid::LYAPUNOV, 0);
    }

    #[test]
    fn words_are_filled_where_all_corners_agree() {
        let block = Block { i: [0, 2], j: [0, 2] };
        let spelled = |symbols: &[u8]| {
            let mut record = corner(0.0);
            record.set_word(&Word::cyclic(symbols));
            record
        };
        let word = |corners: &[Record; 4]| Filling::new(&block, corners.each_ref()).record([1, 1]).word();
        let mut corners = [spelled(b"25"); 4];
        assert_eq!(word(&corners), corners[0].word());
        corners[2] = spelled(b"255");
        assert_eq!(word(&corners), None);
    }
}
