//! Does motion near a cycle end on it?
//!
//! A stable cycle need not attract the motion: between them there may be a graze, a fold of
//! the strobe map, an impact that turns into meshing. Only what the motion itself has shown of the
//! map counts. On one branch of it, where the same events follow one another, the deviations from
//! the cycle follow one another as its monodromy matrix says. If the present one lies within the
//! convex hull of the earlier ones and of none at all, then all to come do, since the matrix takes
//! the hull's corners to one another: the motion never leaves the part of its branch that it has
//! seen. What is left of a spiral, of a motion that changes sides, or of one that comes straight in
//! lies in such a hull as soon as the spiral has turned once, or a few cycles have passed.

use nalgebra::Vector4;

use super::recurrence::Metric;
use crate::model::State;
use crate::stability::Cycle;

/// Deviations from the linear map, as a share of the deviation, that are still small. At a tenth
/// one cell of 40,000 over restitution and frequency was taken for a cycle that it then left.
pub const LINEAR: f64 = 0.03;

/// The same where the motion is as near to the cycle as it may lie: not off by all of the deviation.
pub(super) const BENT: f64 = 1.0;

/// Cycles, at least, over which the motion must have shown the cycle's branch.
pub const SHOWN_CYCLES: usize = 4;

/// Cycles that are looked back at: a slow spiral turns once.
pub(super) const HULL_CYCLES: usize = 64;

/// How far outside of the hull a deviation may lie, as a share of itself: directions that have died
/// out are never quite within. At a fifth three cells of the main map are taken for cycles that they leave ...
const OUTSIDE: f64 = 0.1;

/// ... or relative to the motion: a threshold is hardly ever as near. Without it a map takes a twentieth
/// more periods.
const HAIR: f64 = 1e-4;

/// Steps towards the nearest point of a hull.
const HULL_STEPS: usize = 64;

/// Whether motion stays by a cycle, from its strobe states `beside(n)`, `n` cycles before the present,
/// and whether the cycle that began there had the cycle's events. Departures from the linear map of the share
/// `bend` are allowed.
pub(super) fn stays(
    cycle: &Cycle,
    beside: impl Fn(usize) -> Option<State>,
    is_on_branch: impl Fn(usize) -> bool,
    metric: &Metric,
    bend: f64,
) -> bool {
    let centre = Vector4::from(cycle.state);
    let off = |back: usize| beside(back).map(|y| Vector4::from(y) - centre);
    let Some(present) = off(0) else { return false };
    let (mut after, mut earlier) = (present, Vec::new());
    for back in 1..=HULL_CYCLES {
        let Some(before) = off(back).filter(|_| is_on_branch(back)) else { break };
        if metric.size(&(after - cycle.monodromy * before)) > bend * metric.size(&before) {
            break;
        }
        earlier.push(before);
        after = before;
    }
    earlier.len() >= SHOWN_CYCLES && is_in_hull(&present, &earlier, metric)
}

