//! Filling of blocks from the records of their corners.

use super::blocks::Block;
use super::errors::same_count;
use super::label::{pattern_of, word_of};
use crate::record::classify::classify;
use crate::record::measures::{self, GROUPS, MEASURES};
use crate::record::{Numbers, Record, valid};
use rattlemap_dynamics::orbit::Class;

/// Returns the bit by which a record is quasi-periodic. Like the class of other motion, it is that of the nearest corner.
fn torus(record: &Record) -> u32 {
    record.valid & valid::QUASI_PERIODIC
}

/// Computes the filled records of one block. Values that do not depend on the cell are computed once.
pub(super) struct Filling {
    block: Block,
    corners: [Record; 4],
    /// Quantities that all corners have, as bits of [`valid`].
    valid: u32,
    /// For each corner, whether the cells nearest to it get averages.
    averages: [bool; 4],
}

impl Filling {
    /// Prepares the filling of a block from the records of its corners, in the order of [`Block::corners`].
    pub(super) fn new(block: &Block, corners: [Record; 4]) -> Filling {
        let common = corners.iter().fold(u32::MAX, |bits, corner| bits & corner.valid);
        let mut valid = common & !valid::STROBE & !valid::QUASI_PERIODIC | valid::FILLED;
        let agree = |of: fn(&Record) -> u64| corners.iter().all(|corner| of(corner) == of(&corners[0]));
        if !agree(word_of) {
            valid &= !valid::WORD;
        }
        if !agree(pattern_of) {
            valid &= !valid::PATTERN;
        }
        let averages = corners.each_ref().map(|nearest| {
            let class = classify(&Record { valid: valid | torus(nearest), ..nearest.clone() });
            // An average exponent could turn undecided cells into decided ones.
            let decided = !matches!(class, Class::Undecided | Class::Failed);
            decided && corners.iter().all(|corner| classify(corner) == class)
        });
        Filling { block: *block, corners, valid, averages }
    }

    /// Returns the filled record of a cell: that of the nearest corner, with bilinear averages of continuous
    /// quantities. A word or pattern is filled only if all corners agree. So are the impacts of cycles, which are whole
    /// numbers over the period, and an average of different counts need not be.
    pub(super) fn record(&self, at: [usize; 2]) -> Record {
        let [u, v] = self.block.shares(at);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let nearest = self.block.nearest(at);
        let average = |field: fn(&Record) -> f64| {
            // Corners without weight are skipped: the exponent of a superstable cycle is infinite.
            let weighted = self.corners.iter().zip(weights).filter(|&(_, weight)| weight > 0.0);
            weighted.map(|(corner, weight)| weight * field(corner)).sum::<f64>()
        };
        let mut filled = Record {
            periods_run: 0,
            strobe: Numbers::default(),
            valid: self.valid,
            ..self.corners[nearest].clone()
        };
        filled.valid |= torus(&self.corners[nearest]);
        filled.clear_measures(|group| self.valid & group.bit == 0);
        if !self.averages[nearest] {
            return filled;
        }
        let averaged = Record {
            lyapunov: average(|corner| corner.lyapunov),
            lyapunov_error: average(|corner| corner.lyapunov_error),
            impacts_per_period: average(|corner| corner.impacts_per_period),
            mesh_fraction: average(|corner| corner.mesh_fraction),
            measures: self.measures(weights).into(),
            ..filled.clone()
        };
        if !matches!(classify(&filled), Class::Periodic { .. }) {
            return averaged;
        }
        // A cell on an edge depends only on the corners of that edge.
        let mut weighted = self.corners.iter().zip(weights).filter(|&(_, weight)| weight > 0.0);
        if weighted.all(|(corner, _)| same_count(&filled, corner)) {
            let mut counted = Record { impacts_per_period: filled.impacts_per_period, ..averaged };
            measures::impacts_of_gaps().for_each(|place| counted.measures.set(place, filled.measures[place]));
            counted
        } else {
            let bits = averaged.valid & !valid::IMPACTS;
            let mut uncounted = Record { impacts_per_period: 0.0, valid: bits, ..averaged };
            measures::impacts_of_gaps().for_each(|place| uncounted.measures.set(place, 0.0));
            uncounted
        }
    }
}

impl Filling {
    /// Returns the averages of the measured quantities that all corners have.
    fn measures(&self, weights: [f64; 4]) -> [f64; MEASURES] {
        let mut averages = [0.0; MEASURES];
        let has_gaps = self.valid & valid::GAPS != 0;
        if has_gaps || GROUPS.iter().any(|group| self.valid & group.bit != 0) {
            let all = measures::all().chain(measures::of_gaps().filter(|_| has_gaps));
            for measure in all.filter(|measure| self.valid & measure.group.bit != 0) {
                let values = self.corners.each_ref().map(|corner| corner.measures[measure.place]);
                // A corner without weight may be NaN.
                let weighted: Vec<(f64, f64)> =
                    values.into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0).collect();
                averages[measure.place] = measure.average(&weighted);
            }
        }
        averages
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::word::Word;

    fn corner(lyapunov: f64) -> Record {
        let valid = valid::PERIOD | valid::LYAPUNOV | valid::STROBE;
        Record { period: 2, lyapunov, valid, periods_run: 99, ..Record::default() }
    }

