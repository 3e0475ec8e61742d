//! What engines can take at most. Scenes are held to it when they are read, lanes when they begin.

/// Most free steps of a lane per forcing period: one that needs more is refused as too stiff.
pub const MOST_STEPS: u32 = 20_000;

/// Longest cycle that is searched for, in forcing periods: a lane keeps a byte per lag.
pub const LONGEST_CYCLE: u32 = 64;
