//! Periods over which lanes average the growth of their tangent vector.

/// Number of periods in which the tangent vector turns into the direction of fastest growth.
const ALIGNMENT: u32 = 50;

/// Number of blocks whose means give the exponent's standard error.
const EXPONENT_BLOCKS: u32 = 32;

/// Least number of periods of a block. Lanes measure the correlation of neighbouring blocks, and shorter blocks would be more correlated.
const SHORTEST_BLOCK: u32 = 2;

/// The periods over which growth is averaged, and their division into blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Averaging {
    /// Period from which the tangent vector is carried.
    pub(crate) growth_from: u32,
    /// Period from which its growth counts.
    pub(crate) exponent_from: u32,
    /// Periods per block.
    pub(crate) block: u32,
}

impl Averaging {
    /// Returns the averaging of lanes that run for `periods`, with an exponent from `exponent_from` on.
    pub(crate) fn new(periods: u32, exponent_from: u32) -> Averaging {
        Averaging {
            growth_from: exponent_from.saturating_sub(ALIGNMENT.min(exponent_from / 2)),
            exponent_from,
            block: (periods.saturating_sub(exponent_from) / EXPONENT_BLOCKS).max(SHORTEST_BLOCK),
        }
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
        assert_eq!(of_few, Averaging { growth_from: 16, exponent_from: 32, block: 2 });
    }
}
