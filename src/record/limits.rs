//! Limits of the engines. Scenes are checked when they are read, lanes when they start.

/// Most free steps of a lane per forcing period. A lane that needs more is refused as too stiff.
pub const MOST_STEPS: u32 = 20_000;

/// Longest cycle that engines search for, in forcing periods. A lane keeps one byte per lag.
pub const LONGEST_CYCLE: u32 = 64;
