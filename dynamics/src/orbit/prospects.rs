//! Is a recurrence worth Newton's method?
//!
//! A search costs four tangent vectors over several cycles, and chaos recurs all the time as it
//! passes unstable cycles. Two signs tell such a passage. The motion escapes: a strobe state is
//! farther from that of one cycle ago than that one was from its predecessor, or a tangent vector
//! has grown. And the motion returns: the cycle has been found before, or a search from there has
//! failed. Motion that settles loses nothing by these tests. Its recurrences shrink, while its
//! distance to any other cycle, and to where an earlier search began, stays.

use super::recurrence::Metric;
use crate::model::State;
use crate::stability::{Cycle, Exponent, LARGEST_MULTIPLIER, StrobeMap};

/// Recurrences this close need not shrink: rounding is near.
const ROUNDED: f64 = 1e-7;

/// A cycle within so many times the recurrence's distance accounts for it: multipliers that differ
/// from 1 by a quarter make recurrences of a quarter of the distance.
const ACCOUNTS: f64 = 4.0;

/// Cycles over which a tangent vector is seen to grow, where the motion will be checked again ...
const CYCLES: usize = 2;

/// ... and where it will not. About a stable cycle a vector may stretch by the ratio of the axes that
/// it turns along, velocities to displacements, but not more than once: by less than `2^8`.
const LAST_CYCLES: usize = 8;

/// How far the last state is from that of `lag` periods ago, if it is nearer than that one was to
/// its own predecessor; with a lag of several periods, where a search is dear, that one has to have
/// come nearer as well, if there are three lags. None as well before there are two.
pub(super) fn contraction(strobes: &[State], lag: usize, metric: &Metric) -> Option<f64> {
    let last = strobes.len() - 1;
    let apart = |back: usize| {
        let n = last.checked_sub((back + 1) * lag)?;
        Some(metric.distance(&strobes[n], &strobes[n + lag]))
    };
    let (now, before) = (apart(0)?, apart(1)?);
    let is_steady = || lag == 1 || apart(2).is_none_or(|earlier| before <= earlier);
    (now <= before && is_steady() || now <= ROUNDED).then_some(now)
}

/// Whether a tangent vector that has turned its way has grown, over the last two cycles or, if this is
/// the last check, the last eight, by more than any would near a cycle that may be stable.
pub(super) fn escapes(exponent: &Exponent, period: u32, is_last: bool) -> bool {
    let cycles = if is_last { LAST_CYCLES } else { CYCLES };
    let growth = exponent.recent_growth(cycles * period as usize);
    growth.is_some_and(|growth| growth > cycles as f64 * LARGEST_MULTIPLIER.ln())
}

/// Whether growth, as a logarithm, is more than what a vector may stretch by about a stable cycle.
pub(super) fn swings(growth: Option<f64>) -> bool {
    growth.is_some_and(|growth| growth > LAST_CYCLES as f64 * LARGEST_MULTIPLIER.ln())
}

/// What earlier searches have shown.
#[derive(Clone, Debug, Default)]
pub(super) struct Searched {
    /// Unstable cycles.
    unstable: Vec<(StrobeMap, State)>,
    /// States from which a search has led nowhere.
    failed: Vec<(StrobeMap, State)>,
}

impl Searched {
    /// Takes note of an unstable cycle, which `map` was found to have.
    pub(super) fn note(&mut self, map: StrobeMap, cycle: &Cycle) {
        self.unstable.push((map, cycle.state));
    }

    /// Takes note of a state from which no cycle of `map` was found.
    pub(super) fn note_failed(&mut self, map: StrobeMap, state: State) {
        self.failed.push((map, state));
    }

