//! The largest Lyapunov exponent as an average over time, with its standard error.

use crate::model::State;
use crate::reference::Trajectory;

/// Number of blocks whose means give the standard error.
const BLOCKS: usize = 16;

/// Least number of periods for a finite standard error.
pub const LEAST_FOR_ERROR: u32 = BLOCKS as u32;

/// The initial tangent vector. It lies in no invariant direction of a gear pair. Equal entries would be a common
/// translation, which without supports never meets a wall.
pub const FRESH_TANGENT: State = [0.64, -0.36, 0.28, 0.61];

/// The growth of one tangent vector in every period.
#[derive(Clone, Debug, Default)]
pub struct Exponent {
    growth: Vec<f64>,
}

impl Exponent {
    /// Records the growth of the trajectory's first tangent vector since the last call and rescales it to unit
    /// length. A zero vector, as after a superstable orbit, becomes [`FRESH_TANGENT`]. Without tangent vectors
    /// nothing happens.
    pub fn renormalise<const N: usize>(&mut self, trajectory: &mut Trajectory<'_, N>) {
        let tangents = trajectory.tangents();
        let Some(u) = tangents.first() else { return };
        let length = u.iter().map(|x| x * x).sum::<f64>().sqrt();
        self.growth.push(length.max(f64::MIN_POSITIVE).ln() + trajectory.log_scale());
        trajectory
            .set_tangents(tangents.map(|u| if length > 0.0 { u.map(|x| x / length) } else { FRESH_TANGENT }));
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
pub fn standard_error(values: &[f64]) -> f64 {
    let block = values.len() / BLOCKS;
    if block == 0 {
        return f64::INFINITY;
    }
    let means: Vec<f64> = values[values.len() - block * BLOCKS..]
        .chunks(block)
        .map(|chunk| chunk.iter().sum::<f64>() / block as f64)
        .collect();
    let centre = means.iter().sum::<f64>() / BLOCKS as f64;
    let variance = means.iter().map(|m| (m - centre).powi(2)).sum::<f64>() / (BLOCKS - 1) as f64;
    (variance / BLOCKS as f64).sqrt()
}
