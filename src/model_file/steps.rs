//! Entries that depend on the phase of the forcing. Stages of equal length replace them, with the mean of the entry over each stage.
//!
//! The difference between an entry and its steps has the integral 0 over each stage. So its integral over the phase, of which the motion
//! depends, is of order 1/N^2 for N stages, and so is the error of the motion.

use std::f64::consts::TAU;

use rattlemap_dynamics::model::{MOST_CHANGES, MOST_STAGES, OscillatorError};

use super::motion::MotionTable;
use crate::text::expression::Expression;

/// Name of the phase in entries.
pub(super) const PHASE: &str = "phase";

/// Intervals of the period at whose ends and middles an entry is evaluated.
const INTERVALS: usize = 512;

/// Rounding of a mean, relative to the power of two below the largest value: equal stages are then equal to the bit.
const ROUNDING: f64 = 1.0 / (1_u64 << 44) as f64;

/// The stages that replace the entries with the phase.
#[derive(Debug, Default)]
pub(super) struct Steps {
    /// Number of stages.
    pub(super) count: usize,
    /// The root mean square of the difference between the integrals of an entry and of its steps over the phase in radians, relative to the
    /// largest value of the entry.
    pub(super) error: f64,
    /// Mean of each entry over each stage.
    means: Vec<Vec<f64>>,
}

impl Steps {
    /// Divides the period into the smallest even number of stages whose error is within the tolerance. Even numbers keep the symmetry of
    /// motions that recur after half a period.
    ///
    /// # Errors
    /// [`OscillatorError::OutOfRange`] if too many stages are needed.
    pub(super) fn new(motion: &MotionTable, parameters: &[f64]) -> Result<Steps, OscillatorError> {
        let sampled: Vec<_> = motion.by_phase.iter().map(|entry| Sampled::new(entry, parameters)).collect();
        let error = |count| sampled.iter().map(|entry| entry.error(count)).fold(0.0, f64::max);
        let most = MOST_STAGES.min(MOST_CHANGES / motion.repeat as usize);
        let counts = (2..=most).step_by(2).map(|count| (count, error(count)));
        match counts.clone().find(|&(_, error)| error <= motion.tolerance) {
            Some((count, error)) => {
                let mean = |entry: &Sampled| (0..count).map(|stage| entry.mean(stage, count)).collect();
                Ok(Steps { count, error, means: sampled.iter().map(mean).collect() })
            }
            None => Err(OscillatorError::OutOfRange {
                quantity: format!("number of stages for a tolerance of {}", motion.tolerance),
                value: 2.0 * (0.5 * most as f64 * (error(most) / motion.tolerance).sqrt()).ceil(),
                requirement: "at most 64, and `repeat` times it at most 1024; write a larger `tolerance` in [motion]",
            }),
        }
    }

    /// Returns the mean over a stage of the entry with this index in [`MotionTable::by_phase`].
    pub(super) fn mean(&self, entry: usize, stage: usize) -> f64 {
        self.means[entry][stage]
    }
}

/// An entry and its integral from phase 0, at the ends of the intervals. The unit of the phase is one interval.
struct Sampled {
    values: Vec<f64>,
    integrals: Vec<f64>,
    largest: f64,
}

impl Sampled {
    fn new(entry: &Expression, parameters: &[f64]) -> Sampled {
        let at = |intervals: f64| {
            let phase = TAU / INTERVALS as f64 * intervals;
            entry.evaluate(&|index| parameters.get(index).copied().unwrap_or(phase))
        };
        let values: Vec<f64> = (0..=INTERVALS).map(|i| at(i as f64)).collect();
        let mut integrals = vec![0.0];
        for (i, ends) in values.windows(2).enumerate() {
            integrals.push(integrals[i] + (ends[0] + 4.0 * at(i as f64 + 0.5) + ends[1]) / 6.0);
        }
        Sampled { largest: values.iter().fold(0.0, |most, value| value.abs().max(most)), values, integrals }
    }

    /// Returns the integral from phase 0 to a part of the period, by a cubic polynomial with the values at the ends as slopes.
    fn integral(&self, part: f64) -> f64 {
        let position = part * INTERVALS as f64;
        let i = (position as usize).min(INTERVALS - 1);
        let (t, [a, b]) = (position - i as f64, [self.integrals[i], self.integrals[i + 1]]);
        let ([from, to], chord) = ([self.values[i], self.values[i + 1]], b - a);
        a + t * (from + t * (3.0 * chord - 2.0 * from - to + t * (from + to - 2.0 * chord)))
    }

    fn mean(&self, stage: usize, count: usize) -> f64 {
        let end = |stage: usize| self.integral(stage as f64 / count as f64);
        let mean = (end(stage + 1) - end(stage)) * count as f64 / INTERVALS as f64;
        let power_of_two = f64::from_bits(self.largest.to_bits() & f64::INFINITY.to_bits());
        let unit = (power_of_two * ROUNDING).max(f64::MIN_POSITIVE);
        (mean / unit).round() * unit
    }

    fn error(&self, count: usize) -> f64 {
        let ends: Vec<f64> = (0..=count).map(|stage| self.integral(stage as f64 / count as f64)).collect();
        let difference = |(i, integral): (usize, &f64)| {
            let position = i as f64 * count as f64 / INTERVALS as f64;
            let stage = (position as usize).min(count - 1);
            let by_steps = ends[stage] + (position - stage as f64) * (ends[stage + 1] - ends[stage]);
            (integral - by_steps).powi(2)
        };
        let sum: f64 = self.integrals.iter().enumerate().map(difference).sum();
        let scale = self.largest.max(f64::MIN_POSITIVE);
        // An entry that is not a number is found by the checks of its stages.
        ((sum / INTERVALS as f64).sqrt() * TAU / INTERVALS as f64 / scale).max(0.0)
    }
}
