//! Averages of chaotic motion, compared as distributions over the class.
//!
//! The averages of a chaotic cell over its budget scatter. Therefore the reference computes each chaotic cell of the uniform sample twice,
//! over the same number of periods and from starts within the engine's resolution. If the engine is right, record and second result differ
//! from the first result by numbers of the same distribution. The two samples are compared by the Kolmogorov-Smirnov statistic.

use super::cell::Cell;
use crate::record::classify::classify;
use crate::record::measures::GROUPS;
use crate::record::{Record, valid};
use rattlemap_dynamics::orbit::Class;

/// Smallest number of cells for a test.
const FEWEST: usize = 8;

/// Probability that the test rejects a correct map.
const FALSE_ALARM_RATE: f64 = 1e-4;

/// Number of compared averages: exponent, logarithm of its error, impacts, fraction of meshing, and the first number of each measured
/// quantity.
const COUNT: usize = NAMES.len() + GROUPS.len();
const NAMES: [&str; 4] = ["lyapunov", "lyapunov_error", "impacts_per_period", "mesh_fraction"];

/// Test of one average over all chaotic cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChaosTest {
    /// Name of the average.
    pub name: &'static str,
    /// Number of chaotic cells.
    pub cells: usize,
    /// Largest distance of the two distribution functions.
    pub distance: f64,
    /// Distance that a correct map exceeds by chance once in 10,000 tests; none if there are too few cells.
    pub bar: Option<f64>,
    /// Mean differences from the reference's first result: of the map, and of the reference's second result.
    pub means: [f64; 2],
}

impl ChaosTest {
    /// Whether the map's averages differ from the reference's.
    pub fn fails(&self) -> bool {
        self.bar.is_some_and(|bar| self.distance > bar)
    }
}

/// Differences of one cell from the reference's first result: of the record, and of the reference's second result. None for an average that
/// one side lacks.
pub(super) type Differences = [Option<[f64; 2]>; COUNT];

/// Computes the differences of one cell; none unless all three results are chaotic.
pub(super) fn differences(cell: &Cell<'_>) -> Option<Differences> {
    let record = &cell.record;
    if classify(record) != Class::Chaotic {
        return None;
    }
    // Large indices, because `explain` uses small ones.
    let [first, second] = [1 << 16, 1 << 17].map(|k| cell.averages(k, record.periods_run));
    let (first, second) = (first?, second?);
    if [&first, &second].iter().any(|side| classify(side) != Class::Chaotic) {
        return None;
    }
    let of = |bit: u32, scale: f64, value: &dyn Fn(&Record) -> f64| {
        let known = [record, &first, &second].iter().all(|side| side.valid & bit != 0);
        known.then(|| [record, &second].map(|side| (value(side) - value(&first)) / scale))
    };
    let mut all = [None; COUNT];
    let (averages, measured) = all.split_at_mut(NAMES.len());
    averages.copy_from_slice(&[
        of(valid::LYAPUNOV, first.lyapunov_error, &|record| record.lyapunov),
        of(valid::LYAPUNOV, 1.0, &|record| record.lyapunov_error.ln()),
        of(valid::IMPACTS, first.impacts_per_period, &|record| record.impacts_per_period),
        of(valid::MESH, 1.0, &|record| record.mesh_fraction),
    ]);
    for (to, measure) in measured.iter_mut().zip(GROUPS.iter().filter_map(|group| group.measures().next())) {
        *to = of(measure.group.bit, first.measures[measure.place], &|record| record.measures[measure.place]);
    }
    Some(all)
}

/// Tests each average over all chaotic cells.
pub(super) fn tests(all: &[Differences]) -> Vec<ChaosTest> {
    let names = NAMES.into_iter().chain(GROUPS.iter().map(|group| group.name));
    names
        .enumerate()
        .map(|(i, name)| (i, name, all.iter().filter_map(|cell| cell[i]).collect::<Vec<[f64; 2]>>()))
        // Measured quantities that the scene does not request are not listed.
        .filter(|(i, _, pairs)| *i < NAMES.len() || !pairs.is_empty())
        .map(|(_, name, pairs)| {
            let [map, own] = [0, 1].map(|side| pairs.iter().map(|pair| pair[side]).collect::<Vec<f64>>());
            let cells = pairs.len();
            let bar = (0.5 * (2.0 / FALSE_ALARM_RATE).ln()).sqrt() * (2.0 / cells as f64).sqrt();
            ChaosTest {
                name,
                cells,
                distance: distance(map.clone(), own.clone()),
                bar: (cells >= FEWEST).then_some(bar),
                means: [map, own].map(|list| list.iter().sum::<f64>() / cells.max(1) as f64),
            }
        })
        .collect()
}

/// Returns the largest distance of the distribution functions of two samples of equal size. NaN counts as largest.
fn distance(mut a: Vec<f64>, mut b: Vec<f64>) -> f64 {
    let count = a.len().max(1) as f64;
    a.sort_by(f64::total_cmp);
    b.sort_by(f64::total_cmp);
    let below = |list: &[f64], x: f64| list.partition_point(|y| y.total_cmp(&x).is_le()) as f64;
    a.iter().chain(&b).map(|&x| (below(&a, x) - below(&b, x)).abs() / count).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distributions_differ_by_their_largest_distance() {
        let line = |from: f64| (0..10).map(|i| from + f64::from(i)).collect::<Vec<f64>>();
        assert_eq!(distance(line(0.0), line(0.0)), 0.0);
        assert_eq!(distance(line(0.0), line(3.0)), 0.3);
        assert_eq!(distance(line(0.0), line(90.0)), 1.0);
        assert_eq!(distance(vec![f64::NAN; 10], line(0.0)), 1.0, "not a number");
        assert_eq!(distance(Vec::new(), Vec::new()), 0.0);
    }

    #[test]
    fn a_shift_of_all_cells_is_found() {
        let cells = |shift: f64| -> Vec<Differences> {
            let cell = |i| {
                let mut cell = [None; COUNT];
                cell[0] = Some([f64::from(i) + shift, f64::from(i)]);
                cell
            };
            (0..40).map(cell).collect()
        };
        let first = |shift| tests(&cells(shift))[0];
        assert!(!first(0.0).fails() && !first(10.0).fails() && first(25.0).fails());
        assert_eq!((first(25.0).means, first(25.0).cells), ([44.5, 19.5], 40));
        assert!(!tests(&cells(1.0)[..3])[0].fails(), "too few to tell");
    }
}
