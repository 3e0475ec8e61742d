//! The largest Lyapunov exponent as an average over time, with its standard error.

use crate::model::State;
use crate::motion::Trajectory;

/// Number of blocks whose means give the standard error.
const BLOCKS: usize = 16;

/// The correlation of `n` neighbouring blocks is limited to 1 minus this number divided by the square root of `n`: by 1.2 times the scatter
/// of a measured correlation.
pub const CORRELATION_MARGIN: f64 = 1.2;

/// Least number of periods for a finite standard error.
pub const LEAST_FOR_ERROR: u32 = BLOCKS as u32;

/// The initial tangent vector; an oscillator uses as many entries as its states have. It lies in no invariant direction of a gear pair. A
/// vector with equal entries would: without supports, a common translation never meets a wall.
pub const FRESH_TANGENT: State =
    [0.64, -0.36, 0.28, 0.61, -0.47, 0.53, 0.39, -0.58, 0.72, 0.33, -0.29, 0.45, 0.56, -0.68, 0.41, 0.51];

/// The growth of one tangent vector in every period.
#[derive(Clone, Debug, Default)]
pub struct Exponent {
    growth: Vec<f64>,
    /// Whether the vector vanished in the last period.
    vanished: bool,
}

impl Exponent {
    /// Records the growth of the trajectory's first tangent vector since the last call and rescales it to unit
    /// length. A zero vector, as after a superstable orbit, becomes [`FRESH_TANGENT`]. Without tangent vectors
    /// nothing happens.
    pub fn renormalise<const N: usize>(&mut self, trajectory: &mut Trajectory<'_, N>) {
        let tangents = trajectory.tangents();
        let Some(u) = tangents.first() else { return };
        let len = trajectory.flow().state_len();
        let length = u[..len].iter().map(|x| x * x).sum::<f64>().sqrt();
        self.growth.push(length.max(f64::MIN_POSITIVE).ln() + trajectory.log_scale());
        self.vanished = length == 0.0;
        trajectory.set_tangents(tangents.map(|mut u| {
            if length > 0.0 {
                u[..len].iter_mut().for_each(|x| *x /= length);
                u
            } else {
                FRESH_TANGENT
            }
        }));
    }

    /// Whether the vector vanished in the last recorded period: the motion came to rest and forgot its past.
    pub(crate) fn vanished(&self) -> bool {
        self.vanished
    }

    /// Returns the logarithm of the growth over the last `periods`, or none if fewer were recorded.
    pub(crate) fn recent_growth(&self, periods: usize) -> Option<f64> {
        let from = self.growth.len().checked_sub(periods)?;
        Some(self.growth[from..].iter().sum())
    }

    pub(crate) fn periods(&self) -> usize {
        self.growth.len()
    }

    /// Discards the recorded growth, after the periods in which the vector turns to the most expanding direction.
    pub fn reset(&mut self) {
        self.growth.clear();
    }

    /// Returns the mean growth rate per unit time and its [`standard_error`].
    pub fn estimate(&self, forcing_period: f64) -> (f64, f64) {
        let n = self.growth.len();
        if n == 0 {
            return (f64::NAN, f64::INFINITY);
        }
        let mean = self.growth.iter().sum::<f64>() / n as f64;
        (mean / forcing_period, standard_error(&self.growth) / forcing_period)
    }
}

/// Returns the standard error of the mean of consecutive values, from the means of 16 blocks of equal length. The
/// first values are ignored if their number is not a multiple of 16. The error is infinite for fewer than 16 values.
///
/// Blocks that are shorter than the correlation time are correlated. Their correlation is measured between neighbours
/// and taken to fall by a constant ratio from block to block (an AR(1) process).
pub fn standard_error(values: &[f64]) -> f64 {
    let block = values.len() / BLOCKS;
    if block == 0 {
        return f64::INFINITY;
    }
    let means: Vec<f64> = values[values.len() - block * BLOCKS..]
        .chunks(block)
        .map(|chunk| chunk.iter().sum::<f64>() / block as f64)
        .collect();
    let count = BLOCKS as f64;
    let centre = means.iter().sum::<f64>() / count;
    let squares = means.iter().map(|m| (m - centre).powi(2)).sum::<f64>();
    let products = means.windows(2).map(|pair| (pair[0] - centre) * (pair[1] - centre)).sum::<f64>();
    let biased = if squares > 0.0 { products / squares } else { 0.0 };
    // The deviations from a common mean bias the correlation downwards (Marriott and Pope 1954).
    let correlation = biased + (1.0 + 3.0 * biased) / count;
    let correlation = correlation.clamp(0.0, 1.0 - CORRELATION_MARGIN / count.sqrt());
    (squares / (count * (count - 1.0)) * (1.0 + correlation) / (1.0 - correlation)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of an AR(1) process whose correlation time is several blocks.
    #[test]
    fn the_standard_error_is_right_for_correlated_and_for_independent_values() {
        let mut seed = 1_u64;
        let mut noise = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for (memory, least, most) in [(0.0, 0.8, 1.0), (0.97, 0.85, 1.15)] {
            let mut value = 0.0;
            let mut estimate = |_| {
                let values: Vec<f64> = (0..320)
                    .map(|_| {
                        value = memory * value + noise();
                        value
                    })
                    .collect();
                [values.iter().sum::<f64>() / 320.0, standard_error(&values)]
            };
            let found: Vec<[f64; 2]> = (0..2000).map(&mut estimate).collect();
            let [scatter, stated] = [0, 1].map(|i| found.iter().map(|pair| pair[i].powi(2)).sum::<f64>());
            let ratio = (scatter / stated).sqrt();
            assert!((least..most).contains(&ratio), "{memory}: {ratio}");
        }
    }
}
