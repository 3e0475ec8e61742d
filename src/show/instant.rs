//! The state of a motion at a requested time.

use rattlemap_dynamics::model::State;

/// A state and its time.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// Time since the start at phase 0.
    pub time: f64,
    /// State at that time.
    pub state: State,
}
