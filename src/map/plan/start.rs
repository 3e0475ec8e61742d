//! The starts of runs. Pure.

use crate::map::random::Random;
use crate::map::scene::{Draw, Start};
use crate::record::classify::status;
use crate::record::{Record, valid};
use rattlemap_dynamics::machine::System;
use rattlemap_dynamics::model::{GapRow, Oscillator, REST, Restitution, Side, State, state};

/// Range of random starts: displacements are within this many scales of length of the middle, velocities within this
/// many times the corresponding velocity. The attractors of the paper's plane are inside.
const START_RANGE: f64 = 4.0;

/// The starts of every cell, in units that depend on the cell.
#[derive(Clone, Debug)]
pub(super) struct Starts {
    policy: Start,
    /// Random starts after the first. All cells have the same ones, so that neighbouring cells differ only in their
    /// parameters.
    draws: Vec<[f64; 4]>,
    /// Further numbers of each start, for models of more than two coordinates.
    further: Vec<State>,
}

impl Starts {
    pub(super) fn new(policy: Start, draw: Option<Draw>) -> Starts {
        let Draw { count, seed } = draw.unwrap_or(Draw { count: 1, seed: 0 });
        let mut random = Random::new(u64::from(seed));
        let draws = (1..count).map(|_| std::array::from_fn(|_| 2.0 * random.unit() - 1.0)).collect();
        // A sequence of its own, so that other models keep their starts.
        let mut random = Random::new(u64::from(seed) ^ FURTHER);
        let further = (1..count).map(|_| std::array::from_fn(|_| 2.0 * random.unit() - 1.0)).collect();
        Starts { policy, draws, further }
    }

    pub(super) fn count(&self) -> usize {
        1 + self.draws.len()
    }

    pub(super) fn policy(&self) -> Start {
        self.policy
    }

    /// Returns the start of the policy.
    pub(super) fn first(&self) -> State {
        match self.policy {
            Start::State(state) => state,
            Start::Rest | Start::Up | Start::Down | Start::Both => REST,
        }
    }

    /// Returns the random start `nth`, from 1. With the scale of length `l`, the gap is uniform between the walls, or
    /// within `2 l` of a single wall; the second displacement is within `4 l`, both velocities within `4 l omega`.
    pub(super) fn random(&self, nth: usize, oscillator: &Oscillator) -> State {
        if !is_of_four_numbers(oscillator) {
            return self.random_of_all(nth, oscillator);
        }
        let [gap, v1, x2, v2] = self.draws[nth - 1];
        let length = oscillator.length_scale();
        let (z, x2) = (between(first_walls(&oscillator.gaps[0]), length, gap), START_RANGE * length * x2);
        let speed = START_RANGE * length * oscillator.omega;
        let [g1, g2, ..] = oscillator.gap_row(0);
        state(&[(z - g2 * x2) / g1, speed * v1, x2, speed * v2])
    }

    /// Returns a random start of any number of coordinates: all gaps with independent rows lie between their first walls.
    fn random_of_all(&self, nth: usize, oscillator: &Oscillator) -> State {
        let (draws, length, n) = (&self.further[nth - 1], oscillator.length_scale(), oscillator.degrees());
        let (positions, rates) = draws.split_at(n);
        let mut placed: Vec<f64> = positions.iter().map(|x| START_RANGE * length * x).collect();
        for ((gap, share), z) in oscillator.leading_gaps().into_iter().zip(positions).zip(&mut placed) {
            *z = between(first_walls(&oscillator.gaps[gap]), length, *share);
        }
        let displacements = System::new(oscillator).displacements(&placed);
        let speed = START_RANGE * length * oscillator.omega;
        let mut start = REST;
        for (i, (x, v)) in displacements.iter().zip(rates).enumerate() {
            (start[2 * i], start[2 * i + 1]) = (*x, speed * v);
        }
        start
    }
}

/// Whether four numbers describe a random start. Models with restitution by speed were added later, with the second sequence.
fn is_of_four_numbers(oscillator: &Oscillator) -> bool {
    let mut walls = oscillator.gaps.iter().flat_map(|gap| gap.walls.iter().flatten());
    oscillator.degrees() <= 2
        && oscillator.gaps.len() == 1
        && !walls.any(|wall| matches!(wall.restitution, Restitution::BySpeed { .. }))
}

/// Returns the positions of the first walls of a gap, infinite without a wall.
fn first_walls(gap: &GapRow) -> [f64; 2] {
    Side::BOTH.map(|side| gap.walls[side.index()].first().map_or(side.sign() * f64::INFINITY, |wall| wall.at))
}

/// Distinguishes the second sequence of random numbers from the first.
const FURTHER: u64 = 0x6d61_6368_696e_6573;