/// Whether a point lies within the convex hull of the origin and of others, or nearly so.
fn is_in_hull(point: &Vector4<f64>, corners: &[Vector4<f64>], metric: &Metric) -> bool {
    let target = metric.scaled(point);
    let allowed = (OUTSIDE * target.norm()).max(HAIR);
    let seen: Vec<Vector4<f64>> = corners.iter().map(|corner| metric.scaled(corner) - target).collect();
    // E. G. Gilbert, SIAM J. Control 4 (1966) 61: from the nearest point so far to the corner that lies
    // farthest beyond it; how far that is bounds the distance from below.
    // Slow motion hardly moves, and the steps below would be short.
    if seen.first().is_some_and(|last| last.norm() <= allowed) {
        return true;
    }
    let mut nearest = -target;
    for _ in 0..HULL_STEPS {
        let square = nearest.norm_squared();
        if square <= allowed * allowed {
            return true;
        }
        let along = |corner: &Vector4<f64>| corner.dot(&nearest);
        let farthest = seen
            .iter()
            .fold(-target, |best, corner| if along(corner) < along(&best) { *corner } else { best });
        let step = farthest - nearest;
        let gain = -nearest.dot(&step);
        if along(&farthest) > allowed * square.sqrt() || gain <= f64::EPSILON * square {
            return false;
        }
        nearest += step * (gain / step.norm_squared()).min(1.0);
    }
    false
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;
    use crate::flow::Flow;
    use crate::model::GearPair;

    fn metric() -> Metric {
        Metric::of(&[[0.0; 4]], &Flow::new(&GearPair::paper(0.5).oscillator().unwrap()))
    }

    /// A cycle at the origin with a spiral that turns by `angle`, and what shrinks beside it.
    fn spiral(angle: f64, radius: f64, beside: [f64; 2]) -> Cycle {
        let (sin, cos) = angle.sin_cos();
        let mut monodromy = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, beside[0], beside[1]));
        monodromy
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&(nalgebra::Matrix2::new(cos, -sin, sin, cos) * radius));
        Cycle {
            state: [0.0; 4],
            period: 1,
            symmetric: false,
            monodromy,
            multipliers: Vec::new(),
            log_radius: radius.ln(),
            near_grazing: false,
        }
    }

    /// The strobe states of a motion with `bend` times the square of its first entry added in every cycle, the
    /// present one first.
    fn states(cycle: &Cycle, start: State, cycles: usize, bend: f64) -> Vec<State> {
        let mut list = vec![Vector4::from(start)];
        for n in 0..cycles {
            let before = list[n];
            list.push(cycle.monodromy * before + Vector4::new(bend * before[0] * before[0], 0.0, 0.0, 0.0));
        }
        list.into_iter().rev().map(Into::into).collect()
    }

    fn stay(cycle: &Cycle, strobes: &[State]) -> bool {
        stays(cycle, |back| strobes.get(back).copied(), |_| true, &metric(), LINEAR)
    }

    #[test]
    fn a_spiral_stays_once_it_has_turned() {
        for (angle, shown) in [(0.0, 4), (0.7, 8), (1.5, 4), (3.1, 4)] {
            let cycle = spiral(angle, 0.9, [0.3, 0.1]);
            let first = (SHOWN_CYCLES..40)
                .find(|&cycles| stay(&cycle, &states(&cycle, [0.02, 0.0, 1e-4, 0.0], cycles, 0.0)));
            assert!(first.is_some_and(|first| first.abs_diff(shown) <= 1), "{angle}: after {first:?}");
        }
    }

    #[test]
    fn bent_motion_and_motion_on_another_branch_do_not_stay() {
        let cycle = spiral(1.5, 0.9, [0.3, 0.1]);
        for (bend, expected) in [(0.0, true), (1.0, true), (20.0, false)] {
            let strobes = states(&cycle, [0.01, 0.0, 0.002, 0.0], 8, bend);
            assert_eq!(stay(&cycle, &strobes), expected, "bend {bend}");
        }
        let strobes = states(&cycle, [0.01, 0.0, 0.002, 0.0], 8, 0.0);
        for (other, expected) in [(1, false), (4, false), (5, true)] {
            let beside = |back: usize| strobes.get(back).copied();
            let stays = stays(&cycle, beside, |back| back != other, &metric(), LINEAR);
            assert_eq!(stays, expected, "another branch {other} cycles ago");
        }
    }

    /// What has not shown yet may lead to where the motion has not been.
    #[test]
    fn what_will_grow_first_does_not_stay() {
        let mut cycle = spiral(0.3, 0.95, [0.5, 0.1]);
        let strobes = states(&cycle, [0.02, 0.0, 0.0, 0.0], 5, 0.0);
        assert!(!stay(&cycle, &strobes), "a spiral that has turned a quarter");
        // Two directions that cancel at first in what decides an event.
        cycle = spiral(0.0, 0.95, [0.3, 0.0]);
        assert!(!stay(&cycle, &states(&cycle, [1e-3, 0.0, 1.0, 0.0], 5, 0.0)));
        assert!(stay(&cycle, &states(&cycle, [1e-2, 0.0, 1e-2, 0.0], 6, 0.0)));
    }
}
