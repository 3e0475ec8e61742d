//! How lanes average the growth of their tangent vector.

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
}