/// Returns the gap at a share from -1 to 1 of the room between the walls, or of twice the scale of length at a single wall.
fn between(walls: [f64; 2], length: f64, share: f64) -> f64 {
    let [right, left] = match walls {
        [f64::INFINITY, f64::NEG_INFINITY] => [length, -length],
        [f64::INFINITY, left] => [left + 2.0 * length, left],
        [right, f64::NEG_INFINITY] => [right, right - 2.0 * length],
        both => both,
    };
    let (middle, half) = (0.5 * (right + left), 0.5 * (right - left));
    middle + half * share
}

/// Returns the start of a run that follows the neighbour with this record.
pub(crate) fn followed(record: Option<&Record>) -> State {
    let usable = |record: &&Record| {
        record.valid & valid::STROBE != 0
            && !status(record).is_failure()
            && record.strobe().iter().all(|x| x.is_finite())
    };
    record.filter(usable).map_or(REST, |record| record.strobe())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;
    use rattlemap_dynamics::model::{GearPair, Model};
    use rattlemap_dynamics::orbit::Status;

    #[test]
    fn drawn_starts_lie_on_the_free_side_of_a_single_wall() {
        let starts = Starts::new(Start::Rest, Some(Draw { count: 200, seed: 7 }));
        let pair = GearPair::paper(0.5).oscillator().unwrap();
        for (walls, [low, high]) in [
            ([0.25, f64::NEG_INFINITY], [-3.75, 0.25]),
            ([f64::INFINITY, 0.25], [0.25, 4.25]),
            ([f64::INFINITY, f64::NEG_INFINITY], [-2.0, 2.0]),
        ] {
            let mut oscillator = Oscillator { omega: 1.0, ..pair.clone() };
            oscillator.drives[0].cos[0] = 64.0;
            for (own, at) in oscillator.gaps[0].walls.iter_mut().zip(walls) {
                own.retain_mut(|wall| {
                    wall.at = at;
                    at.is_finite()
                });
            }
            for nth in 1..200 {
                let y = starts.random(nth, &oscillator);
                let gap = y[0] - y[2];
                assert!((low..=high).contains(&gap) && y.iter().all(|x| x.is_finite()), "{walls:?}: {y:?}");
            }
        }
    }

    #[test]
    fn drawn_starts_of_a_machine_lie_between_the_walls_of_all_gaps() {
        let starts = Starts::new(Start::Rest, Some(Draw { count: 100, seed: 3 }));
        let oscillator = FileModel::built_in("two-loose-gears").unwrap().oscillator().unwrap();
        for nth in 1..100 {
            let y = starts.random(nth, &oscillator);
            for (i, gap) in oscillator.gaps.iter().enumerate() {
                let [right, left] = gap.walls.each_ref().map(|walls| walls[0].at);
                let z = oscillator.gap_value(i, &y, 0);
                assert!(left < z && z < right && y[1] != 0.0 && y[5] != 0.0, "{y:?}");
            }
        }
    }

    #[test]
    fn drawn_starts_scale_with_the_cell_and_lie_between_the_walls() {
        let starts = Starts::new(Start::Rest, Some(Draw { count: 200, seed: 7 }));
        assert_eq!((starts.count(), starts.first()), (200, REST));
        let of = |pair: GearPair| pair.oscillator().unwrap();
        let small = of(GearPair::paper(0.5));
        let large = of(GearPair { b: 1.0, omega: 2.0 * small.omega, ..GearPair::paper(0.5) });
        let mut ranges = [[0.0f64; 2]; 2];
        for nth in 1..200 {
            let (a, b) = (starts.random(nth, &small), starts.random(nth, &large));
            let gap = a[0] - a[2];
            assert!(gap.abs() < 0.5 && a[2].abs() < 2.0, "{a:?}");
            // Twice the backlash and twice the frequency.
            for (a, b, scale) in [(a[0], b[0], 2.0), (a[1], b[1], 4.0), (a[2], b[2], 2.0), (a[3], b[3], 4.0)]
            {
                assert!((b - scale * a).abs() < 1e-12 * (1.0 + b.abs()));
            }
            for (range, x) in ranges.iter_mut().zip([gap / 0.5, a[3] / (2.0 * small.omega)]) {
                *range = [range[0].min(x), range[1].max(x)];
            }
        }
        assert!(ranges.iter().all(|[low, high]| *low < -0.95 && *high > 0.95), "{ranges:?}");
        let other = Starts::new(Start::Rest, Some(Draw { count: 200, seed: 8 }));
        assert_ne!(starts.random(1, &small), other.random(1, &small));
    }

    #[test]
    fn runs_start_at_rest_if_the_neighbour_has_no_last_state() {
        let end = state(&[1.0, 2.0, 3.0, 4.0]);
        let record = Record { strobe: end.into(), valid: valid::STROBE, ..Record::default() };
        assert_eq!(followed(Some(&record)), end);
        let failed = Record { status: Status::CapEvents.code(), ..record.clone() };
        let infinite = Record { strobe: [f64::NAN; 4].into(), ..record };
        for record in [None, Some(&failed), Some(&infinite), Some(&Record::default())] {
            assert_eq!(followed(record), REST, "{record:?}");
        }
    }
}
