//! Differences between filled and integrated values.

use crate::map::plan::Needs;
use crate::map::statistics::{TWO_SIDED_95, score_interval};
use crate::record::distance::apart;
use crate::record::measures::{self, MEASURES};
use crate::record::{Record, valid};

/// Two counts of impacts per cycle that differ by less than this are equal.
const HALF_AN_IMPACT: f64 = 0.5;

/// Tolerance for the rounding of counts per period whose difference is exactly 1.
const COUNT_ROUNDING: f64 = 1e-9;

/// Errors of the continuous quantities of audited cells; none if the scene does not request a quantity, or leaves it
/// empty in filled cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Errors of the largest Lyapunov exponent.
    pub lyapunov: Option<Deviation>,
    /// Errors of the impacts per forcing period.
    pub impacts: Option<Deviation>,
    /// Errors of the fraction of time spent meshing.
    pub mesh: Option<Deviation>,
    /// Errors of measured quantities, by their places in a record.
    pub measures: [Option<Deviation>; MEASURES],
}

/// Absolute differences between filled and integrated values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Number of cells with both values.
    pub compared: usize,
    /// Number of cells with an integrated value but without a filled one.
    pub empty: usize,
    /// Median difference.
    pub median: f64,
    /// 95 % quantile of the differences.
    pub p95: f64,
    /// Largest difference.
    pub worst: f64,
    /// Number of cells whose values differ by 1 or more.
    pub off_by_one: usize,
}

impl Default for Errors {
    fn default() -> Self {
        Errors { lyapunov: None, impacts: None, mesh: None, measures: [None; MEASURES] }
    }
}

impl Errors {
    /// Compares pairs of filled and integrated records.
    pub(super) fn new(pairs: &[(Record, Record)], needs: &Needs) -> Errors {
        let deviation = |bit, field: fn(&Record) -> f64| {
            let value = |record: &Record| {
                // The exponent of a superstable cycle is minus infinity, which cannot be compared.
                Some(field(record)).filter(|&value| record.valid & bit != 0 && value != f64::NEG_INFINITY)
            };
            let values = pairs.iter().map(|(filled, own)| (value(filled), value(own)));
            Deviation::new(values, apart)
        };
        let mut measures = [None; MEASURES];
        for measure in measures::all().filter(|measure| needs.has(measure.group)) {
            let values = pairs.iter().map(|(filled, own)| (measure.of(filled), measure.of(own)));
            let difference = |a, b| apart(measure.difference(a, b), 0.0);
            measures[measure.place] = Some(Deviation::new(values, difference));
        }
        Errors {
            measures,
            lyapunov: needs.lyapunov.then(|| deviation(valid::LYAPUNOV, |record| record.lyapunov)),
            impacts: needs.impacts.then(|| deviation(valid::IMPACTS, |record| record.impacts_per_period)),
            mesh: needs.mesh.then(|| deviation(valid::MESH, |record| record.mesh_fraction)),
        }
    }
}

impl Deviation {
    /// Compares pairs of filled and integrated values.
    fn new(
        pairs: impl Iterator<Item = (Option<f64>, Option<f64>)>,
        apart: impl Fn(f64, f64) -> f64,
    ) -> Deviation {
        let (mut differences, mut empty) = (Vec::new(), 0);
        for pair in pairs {
            match pair {
                (Some(filled), Some(own)) => differences.push(apart(filled, own)),
                (None, Some(_)) => empty += 1,
                (_, None) => {}
            }
        }
        differences.sort_by(f64::total_cmp);
        let rank = |share: f64| {
            let place = (share * differences.len() as f64).ceil() as usize;
            differences.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
        };
        Deviation {
            compared: differences.len(),
            empty,
            median: rank(0.5),
            p95: rank(0.95),
            worst: rank(1.0),
            off_by_one: differences.iter().filter(|&&difference| difference >= 1.0 - COUNT_ROUNDING).count(),
        }
    }

    /// Returns the fraction of the compared cells whose values differ by 1 or more.
    pub fn off_by_one_rate(&self) -> f64 {
        self.off_by_one as f64 / self.compared.max(1) as f64
    }

    /// Returns the 95 % interval of [`Deviation::off_by_one_rate`].
    pub fn off_by_one_interval(&self) -> [f64; 2] {
        score_interval(self.off_by_one, self.compared, TWO_SIDED_95)
    }
}

/// Whether two cycles of one period have the same number of impacts.
pub(super) fn same_count(cycle: &Record, other: &Record) -> bool {
    let difference = (cycle.impacts_per_period - other.impacts_per_period).abs();
    difference * f64::from(cycle.period) < HALF_AN_IMPACT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_ranked_and_missing_values_counted_separately() {
        let pairs = (1..=100).map(|k| (Some(f64::from(k) * 0.125), Some(0.0)));
        let absent = [(None, Some(1.0)), (Some(1.0), None), (None, None)];
        let deviation = Deviation::new(pairs.chain(absent), apart);
        let expected =
            Deviation { compared: 100, empty: 1, median: 6.25, p95: 11.875, worst: 12.5, off_by_one: 93 };
        assert_eq!(deviation, expected);
        assert_eq!(Deviation::new(std::iter::empty(), apart), Deviation::default());
        let not_finite =
            Deviation::new([(Some(1.0), Some(1.0)), (Some(f64::NAN), Some(1.0))].into_iter(), apart);
        assert_eq!((not_finite.compared, not_finite.worst, not_finite.off_by_one), (2, f64::INFINITY, 1));
        let [low, high] = deviation.off_by_one_interval();
        assert!(low < deviation.off_by_one_rate() && deviation.off_by_one_rate() < high);
    }

    #[test]
    fn counts_over_several_periods_that_differ_by_one_a_period_are_off_by_one() {
        let thirds = (0..30).map(|k| (Some(f64::from(k + 3) / 3.0), Some(f64::from(k) / 3.0)));
        assert_eq!(Deviation::new(thirds, apart).off_by_one, 30);
    }
}
