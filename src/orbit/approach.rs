//! Does motion near a cycle move as the cycle's monodromy matrix says?
//!
//! A cycle that attracts need not attract the motion: between them there may be a graze, a fold of
//! the strobe map, an impact that turns into meshing. Far out, only the motion itself can show that
//! it comes nearer. But where its last deviations from the cycle follow one another as the matrix
//! says, and those to come are smaller than they were, it has seen all of the map that it will see.

use nalgebra::Vector4;

use super::recurrence::Metric;
use crate::model::State;
use crate::stability::Cycle;

/// Departures from the linear map, as a share of the deviation, that are still small. At a tenth
/// one cell of 40,000 over restitution and frequency was taken for a cycle that it then left.
const LINEAR: f64 = 0.03;

/// Cycles over which the motion must have been linear.
pub(super) const LINEAR_CYCLES: usize = 4;

/// Cycles ahead whose deviations must be smaller than those: what is not normal in the matrix may
/// grow before it shrinks.
const CYCLES_AHEAD: u32 = 64;

/// Whether the strobe states `beside(n)`, `n` cycles before the present, the present one included,
/// moved about the cycle as its linearisation does, and will stay where they did.
pub(super) fn is_linear(cycle: &Cycle, beside: impl Fn(usize) -> State, metric: &Metric) -> bool {
    let centre = Vector4::from(cycle.state);
    let off = |back: usize| Vector4::from(beside(back)) - centre;
    let size = |v: Vector4<f64>| metric.distance(&v.into(), &[0.0; 4]);
    let mut largest = 0.0f64;
    for back in 1..=LINEAR_CYCLES {
        let (before, after) = (off(back), off(back - 1));
        if size(after - cycle.monodromy * before) > LINEAR * size(before) {
            return false;
        }
        largest = largest.max(size(before));
    }
    let mut ahead = off(0);
    (0..CYCLES_AHEAD).all(|_| {
        ahead = cycle.monodromy * ahead;
        size(ahead) <= largest
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;
    use crate::flow::Flow;
    use crate::model::GearPair;

    /// A cycle at the origin with a slow spiral, and the deviations of a motion with `bend` times
    /// the square of its first entry added in every cycle.
    fn spiral(bend: f64) -> (Cycle, Vec<State>) {
        let mut monodromy = Matrix4::identity() * 0.5;
        let (sin, cos) = 0.7f64.sin_cos();
        monodromy.fixed_view_mut::<2, 2>(0, 0).copy_from(&nalgebra::Matrix2::new(cos, -sin, sin, cos));
        monodromy.fixed_view_mut::<2, 2>(0, 0).scale_mut(0.97);
        let mut list = vec![Vector4::new(0.01, 0.0, 0.002, 0.0)];
        for n in 0..LINEAR_CYCLES {
            let before = list[n];
            list.push(monodromy * before + Vector4::new(bend * before[0] * before[0], 0.0, 0.0, 0.0));
        }
        let cycle = Cycle {
            state: [0.0; 4],
            period: 1,
            symmetric: false,
            monodromy,
            multipliers: Vec::new(),
            log_radius: 0.97f64.ln(),
            near_grazing: false,
        };
        (cycle, list.into_iter().rev().map(Into::into).collect())
    }

    fn metric() -> Metric {
        Metric::of(&[[0.0; 4]], &Flow::new(&GearPair::paper(0.5).oscillator().unwrap()))
    }

    #[test]
    fn a_spiral_is_linear_and_a_bent_one_is_not() {
        for (bend, linear) in [(0.0, true), (1.0, true), (20.0, false)] {
            let (cycle, strobes) = spiral(bend);
            assert_eq!(is_linear(&cycle, |back| strobes[back], &metric()), linear, "bend {bend}");
        }
    }

    #[test]
    fn what_will_grow_first_is_not_within_reach() {
        let (mut cycle, strobes) = spiral(0.0);
        // Nothing of it has shown yet: a direction in which the motion did not deviate.
        let mut shear = strobes.clone();
        for (n, y) in shear.iter_mut().enumerate() {
            y[2] = 1e-5 * 0.5f64.powi(-(n as i32));
        }
        cycle.monodromy[(0, 2)] = 0.0;
        assert!(is_linear(&cycle, |back| shear[back], &metric()));
        cycle.monodromy[(0, 2)] = 1e5;
        assert!(!is_linear(&cycle, |back| shear[back], &metric()));
    }
}
