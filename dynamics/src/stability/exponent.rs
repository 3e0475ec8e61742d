//! The largest Lyapunov exponent as an average, with its standard error.

use crate::model::State;
use crate::reference::Trajectory;

/// Blocks whose means give the standard error.
const BLOCKS: usize = 16;

/// Periods below which an average has no standard error: it is infinite.
pub const LEAST_FOR_ERROR: u32 = BLOCKS as u32;

/// A fresh tangent vector: no direction that a gear pair keeps to itself. All entries alike would
/// be a common translation, which without supports never meets a wall.
pub const FRESH_TANGENT: State = [0.64, -0.36, 0.28, 0.61];

/// Collects the growth of one tangent vector, period by period.
#[derive(Clone, Debug, Default)]
pub struct Exponent {
    growth: Vec<f64>,
}

impl Exponent {
    /// Takes the growth of a trajectory's first tangent vector since the last call and gives
    /// it unit length again; a null vector, which a superstable orbit leaves, starts anew. A
    /// trajectory without one is left alone.
    pub fn renormalise<const N: usize>(&mut self, trajectory: &mut Trajectory<'_, N>) {
        let tangents = trajectory.tangents();
        let Some(u) = tangents.first() else { return };
        let length = u.iter().map(|x| x * x).sum::<f64>().sqrt();
        self.growth.push(length.max(f64::MIN_POSITIVE).ln() + trajectory.log_scale());
        trajectory
            .set_tangents(tangents.map(|u| if length > 0.0 { u.map(|x| x / length) } else { FRESH_TANGENT }));
    }

    /// Growth over the last `periods`, as a logarithm; none before there are as many.
    pub(crate) fn lately(&self, periods: usize) -> Option<f64> {
        let from = self.growth.len().checked_sub(periods)?;
        Some(self.growth[from..].iter().sum())
    }

    /// Periods whose growth has been collected.
    pub(crate) fn periods(&self) -> usize {
        self.growth.len()
    }

    /// Forgets what was collected: the vector needs a while to turn to its direction.
    pub fn forget(&mut self) {
        self.growth.clear();
    }

    /// Mean growth rate per unit time and its standard error, from the means of
    /// 16 blocks; the error is infinite for fewer than 16 periods.
    pub fn estimate(&self, forcing_period: f64) -> (f64, f64) {
        let n = self.growth.len();
        if n == 0 {
            return (f64::NAN, f64::INFINITY);
        }
        let mean = self.growth.iter().sum::<f64>() / n as f64;
        (mean / forcing_period, standard_error(&self.growth) / forcing_period)
    }
}

/// The standard error of the mean of consecutive values, from the means of 16 blocks, of the last ones if their number is
/// no multiple of that; infinite for fewer than 16 values.
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
