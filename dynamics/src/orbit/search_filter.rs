//! Tests that avoid Newton searches which would not find a stable cycle.
//!
//! A search integrates four tangent vectors over several cycles, and chaotic motion recurs often, as it passes
//! unstable cycles. Two signs identify such a passage:
//!
//! - The motion escapes: the distance between strobe states one cycle apart grows, or a tangent vector grows.
//! - The recurrence is known: an earlier search found an unstable cycle here, or failed here.
//!
//! The tests do not affect motion that converges to a stable cycle. Its recurrences shrink, but its distances from
//! other cycles and from the starts of earlier searches do not.

use super::recurrence::Metric;
use crate::model::State;
use crate::stability::{Cycle, Exponent, LARGEST_MULTIPLIER, StrobeMap};

/// Distances of recurrences below this are near rounding and need not shrink.
const RECURRENCE_ROUNDING: f64 = 1e-7;

/// Largest distance of a known cycle that explains a recurrence, in units of the recurrence's distance: a multiplier
/// that differs from 1 by a quarter makes recurrences of a quarter of the distance.
const EXPLAINED_RATIO: f64 = 4.0;

/// Number of cycles over which the growth of a tangent vector is tested, if another check follows.
const ESCAPE_CYCLES: usize = 2;

/// Number of cycles over which that growth is tested at the last check. Near a stable cycle a vector may stretch
/// once, while it turns from displacements to velocities, but by less than `2^8`.
const LAST_ESCAPE_CYCLES: usize = 8;

/// Returns the distance between the last strobe state and that of `lag` periods ago, if it is smaller than the distance one lag earlier.
/// With a lag of more than one period, whose search is expensive, the distance one lag earlier must also be smaller than the distance two
/// lags earlier, if it is known. Returns none if there are fewer than two lags.
pub(super) fn contraction(strobes: &[State], lag: usize, metric: &Metric) -> Option<f64> {
    let last = strobes.len() - 1;
    let distance = |back: usize| {
        let n = last.checked_sub((back + 1) * lag)?;
        Some(metric.distance(&strobes[n], &strobes[n + lag]))
    };
    let (now, before) = (distance(0)?, distance(1)?);
    let is_steady = || lag == 1 || distance(2).is_none_or(|earlier| before <= earlier);
    (now <= before && is_steady() || now <= RECURRENCE_ROUNDING).then_some(now)
}

/// Whether a tangent vector has grown by more than is possible near a stable cycle, over the last two cycles, or the
/// last eight if this is the last check.
pub(super) fn escapes(exponent: &Exponent, period: u32, is_last: bool) -> bool {
    let cycles = if is_last { LAST_ESCAPE_CYCLES } else { ESCAPE_CYCLES };
    let growth = exponent.recent_growth(cycles * period as usize);
    growth.is_some_and(|growth| growth > cycles as f64 * LARGEST_MULTIPLIER.ln())
}

/// Whether the growth of a tangent vector, as a logarithm, is more than the stretch that is possible near a stable
/// cycle.
pub(super) fn exceeds_stretch(growth: Option<f64>) -> bool {
    growth.is_some_and(|growth| growth > LAST_ESCAPE_CYCLES as f64 * LARGEST_MULTIPLIER.ln())
}

/// The results of earlier searches of a cell.
#[derive(Clone, Debug, Default)]
pub(super) struct SearchHistory {
    /// Unstable cycles.
    unstable: Vec<(StrobeMap, State)>,
    /// States from which a search has failed.
    failed: Vec<(StrobeMap, State)>,
}

impl SearchHistory {
    /// Adds an unstable cycle, a fixed point of `map`.
    pub(super) fn add_unstable(&mut self, map: StrobeMap, cycle: &Cycle) {
        self.unstable.push((map, cycle.state));
    }

    /// Adds a state from which no cycle of `map` was found.
    pub(super) fn add_failure(&mut self, map: StrobeMap, state: State) {
        self.failed.push((map, state));
    }