    #[test]
    fn continuous_quantities_are_interpolated() {
        let block = Block { i: [0, 4], j: [0, 2] };
        let corners = [0.0, 4.0, 2.0, 6.0].map(corner);
        for [i, j] in block.cells() {
            let record = Filling::new(&block, corners.clone()).record([i, j]);
            assert!((record.lyapunov - (i + j) as f64).abs() < 1e-12);
            assert_eq!((record.period, record.periods_run), (2, 0));
            assert_eq!(record.valid, valid::PERIOD | valid::LYAPUNOV | valid::FILLED);
        }
    }

    #[test]
    fn measured_quantities_are_interpolated_if_all_corners_have_them() {
        let block = Block { i: [0, 4], j: [0, 2] };
        let [speed, phase] = ["impact_speed", "harmonic_phase_x"].map(|name| {
            measures::all()
                .find(|measure| measure.name(&measures::Subjects::of_states(&["x", "v"])) == name)
                .unwrap()
        });
        let corners = [2.0, 3.0, 2.0, 3.0].map(|value| {
            let mut record = corner(0.0);
            record.valid |= speed.group.bit | phase.group.bit;
            record.measures[speed.place] = value;
            record.measures[phase.place] = if value > 2.5 { -value } else { value + 1.0 };
            record
        });
        let filled = |corners: &[Record; 4]| Filling::new(&block, corners.clone()).record([2, 1]);
        let record = filled(&corners);
        assert_eq!(
            (speed.of(&record), record.measures[phase.place].abs()),
            (Some(2.5), std::f64::consts::PI)
        );
        let mut lacking = corners.clone();
        lacking[3].valid &= !speed.group.bit;
        let record = filled(&lacking);
        assert_eq!((speed.of(&record), record.measures[speed.place]), (None, 0.0));
    }

    #[test]
    fn a_superstable_corner_contributes_only_with_weight() {
        let block = Block { i: [0, 2], j: [0, 2] };
        let corners = [-1.0, f64::NEG_INFINITY, -3.0, -4.0].map(corner);
        let exponent = |at| Filling::new(&block, corners.clone()).record(at).lyapunov;
        assert_eq!([exponent([0, 0]), exponent([0, 1]), exponent([1, 2])], [-1.0, -2.0, -3.5]);
        assert_eq!([exponent([1, 0]), exponent([1, 1])], [f64::NEG_INFINITY; 2]);
    }

    #[test]
    fn quantities_that_one_corner_lacks_are_not_filled() {
        let block = Block { i: [0, 2], j: [0, 2] };
        let mut corners = [0.0; 4].map(corner);
        corners[3].valid &= !valid::LYAPUNOV;
        assert_eq!(Filling::new(&block, corners.clone()).record([0, 0]).valid & valid::LYAPUNOV, 0);
    }

    /// On an edge only the corners of that edge count.
    #[test]
    fn impacts_of_cycles_are_filled_if_the_corners_agree() {
        let block = Block { i: [0, 2], j: [0, 2] };
        let impacting = |count: f64, valid: u32| Record {
            impacts_per_period: count / 3.0,
            mesh_fraction: count / 16.0,
            period: 3,
            valid: valid | valid::IMPACTS | valid::MESH,
            ..Record::default()
        };
        let impacts = |corners: &[Record; 4], at| {
            let record = Filling::new(&block, corners.clone()).record(at);
            (record.valid & valid::IMPACTS != 0).then_some(record.impacts_per_period)
        };
        let mut corners = [7.0; 4].map(|count| impacting(count, valid::PERIOD));
        assert_eq!(impacts(&corners, [1, 1]), Some(7.0 / 3.0));
        corners[3] = impacting(8.0, valid::PERIOD);
        assert_eq!(impacts(&corners, [1, 1]), None);
        assert_eq!(impacts(&corners, [1, 0]), Some(7.0 / 3.0));
        let record = Filling::new(&block, corners.clone()).record([1, 1]);
        assert_eq!((record.mesh_fraction, record.impacts_per_period), (29.0 / 64.0, 0.0));
        // Impacts of chaos are means, not counts, and are averaged.
        let chaos = |count| Record { period: 0, lyapunov: 1.0, ..impacting(count, valid::LYAPUNOV) };
        let corners = [7.5, 7.5, 7.5, 9.0].map(chaos);
        let mean = impacts(&corners, [1, 1]).unwrap();
        assert!((mean - 31.5 / 12.0).abs() < 1e-12, "{mean}");
    }

    #[test]
    fn words_and_patterns_are_filled_where_all_corners_agree() {
        let block = Block { i: [0, 2], j: [0, 2] };
        let spelled = |symbols: &[u8]| {
            let mut record = corner(0.0);
            let word = Word::cyclic(symbols);
            record.set_word(&word);
            record.set_pattern(&word.pattern());
            record
        };
        let filled = |corners: &[Record; 4]| {
            let record = Filling::new(&block, corners.clone()).record([1, 1]);
            (record.spelling(), record.pattern())
        };
        let mut corners = [b"25"; 4].map(|symbols| spelled(symbols));
        let [word, pattern] = [corners[0].spelling(), corners[0].pattern()];
        assert_eq!(filled(&corners), (word, pattern.clone()));
        corners[2] = spelled(b"255");
        assert_eq!(filled(&corners), (None, pattern));
        corners[2] = spelled(b"26");
        assert_eq!(filled(&corners), (None, None));
    }
}
