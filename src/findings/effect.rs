//! Swept parameters without effect, such as the stiffness behind a wall that no motion reaches. Pure.
//!
//! All quantities of tables are compared, as far as they were computed: class, period, exponent, impacts, meshing,
//! symmetry, word and pattern.

use std::ops::Range;

use rayon::prelude::*;

use crate::map::plan::Plan;
use crate::record::classify::classify;
use crate::record::measures::{GROUPS, SMALL};
use crate::record::{Record, Records, valid};

/// Relative tolerance for rounding errors of engines in single precision.
const SINGLE_TOLERANCE: f64 = 1e-3;

/// Relative tolerance for rounding errors of engines in double precision.
const DOUBLE_TOLERANCE: f64 = 1e-6;

/// Number of neighbouring lines that are compared together. Their records are neighbours in memory, too.
const LINES: usize = 64;

/// Returns the names of the swept parameters along whose axis all integrated cells are equal within rounding errors.
/// The tolerance depends on `precision`: `f64`, else single.
///
/// Filled cells are ignored. The result is empty if cells start from their neighbours, because then more than the
/// parameter changes along an axis, and for a list, which has no axes.
///
/// # Panics
/// If the number of records is not that of the runs.
pub fn names(plan: &Plan, records: &(impl Records + ?Sized), precision: &str) -> Vec<String> {
    assert_eq!(plan.run_count(), records.count(), "one record per run");
    if plan.policy().follows() {
        return Vec::new();
    }
    let tolerance = if precision == "f64" { DOUBLE_TOLERANCE } else { SINGLE_TOLERANCE };
    let counts = plan.counts();
    // Number of comparisons along some neighbouring lines of a map; none if cells of a line differ.
    let compare = |axis: usize, map: usize, lines: Range<usize>| {
        let [step, other_step] = if axis == 0 { [1, counts[0]] } else { [counts[0], 1] };
        let (mut firsts, mut compared) = (vec![None; lines.len()], 0);
        for n in 0..counts[axis] {
            for (line, first) in lines.clone().zip(&mut firsts) {
                let record = records.record(map + line * other_step + n * step);
                if record.valid & valid::FILLED != 0 {
                    continue;
                }
                match first {
                    None => *first = Some(record),
                    Some(first) if is_same(first, &record, tolerance) => compared += 1,
                    Some(_) => return None,
                }
            }
        }
        Some(compared)
    };
    let changes_nothing = |axis: usize| {
        let lines = counts[1 - axis];
        let maps = (0..records.count()).step_by(plan.cell_count());
        let parts: Vec<(usize, usize)> =
            maps.flat_map(|map| (0..lines).step_by(LINES).map(move |line| (map, line))).collect();
        let part = |&(map, line): &(usize, usize)| compare(axis, map, line..lines.min(line + LINES));
        parts.par_iter().map(part).try_reduce(|| 0, |a, b| Some(a + b)).is_some_and(|compared| compared > 0)
    };
    // Components of the start are not parameters.
    let axes = plan.axes().iter().enumerate().filter(|(_, axis)| !axis.target().is_start());
    let found = axes.filter(|&(i, _)| changes_nothing(i));
    found.map(|(_, axis)| axis.parameter().name.to_string()).collect()
}

fn is_same(a: &Record, b: &Record, tolerance: f64) -> bool {
    let near = |a: f64, b: f64| a == b || (a - b).abs() <= tolerance * a.abs().max(b.abs());
    let both = |bit: u32, same: bool| a.valid & bit == b.valid & bit && (a.valid & bit == 0 || same);
    // Equal fields are compared faster than spellings.
    let word = |record: &Record| (record.word, record.word_hash, record.word_length);
    let pattern = |record: &Record| (record.pattern, record.pattern_hash, record.pattern_length);
    classify(a) == classify(b)
        && both(valid::LYAPUNOV, near(a.lyapunov, b.lyapunov))
        && both(valid::IMPACTS, near(a.impacts_per_period, b.impacts_per_period))
        && both(valid::MESH, near(a.mesh_fraction, b.mesh_fraction))
        && GROUPS.iter().all(|group| {
            (a.valid | b.valid) & group.bit == 0 || both(group.bit, group.distance(a, b, SMALL) <= tolerance)
        })
        && both(valid::SYMMETRIC, a.symmetric == b.symmetric)
        && both(valid::WORD, word(a) == word(b) || a.spelling() == b.spelling())
        && both(valid::PATTERN, pattern(a) == pattern(b) || a.pattern() == b.pattern())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::test_plan;

    fn plan(more: &str) -> Plan {
        test_plan([("e", 3), ("k", 2)], more)
    }

    fn record(period: u32, lyapunov: f64) -> Record {
        Record { period, lyapunov, valid: valid::PERIOD | valid::LYAPUNOV, ..Record::default() }
    }

    fn named(plan: &Plan, records: &[Record]) -> Vec<String> {
        names(plan, records, "f64")
    }

    #[test]
    fn parameters_along_which_nothing_changes_are_named() {
        let plan = plan("");
        let by = |rule: fn(usize, usize) -> Record| -> Vec<Record> {
            (0..6).map(|id| rule(id % 3, id / 3)).collect()
        };
        assert_eq!(named(&plan, &by(|i, _| record(1, -1.0 - i as f64))), ["k"]);
        assert_eq!(named(&plan, &by(|_, j| record(1 + j as u32, -1.0))), ["e"]);
        assert_eq!(named(&plan, &by(|_, _| record(1, -1.0))), ["e", "k"]);
        assert!(named(&plan, &by(|i, j| record(1, -(((1 + i) * (1 + j)) as f64)))).is_empty());
        // Differences within the tolerance are ignored.
        let rounded = by(|i, j| record(1, -1.0 - i as f64 - 1e-8 * j as f64));
        assert_eq!(named(&plan, &rounded), ["k"]);
        // A difference of any quantity in one cell is an effect.
        for change in [
            |record: &mut Record| record.period = 2,
            |record: &mut Record| record.lyapunov *= 1.001,
            |record: &mut Record| record.valid |= valid::MESH,
            |record: &mut Record| record.valid &= !valid::LYAPUNOV,
        ] {
            let mut records = by(|i, _| record(1, -1.0 - i as f64));
            change(&mut records[4]);
            assert!(named(&plan, &records).is_empty());
        }
    }

    #[test]
    fn filled_cells_and_cells_that_follow_are_ignored() {
        let same = vec![record(1, -1.0); 6];
        let filled = Record { valid: valid::FILLED | record(1, -1.0).valid, ..record(1, -1.0) };
        assert!(named(&plan("[refine]\n"), &vec![filled.clone(); 6]).is_empty());
        let mut some = same.clone();
        some[4] = Record { period: 2, ..filled };
        assert_eq!(named(&plan("[refine]\n"), &some), ["e", "k"]);
        assert!(named(&plan("[start]\npolicy = 'up'\n"), &same).is_empty());
    }
}