    /// Whether an unstable cycle or a failed search explains that a state recurs at this distance under `map`.
    pub(super) fn explains(&self, map: StrobeMap, state: &State, distance: f64, metric: &Metric) -> bool {
        let is_near = |y: &State| metric.distance(state, y) < EXPLAINED_RATIO * distance;
        // A state that recurs after some periods also recurs after their multiples.
        self.unstable.iter().any(|(of, y)| map.iterates(*of) && is_near(y))
            || self.failed.iter().any(|(of, y)| *of == map && is_near(y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{GearPair, REST, state};
    use crate::motion::Flow;

    /// Returns the strobe states of a motion with one multiplier, near a cycle at the origin.
    fn powers(multiplier: f64, start: f64) -> Vec<State> {
        (0..20).map(|n| state(&[start * multiplier.powi(n)])).collect()
    }

    fn metric() -> Metric {
        Metric::of(&[REST], &Flow::new(&GearPair::paper(0.5).oscillator().unwrap()))
    }

    #[test]
    fn stable_multipliers_contract_and_unstable_ones_do_not() {
        for (multiplier, contracts) in
            [(0.5, true), (-0.9, true), (0.999, true), (1.001, false), (-1.2, false)]
        {
            for lag in [1, 2, 6] {
                let found = contraction(&powers(multiplier, 1e-3), lag, &metric());
                assert_eq!(found.is_some(), contracts, "{multiplier} at lag {lag}");
            }
        }
        assert!(contraction(&powers(1.001, 1e-9), 1, &metric()).is_some(), "rounding");
        assert!(contraction(&powers(0.5, 1e-3), 10, &metric()).is_none(), "fewer than two lags");
        // The distances are 1, 4 and 2: closer than before, but only once.
        let at = |x: f64| state(&[1e-3 * x]);
        let recent = [0.0, 1.0, 5.0, 7.0].map(at);
        assert!(contraction(&recent, 1, &metric()).is_some());
        let slower = [0.0, 0.0, 1.0, 1.0, 5.0, 5.0, 7.0, 7.0].map(at);
        assert!(contraction(&slower, 2, &metric()).is_none());
        assert!(contraction(&slower[2..], 2, &metric()).is_some(), "only two lags");
    }

    #[test]
    fn a_known_cycle_explains_passages_and_not_convergence_elsewhere() {
        let (map, mut history) = (StrobeMap::Periods(1), SearchHistory::default());
        let pair = GearPair::paper(0.5);
        let flow = Flow::new(&pair.oscillator().unwrap());
        let seed = crate::motion::Trajectory::new(&flow, pair.law(), REST);
        let mut cycle = crate::stability::refine(&seed, map).unwrap();
        cycle.state = REST;
        history.add_unstable(map, &cycle);
        let passage = |multiplier: f64| {
            let strobes = powers(multiplier, 1e-3);
            let (last, before) = (strobes[19], strobes[18]);
            history.explains(map, &last, metric().distance(&last, &before), &metric())
        };
        assert!(passage(1.5) && passage(-1.3) && passage(0.7));
        assert!(!passage(1.1), "it hardly moves: there may be another cycle");
        let convergence = |n: i32| {
            let at = |n: i32| state(&[0.01 * (1.0 + 0.6f64.powi(n))]);
            history.explains(map, &at(n), metric().distance(&at(n), &at(n - 1)), &metric())
        };
        assert!(!convergence(8) && !convergence(20));
        let explains = |history: &SearchHistory, map| history.explains(map, &REST, 1.0, &metric());
        assert!(explains(&history, StrobeMap::Periods(2)), "twice the period");
        assert!(!explains(&history, StrobeMap::MirroredHalves(3)), "it need not be symmetric");
        // A failed search does not explain longer cycles.
        let mut history = SearchHistory::default();
        history.add_failure(map, REST);
        assert!(explains(&history, map) && !explains(&history, StrobeMap::Periods(2)));
    }

    #[test]
    fn a_growing_tangent_escapes() {
        let growing = |factor: f64| {
            let mut exponent = Exponent::default();
            let pair = GearPair::paper(0.5);
            let flow = Flow::new(&pair.oscillator().unwrap());
            let mut carrier =
                crate::motion::Trajectory::new(&flow, pair.law(), REST).carrying([state(&[0.5; 4])]);
            for _ in 0..6 {
                let [u] = carrier.tangents();
                carrier.set_tangents([u.map(|x| factor * x)]);
                exponent.renormalise(&mut carrier);
            }
            exponent
        };
        for (factor, period, expected) in
            [(1.9, 1, false), (2.1, 1, true), (1.2, 3, false), (1.3, 3, true), (9.0, 4, false)]
        {
            let found = escapes(&growing(factor), period, false);
            assert_eq!(found, expected, "{factor} in each of {period} periods");
        }
    }

    /// While a vector turns from displacements to velocities its length grows, although its multiplier is stable.
    #[test]
    fn a_turning_tangent_does_not_escape() {
        let pair = GearPair::paper(0.5);
        let flow = Flow::new(&pair.oscillator().unwrap());
        let fresh = crate::motion::Trajectory::new(&flow, pair.law(), REST);
        let (radius, ratio) = (0.9, 100.0);
        let (mut apparent, mut count) = (0, 0);
        for angle in [0.3, 0.7, 1.1, 1.5] {
            let (sin, cos) = f64::sin_cos(angle);
            let mut carrier = fresh.carrying([state(&[0.6, 0.8])]);
            let mut exponent = Exponent::default();
            for n in 0..60 {
                let [[x, v, ..]] = carrier.tangents();
                let turned = state(&[cos * x + sin * v / ratio, cos * v - sin * x * ratio]);
                carrier.set_tangents([turned.map(|y| radius * y)]);
                exponent.renormalise(&mut carrier);
                assert!(n < 8 || !escapes(&exponent, 1, true), "after {n} turns by {angle}");
                apparent += u32::from(escapes(&exponent, 1, false));
                count += 1;
            }
        }
        assert!(10 * apparent > count / 4, "{apparent} apparent escapes over two cycles, of {count}");
    }
}
