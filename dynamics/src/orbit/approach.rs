//! A test whether a motion near a stable cycle converges to it.
//!
//! A motion near a stable cycle may still leave it, because of a grazing impact, a fold of the strobe map, or an
//! impact that turns into meshing. So the test uses only the strobe states of the motion itself. As long as the
//! sequence of events does not change, the motion stays on one branch of the strobe map, and the monodromy matrix
//! maps each deviation from the cycle to the next one. Consider the convex hull of the origin and the earlier
//! deviations. If the present deviation lies in it, the matrix maps the hull into itself. Then all later deviations
//! lie in the hull, too, and the motion stays on its branch. That happens after a few cycles, or after one turn of a
//! spiral.

use super::recurrence::Metric;
use crate::model::{STATE, State, difference, dot, sum};
use crate::stability::{Cycle, image_of};

/// Largest error of the linear map, relative to the deviation. With 0.1, one cell of 40,000 over restitution and
/// frequency was assigned to a cycle that the motion then leaves.
pub const LINEAR_TOLERANCE: f64 = 0.03;

/// Largest error of the linear map, relative to the deviation, of a motion that is already close enough to the cycle.
pub(super) const CLOSE_TOLERANCE: f64 = 1.0;

/// Least number of last cycles that must lie on the cycle's branch.
pub const BRANCH_CYCLES: usize = 4;

/// Largest number of last cycles in the hull: enough for one turn of a slow spiral.
pub(super) const HULL_CYCLES: usize = 64;

/// Largest distance of the present deviation from the hull, relative to the deviation. In directions that have
/// decayed, it never lies exactly inside. With 0.2, three cells of the main map are assigned to cycles that they
/// leave.
const HULL_DISTANCE: f64 = 0.1;

/// Distance from the hull that is always allowed, relative to the size of the motion. Thresholds are very rarely that
/// close. Without it a map takes 5 % more periods.
const LEAST_HULL_DISTANCE: f64 = 1e-4;

/// Largest number of steps in the search for the nearest point of a hull.
const HULL_STEPS: usize = 64;

/// Whether a motion stays near a cycle.
///
/// `strobe(n)` is the strobe state `n` cycles ago, and `is_on_branch(n)` says whether the events of the motion in the following cycle agree
/// with the events of the cycle. `tolerance` is the largest error of the linear map, relative to the deviation.
pub(super) fn stays(
    cycle: &Cycle,
    strobe: impl Fn(usize) -> Option<State>,
    is_on_branch: impl Fn(usize) -> bool,
    metric: &Metric,
    tolerance: f64,
) -> bool {
    // Fewer entries are faster.
    match metric.len() {
        4 => stays_among::<4>(cycle, strobe, is_on_branch, metric, tolerance),
        _ => stays_among::<STATE>(cycle, strobe, is_on_branch, metric, tolerance),
    }
}

/// The test of [`stays`] for states with at most `N` nonzero entries.
fn stays_among<const N: usize>(
    cycle: &Cycle,
    strobe: impl Fn(usize) -> Option<State>,
    is_on_branch: impl Fn(usize) -> bool,
    metric: &Metric,
    tolerance: f64,
) -> bool {
    let deviation = |back: usize| -> Option<[f64; N]> {
        strobe(back).map(|y| std::array::from_fn(|i| y[i] - cycle.state[i]))
    };
    let Some(present) = deviation(0) else { return false };
    let (mut after, mut earlier) = (present, Vec::with_capacity(HULL_CYCLES));
    for back in 1..=HULL_CYCLES {
        let Some(before) = deviation(back).filter(|_| is_on_branch(back)) else { break };
        let error = difference(&after, &image_of(&cycle.monodromy, &before));
        if metric.size(&error) > tolerance * metric.size(&before) {
            break;
        }
        earlier.push(before);
        after = before;
    }
    earlier.len() >= BRANCH_CYCLES && is_in_hull(&present, &earlier, metric)
}

