//! Recurrence of strobe states: candidates for the period of a motion.

use crate::model::State;
use crate::motion::Flow;

/// Largest distance of a recurrence, relative to the size of the motion.
pub(super) const RECURRENCE_DISTANCE: f64 = 3e-2;

/// A metric of strobe states: positions and velocities are divided by their sizes in the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Metric {
    position: f64,
    velocity: f64,
    /// Number of entries of a state.
    len: usize,
}

impl Metric {
    /// Builds the metric of a set of strobe states from the largest position and the largest velocity. The flow's scale of length, and this
    /// scale times the flow's rate, are lower bounds: at a turning point, velocities are rounding errors.
    pub(super) fn of(strobes: &[State], flow: &Flow) -> Metric {
        let len = flow.state_len();
        let mut largest = [0.0f64; 2];
        for y in strobes {
            for pair in y[..len].as_chunks::<2>().0 {
                largest = [0, 1].map(|i| largest[i].max(pair[i].abs()));
            }
        }
        let position = largest[0].max(flow.length);
        Metric { position, velocity: largest[1].max(flow.omega * position), len }
    }

    /// Returns the number of entries of a state.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    #[inline]
    pub(super) fn distance(&self, a: &State, b: &State) -> f64 {
        let difference = |i: usize| (a[i] - b[i]).abs();
        let mut largest = [0, 1].map(|i| difference(i).max(difference(i + 2)));
        for i in (4..self.len).step_by(2) {
            largest = [0, 1].map(|j| largest[j].max(difference(i + j)));
        }
        (largest[0] / self.position).max(largest[1] / self.velocity)
    }

    /// Returns the size of a difference of states with at most `N` nonzero entries.
    pub(super) fn size<const N: usize>(&self, difference: &[f64; N]) -> f64 {
        let scaled = self.scaled(difference);
        scaled[1..].iter().fold(scaled[0].abs(), |most, value| most.max(value.abs()))
    }

    /// Returns a difference of states in the units of the metric.
    #[inline]
    pub(super) fn scaled<const N: usize>(&self, difference: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|i| difference[i] / self.unit(i))
    }

    /// Returns the unit of an entry of a state.
    pub(super) fn unit(&self, i: usize) -> f64 {
        if i.is_multiple_of(2) { self.position } else { self.velocity }
    }
}

/// A lag at which the strobe states recur.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// The lag, in forcing periods.
    pub(super) period: u32,
    /// The largest distance of two states at this lag.
    pub(super) distance: f64,
}

/// Largest distance of two states that are equal within rounding, relative to the motion.
const WITHIN_ROUNDING: f64 = 1e-12;

/// Returns the number of last periods over which the states recur at some lag: the motion stays near a periodic
/// orbit, stable or unstable.
pub(super) fn near_saddle(strobes: &[State], metric: &Metric, max_period: u32) -> usize {
    recurring(strobes, metric, max_period, RECURRENCE_DISTANCE)
}

/// Whether the states recur within rounding at some lag: the motion rests on a cycle, and growth of its tangents is not chaos.
pub(super) fn rests(strobes: &[State], metric: &Metric, max_period: u32) -> bool {
    2 * recurring(strobes, metric, max_period, WITHIN_ROUNDING) >= strobes.len()
}

/// Returns the number of last periods over which the states recur at some lag, within a distance.
fn recurring(strobes: &[State], metric: &Metric, max_period: u32, within: f64) -> usize {
    let n = strobes.len();
    let is_near = |i: usize, lag: usize| metric.distance(&strobes[i], &strobes[i - lag]) < within;
    let duration = |lag: usize| (lag..n).rev().take_while(|&i| is_near(i, lag)).count();
    (1..=(max_period as usize).min(n / 2)).fold(0, |most, lag| {
        // If states at this lag are not near where the longest recurrence so far ended, this recurrence is not longer.
        if lag + most < n && is_near(n - 1 - most, lag) { most.max(duration(lag)) } else { most }
    })
}

/// Returns lags up to `max_period` at which the last states recur, in order of distance. A lag is left out if a
/// smaller one recurs about as well.
pub(super) fn candidates(strobes: &[State], metric: &Metric, max_period: u32) -> Vec<Candidate> {
    let n = strobes.len();
    let mut best = RECURRENCE_DISTANCE;
    let mut list = Vec::new();
    for lag in (1..=max_period as usize).take_while(|lag| 2 * lag <= n) {
        let mut distances = (n - lag..n).map(|i| metric.distance(&strobes[i], &strobes[i - lag]));
        // For most lags this ends after a few strobes, because they are no better than the best.
        let largest = distances.try_fold(0.0f64, |most, d| (d < best).then(|| most.max(d)));
        let Some(distance) = largest else { continue };
        // The distance at a lag must be ten times smaller than at all shorter lags.
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
    use crate::model::state;

    #[test]
    fn a_decaying_spiral_has_its_fixed_point_among_the_candidates() {
        // Multipliers 0.9 exp(+- 2 pi i / 3.02): lag 3 is always closest.
        let strobes: Vec<State> = (0..100)
            .map(|n| {
                let (r, phi) = (0.9f64.powi(n), f64::from(n) * std::f64::consts::TAU / 3.02);
                state(&[1.0 + r * phi.cos(), r * phi.sin(), 0.5, 0.5])
            })
            .collect();
        let metric = Metric { position: 1.0, velocity: 1.0, len: 4 };
        let found = candidates(&strobes, &metric, 8);
        assert!(found.iter().any(|c| c.period == 1), "{found:?}");
    }

    #[test]
    fn a_three_cycle_has_lag_three_as_its_only_candidate() {
        let strobes: Vec<State> = (0..60).map(|n| state(&[f64::from(n % 3), 0.0, 0.0, 1.0])).collect();
        let found = candidates(&strobes, &Metric { position: 2.0, velocity: 1.0, len: 4 }, 16);
        assert_eq!(found, [Candidate { period: 3, distance: 0.0 }]);
    }
}
