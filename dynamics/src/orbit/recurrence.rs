//! Recurrence of strobe states: which periods are worth a search.

use nalgebra::Vector4;

use crate::flow::Flow;
use crate::model::State;

/// Recurrences farther apart than this, relative to the motion's size, are no candidates.
pub(super) const NEAR: f64 = 3e-2;

/// Distances between strobe states in units of the motion's own size, positions and
/// velocities apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Metric {
    position: f64,
    velocity: f64,
}

impl Metric {
    /// The metric of a set of strobe states: the largest entries of each kind, but never
    /// less than the flow's scale of length and what that is as a velocity. Where
    /// the strobe catches the motion at its turning point, velocities are all rounding.
    pub(super) fn of(strobes: &[State], flow: &Flow) -> Metric {
        let largest =
            |a: usize, b: usize| strobes.iter().flat_map(|y| [y[a].abs(), y[b].abs()]).fold(0.0, f64::max);
        let position = largest(0, 2).max(flow.length);
        Metric { position, velocity: largest(1, 3).max(flow.omega * position) }
    }

    /// The distance of two states.
    pub(super) fn distance(&self, a: &State, b: &State) -> f64 {
        let apart = |i: usize| (a[i] - b[i]).abs();
        (apart(0).max(apart(2)) / self.position).max(apart(1).max(apart(3)) / self.velocity)
    }

    /// The size of a difference of states.
    pub(super) fn size(&self, difference: &Vector4<f64>) -> f64 {
        self.scaled(difference).amax()
    }

    /// A difference of states in these units.
    pub(super) fn scaled(&self, difference: &Vector4<f64>) -> Vector4<f64> {
        let units = [self.position, self.velocity, self.position, self.velocity];
        difference.component_div(&Vector4::from(units))
    }
}

/// A lag at which the strobe states recur.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// The lag, in forcing periods.
    pub(super) period: u32,
    /// How far apart the states are.
    pub(super) distance: f64,
}

/// For how many of the last periods the states have kept close to those of some lag: they
/// stay near a periodic orbit, stable or not.
pub(super) fn near_saddle(strobes: &[State], metric: &Metric, max_period: u32) -> usize {
    let n = strobes.len();
    let is_near = |i: usize, lag: usize| metric.distance(&strobes[i], &strobes[i - lag]) < NEAR;
    let lasted = |lag: usize| (lag..n).rev().take_while(|&i| is_near(i, lag)).count();
    (1..=(max_period as usize).min(n / 2)).fold(0, |most, lag| {
        // Multiples of a lag stay near about as long: where the longest ended, most end as well.
        if lag + most < n && is_near(n - 1 - most, lag) { most.max(lasted(lag)) } else { most }
    })
}

/// Lags up to `max_period` at which the last states recur, the most promising first: the
/// smallest lag among those that come about as close as any.
pub(super) fn candidates(strobes: &[State], metric: &Metric, max_period: u32) -> Vec<Candidate> {
    let n = strobes.len();
    let mut best = NEAR;
    let mut list = Vec::new();
    for lag in (1..=max_period as usize).take_while(|lag| 2 * lag <= n) {
        let mut distances = (n - lag..n).map(|i| metric.distance(&strobes[i], &strobes[i - lag]));
        // Most lags end here after a few strobes: no better than the best.
        let found = distances.try_fold(0.0f64, |most, d| (d < best).then(|| most.max(d)));
        let Some(distance) = found else { continue };
        // One that recurs ten times as well as all shorter ones is worth its own search.
        if list.is_empty() || distance < 0.1 * best {
            list.push(Candidate { period: lag as u32, distance });
        }
        best = distance;
    }
    list.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decaying_spiral_offers_its_fixed_point_too() {
        // Multipliers 0.9 exp(+- 2 pi i / 3.02): lag 3 comes closest at any time.
        let strobes: Vec<State> = (0..100)
            .map(|n| {
                let (r, phi) = (0.9f64.powi(n), f64::from(n) * std::f64::consts::TAU / 3.02);
                [1.0 + r * phi.cos(), r * phi.sin(), 0.5, 0.5]
            })
            .collect();
        let metric = Metric { position: 1.0, velocity: 1.0 };
        let found = candidates(&strobes, &metric, 8);
        assert!(found.iter().any(|c| c.period == 1), "{found:?}");
    }

    #[test]
    fn a_three_cycle_is_found_at_lag_three_alone() {
        let strobes: Vec<State> = (0..60).map(|n| [f64::from(n % 3), 0.0, 0.0, 1.0]).collect();
        let found = candidates(&strobes, &Metric { position: 2.0, velocity: 1.0 }, 16);
        assert_eq!(found, [Candidate { period: 3, distance: 0.0 }]);
    }
}