/// Whether a point lies in the convex hull of the origin and of `corners`, or within the allowed distance of it.
///
/// E. G. Gilbert, SIAM J. Control 4 (1966) 61: each step goes from the nearest point so far towards the corner that
/// lies farthest beyond it, whose position also bounds the distance from below.
fn is_in_hull<const N: usize>(point: &[f64; N], corners: &[[f64; N]], metric: &Metric) -> bool {
    let target = metric.scaled(point);
    let norm = |y: &[f64; N]| dot(y, y).sqrt();
    let allowed = (HULL_DISTANCE * norm(&target)).max(LEAST_HULL_DISTANCE);
    let corners: Vec<[f64; N]> =
        corners.iter().map(|corner| difference(&metric.scaled(corner), &target)).collect();
    // In slow motion the last corner is close to the point, and the steps below would be short.
    if corners.first().is_some_and(|last| norm(last) <= allowed) {
        return true;
    }
    let origin = target.map(|x| -x);
    let mut nearest = origin;
    for _ in 0..HULL_STEPS {
        let square = dot(&nearest, &nearest);
        if square <= allowed * allowed {
            return true;
        }
        let along = |corner: &[f64; N]| dot(corner, &nearest);
        let (least, farthest) = corners
            .iter()
            .map(|corner| (along(corner), corner))
            .fold((along(&origin), &origin), |best, other| if other.0 < best.0 { other } else { best });
        let step = difference(farthest, &nearest);
        let gain = -dot(&nearest, &step);
        if least > allowed * square.sqrt() || gain <= f64::EPSILON * square {
            return false;
        }
        nearest = sum(&nearest, &step, (gain / dot(&step, &step)).min(1.0));
    }
    false
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::model::{GearPair, REST, state};
    use crate::motion::Flow;

    fn metric() -> Metric {
        Metric::of(&[REST], &Flow::new(&GearPair::paper(0.5).oscillator().unwrap()))
    }

    /// Builds a cycle at the origin whose complex multipliers have the modulus `radius` and the argument `angle`, and
    /// whose other multipliers are `real`.
    fn spiral(angle: f64, radius: f64, real: [f64; 2]) -> Cycle {
        let (sin, cos) = angle.sin_cos();
        let mut monodromy =
            DMatrix::from_diagonal(&DVector::from_column_slice(&[0.0, 0.0, real[0], real[1]]));
        monodromy
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&(nalgebra::Matrix2::new(cos, -sin, sin, cos) * radius));
        Cycle {
            state: REST,
            period: 1,
            symmetric: false,
            monodromy,
            multipliers: Vec::new(),
            log_radius: radius.ln(),
            near_grazing: false,
            image: REST,
            may_be_shorter: false,
        }
    }

    /// Returns the strobe states of a motion, the last one first. In every cycle `bend` times the square of the first
    /// entry is added to the linear map.
    fn states(cycle: &Cycle, start: State, cycles: usize, bend: f64) -> Vec<State> {
        let mut list = vec![start];
        for n in 0..cycles {
            let before = list[n];
            let mut next = image_of(&cycle.monodromy, &before);
            next[0] += bend * before[0] * before[0];
            list.push(next);
        }
        list.into_iter().rev().collect()
    }

    fn stay(cycle: &Cycle, strobes: &[State]) -> bool {
        stays(cycle, |back| strobes.get(back).copied(), |_| true, &metric(), LINEAR_TOLERANCE)
    }

    #[test]
    fn a_spiral_stays_after_one_turn() {
        for (angle, expected) in [(0.0, 4), (0.7, 8), (1.5, 4), (3.1, 4)] {
            let cycle = spiral(angle, 0.9, [0.3, 0.1]);
            let first = (BRANCH_CYCLES..40)
                .find(|&cycles| stay(&cycle, &states(&cycle, state(&[0.02, 0.0, 1e-4]), cycles, 0.0)));
            assert!(first.is_some_and(|first| first.abs_diff(expected) <= 1), "{angle}: after {first:?}");
        }
    }

    #[test]
    fn nonlinear_motion_and_motion_on_another_branch_do_not_stay() {
        let cycle = spiral(1.5, 0.9, [0.3, 0.1]);
        for (bend, expected) in [(0.0, true), (1.0, true), (20.0, false)] {
            let strobes = states(&cycle, state(&[0.01, 0.0, 0.002]), 8, bend);
            assert_eq!(stay(&cycle, &strobes), expected, "bend {bend}");
        }
        let strobes = states(&cycle, state(&[0.01, 0.0, 0.002]), 8, 0.0);
        for (other, expected) in [(1, false), (4, false), (5, true)] {
            let strobe = |back: usize| strobes.get(back).copied();
            let stays = stays(&cycle, strobe, |back| back != other, &metric(), LINEAR_TOLERANCE);
            assert_eq!(stays, expected, "another branch {other} cycles ago");
        }
    }

    #[test]
    fn motion_that_has_not_filled_its_hull_does_not_stay() {
        let mut cycle = spiral(0.3, 0.95, [0.5, 0.1]);
        let strobes = states(&cycle, state(&[0.02]), 5, 0.0);
        assert!(!stay(&cycle, &strobes), "after a quarter of a turn");
        // One direction decays faster than the other, so the direction of the deviation changes.
        cycle = spiral(0.0, 0.95, [0.3, 0.0]);
        assert!(!stay(&cycle, &states(&cycle, state(&[1e-3, 0.0, 1.0]), 5, 0.0)));
        assert!(stay(&cycle, &states(&cycle, state(&[1e-2, 0.0, 1e-2]), 6, 0.0)));
    }
}
