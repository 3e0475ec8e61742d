//! Largest values that a scene may contain. The parser checks them, and the table of keys shows them.

/// Largest number of values on one axis.
pub const MAX_COUNT: u32 = 1_000_000;

/// Largest number of forcing periods in one field.
pub(crate) const MAX_PERIODS: u32 = 1_000_000_000;

/// Largest number of starts per cell: the number of attractors of a cell is stored in one byte.
pub(super) const MAX_STARTS: u32 = 255;

/// Replicates of the starts of a sample; the number of starts is a multiple of it.
pub const REPLICATES: u32 = 8;

/// Largest number of starts of a sample.
pub(super) const MOST_SAMPLED: u32 = 10_000;

/// Largest number of lines on a map: each is searched in all cells, and its name is in the legend.
pub(super) const MOST_LINES: usize = 32;

/// Largest length of a title in characters: figures have one line for it.
pub(super) const LONGEST_TITLE: usize = 200;
