//! How lanes average the growth of their tangent vector: in one place for those who set it and those
//! who ask what it would say of another motion.

use super::rules::{FEWEST_BLOCKS, NEUTRAL_ORDER};

/// Periods in which the tangent vector turns into the direction of fastest growth.
const ALIGNMENT: u32 = 50;

/// Blocks whose means give the exponent's standard error.
const EXPONENT_BLOCKS: u32 = 32;

/// Periods of a block at least: neighbouring periods are alike, and a standard error made of them
/// is too small.
const SHORTEST_BLOCK: u32 = 4;

/// Which periods count, and in what blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Averaging {
    /// The vector is carried from this period on,
    pub(crate) growth_from: u32,
    /// and its growth counts from this one on,
    pub(crate) exponent_from: u32,
    /// in blocks of so many periods.
    pub(crate) block: u32,
}

impl Averaging {
    /// That of lanes that run for `periods` and whose exponent accumulates from `exponent_from` on.
    pub(crate) fn new(periods: u32, exponent_from: u32) -> Averaging {
        Averaging {
            growth_from: exponent_from.saturating_sub(ALIGNMENT.min(exponent_from / 2)),
            exponent_from,
            block: (periods.saturating_sub(exponent_from) / EXPONENT_BLOCKS).max(SHORTEST_BLOCK),
        }
    }

    /// Periods without which chaos is not called early.
    pub(crate) fn fewest_periods(&self) -> u32 {
        FEWEST_BLOCKS * self.block
    }

    /// Mean growth per period and its standard error from the means of whole blocks, the first ones
    /// first (`mean_growth` in the shaders); none for fewer than two of them. `growth` holds the
    /// logarithm of every period from `exponent_from` on.
    pub(crate) fn estimate(&self, growth: &[f64]) -> Option<[f64; 2]> {
        let block = self.block as usize;
        let means: Vec<f64> =
            growth.chunks_exact(block).map(|block| block.iter().sum::<f64>() / block.len() as f64).collect();
        let count = means.len() as f64;
        let mean = means.iter().sum::<f64>() / count;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / count;
        (means.len() > 1).then(|| [mean, (variance / (count - 1.0)).sqrt()])
    }

    /// Whether growth of so much per period, over `periods` of them, is more than neutral motion has
    /// (`outgrows` in the shaders): that of a double root, the square of time, and what rounding by
    /// `unit_roundoff` at every event makes of it.
    pub(crate) fn outgrows(
        &self,
        growth: f64,
        periods: usize,
        events_per_period: f64,
        unit_roundoff: f64,
    ) -> bool {
        let counted = periods as u32 / self.block * self.block;
        let began = f64::from(self.exponent_from.max(1));
        let neutral = NEUTRAL_ORDER * ((began + f64::from(counted)) / began).ln();
        (growth - events_per_period * unit_roundoff.sqrt()) * f64::from(counted) > neutral
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_fit_the_periods() {
        let of_map = Averaging::new(528, 100);
        assert_eq!(of_map, Averaging { growth_from: 50, exponent_from: 100, block: 13 });
        let of_few = Averaging::new(64, 32);
        assert_eq!(of_few, Averaging { growth_from: 16, exponent_from: 32, block: 4 });
    }

    #[test]
    fn means_are_of_whole_blocks() {
        let averaging = Averaging::new(64, 32);
        assert_eq!(averaging.estimate(&[0.5; 32]), Some([0.5, 0.0]));
        // What goes up and down within a block is no error of the mean.
        let swings: Vec<f64> = (0..32).map(|n| if n % 2 == 0 { 3.0 } else { -2.0 }).collect();
        assert_eq!(averaging.estimate(&swings), Some([0.5, 0.0]));
        // Block means 0, 1, 2, 3; the last two periods are none.
        let mut steps: Vec<f64> = (0..16).map(|n| f64::from(n / 4)).collect();
        steps.extend([100.0; 2]);
        let [mean, error] = averaging.estimate(&steps).unwrap();
        assert!(
            (mean - 1.5).abs() < 1e-15 && (error - (1.25f64 / 3.0).sqrt()).abs() < 1e-15,
            "{mean} {error}"
        );
        assert_eq!(averaging.estimate(&[1.0; 7]), None);
    }

    #[test]
    fn powers_of_time_are_no_chaos() {
        let averaging = Averaging::new(64, 32);
        let mean = |order: f64| order * 2f64.ln() / 32.0;
        for (order, is_more) in [(1.0, false), (1.99, false), (2.01, true)] {
            assert_eq!(averaging.outgrows(mean(order), 32, 0.0, 1e-8), is_more, "{order}");
        }
        // A thousand events that round by 1e-8 may do as much.
        assert!(!averaging.outgrows(mean(2.01) + 0.099, 32, 1000.0, 1e-8));
        assert!(averaging.outgrows(mean(2.01) + 0.1, 32, 1000.0, 1e-8));
        // The last block is not complete.
        assert!(!averaging.outgrows(mean(2.01), 31, 0.0, 1e-8));
    }
}