    /// Whether a state that recurs at this distance under `map` does so beside an unstable cycle,
    /// or where a search has failed.
    pub(super) fn account_for(&self, map: StrobeMap, state: &State, distance: f64, metric: &Metric) -> bool {
        let is_near = |y: &State| metric.distance(state, y) < ACCOUNTS * distance;
        // What recurs after some periods does so after their multiples.
        self.unstable.iter().any(|(of, y)| map.iterates(*of) && is_near(y))
            || self.failed.iter().any(|(of, y)| *of == map && is_near(y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::Flow;
    use crate::model::GearPair;

    /// A multiplier's powers about the origin.
    fn powers(multiplier: f64, start: f64) -> Vec<State> {
        (0..20).map(|n| [start * multiplier.powi(n), 0.0, 0.0, 0.0]).collect()
    }

    fn metric() -> Metric {
        Metric::of(&[[0.0; 4]], &Flow::new(&GearPair::paper(0.5).oscillator().unwrap()))
    }

    #[test]
    fn what_settles_contracts_and_what_leaves_does_not() {
        for (multiplier, contracts) in
            [(0.5, true), (-0.9, true), (0.999, true), (1.001, false), (-1.2, false)]
        {
            for lag in [1, 2, 6] {
                let found = contraction(&powers(multiplier, 1e-3), lag, &metric());
                assert_eq!(found.is_some(), contracts, "{multiplier} at lag {lag}");
            }
        }
        assert!(contraction(&powers(1.001, 1e-9), 1, &metric()).is_some(), "rounding");
        assert!(contraction(&powers(0.5, 1e-3), 10, &metric()).is_none(), "too short to tell");
        // Apart by 1, 4, 2: nearer than before, but not for long.
        let at = |x: f64| [1e-3 * x, 0.0, 0.0, 0.0];
        let recent = [0.0, 1.0, 5.0, 7.0].map(at);
        assert!(contraction(&recent, 1, &metric()).is_some());
        let slower = [0.0, 0.0, 1.0, 1.0, 5.0, 5.0, 7.0, 7.0].map(at);
        assert!(contraction(&slower, 2, &metric()).is_none());
        assert!(contraction(&slower[2..], 2, &metric()).is_some(), "two lags are all there is");
    }

    #[test]
    fn a_cycle_accounts_for_what_passes_it_and_not_for_what_settles_elsewhere() {
        let (map, mut known) = (StrobeMap::Periods(1), Searched::default());
        let pair = GearPair::paper(0.5);
        let flow = Flow::new(&pair.oscillator().unwrap());
        let seed = crate::reference::Trajectory::new(&flow, pair.law(), [0.0; 4]);
        let mut cycle = crate::stability::refine(&seed, map).unwrap();
        cycle.state = [0.0; 4];
        known.note(map, &cycle);
        let passes = |multiplier: f64| {
            let strobes = powers(multiplier, 1e-3);
            let (last, before) = (strobes[19], strobes[18]);
            known.account_for(map, &last, metric().distance(&last, &before), &metric())
        };
        assert!(passes(1.5) && passes(-1.3) && passes(0.7));
        assert!(!passes(1.1), "it hardly moves: there may be another");
        let settles = |n: i32| {
            let at = |n: i32| [0.01 * (1.0 + 0.6f64.powi(n)), 0.0, 0.0, 0.0];
            known.account_for(map, &at(n), metric().distance(&at(n), &at(n - 1)), &metric())
        };
        assert!(!settles(8) && !settles(20));
        let accounts = |known: &Searched, map| known.account_for(map, &[0.0; 4], 1.0, &metric());
        assert!(accounts(&known, StrobeMap::Periods(2)), "twice around");
        assert!(!accounts(&known, StrobeMap::MirroredHalves(3)), "it need not be symmetric");
        // A failed search says nothing of longer cycles.
        let mut known = Searched::default();
        known.note_failed(map, [0.0; 4]);
        assert!(accounts(&known, map) && !accounts(&known, StrobeMap::Periods(2)));
    }

    #[test]
    fn a_tangent_that_grows_escapes() {
        let growing = |factor: f64| {
            let mut exponent = Exponent::default();
            let pair = GearPair::paper(0.5);
            let flow = Flow::new(&pair.oscillator().unwrap());
            let mut carrier =
                crate::reference::Trajectory::new(&flow, pair.law(), [0.0; 4]).carrying([[0.5; 4]]);
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

    /// Displacement and velocity take turns: what is a short vector now is a long one a quarter turn later.
    #[test]
    fn a_tangent_that_turns_does_not_escape() {
        let pair = GearPair::paper(0.5);
        let flow = Flow::new(&pair.oscillator().unwrap());
        let fresh = crate::reference::Trajectory::new(&flow, pair.law(), [0.0; 4]);
        let (radius, ratio) = (0.9, 100.0);
        let (mut seems, mut count) = (0, 0);
        for angle in [0.3, 0.7, 1.1, 1.5] {
            let (sin, cos) = f64::sin_cos(angle);
            let mut carrier = fresh.carrying([[0.6, 0.8, 0.0, 0.0]]);
            let mut exponent = Exponent::default();
            for n in 0..60 {
                let [[x, v, ..]] = carrier.tangents();
                let turned = [cos * x + sin * v / ratio, cos * v - sin * x * ratio, 0.0, 0.0];
                carrier.set_tangents([turned.map(|y| radius * y)]);
                exponent.renormalise(&mut carrier);
                assert!(n < 8 || !escapes(&exponent, 1, true), "after {n} turns by {angle}");
                seems += u32::from(escapes(&exponent, 1, false));
                count += 1;
            }
        }
        assert!(10 * seems > count / 4, "a search may be put off so: {seems} of {count} times");
    }
}
