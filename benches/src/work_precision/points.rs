//! The table of results, with one row per method and setting. Figures show it, and other programs write such tables.

use std::path::Path;

use anyhow::Context;
use serde::{Deserialize, Serialize};

/// A point of the work-precision diagram. Times are seconds of wall time per forcing period of one lane. Errors are those of
/// [`super::outcome::Error`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Name of the method, such as `lane-f64`.
    pub method: String,
    /// The processor or adapter.
    pub device: String,
    /// `f32` or `f64`.
    pub precision: String,
    /// Requested steps per forcing period, of methods with a grid.
    pub steps: Option<u32>,
    /// Tolerance, of adaptive methods.
    pub tolerance: Option<f64>,
    /// Number of processor cores in use; `None` on a graphics card.
    pub cores: Option<u32>,
    /// Number of lanes in one run.
    pub lanes: usize,
    /// Forcing periods of each lane.
    pub periods: u32,
    /// Number of timed runs.
    pub rounds: usize,
    /// Median time of the rounds.
    pub seconds_per_lane_period: f64,
    /// Time of the fastest round.
    pub fastest: f64,
    /// Time of the slowest round.
    pub slowest: f64,
    /// Median state error over the subjects.
    pub state_error_median: f64,
    /// Largest state error.
    pub state_error_worst: f64,
    /// Median error of event times over the subjects with events.
    pub event_error_median: f64,
    /// Largest error of event times.
    pub event_error_worst: f64,
    /// Number of subjects that failed.
    pub lost: usize,
}

impl Point {
    /// Returns seconds per lane-period times the cores in use. A graphics card counts as one.
    pub fn cost(&self) -> f64 {
        self.seconds_per_lane_period * f64::from(self.cores.unwrap_or(1))
    }
}

/// Reads a table of points.
///
/// # Errors
/// If the file cannot be read or a row is not a point.
pub fn read(path: &Path) -> anyhow::Result<Vec<Point>> {
    let context = || format!("{}: this is not a table of results of work-precision", path.display());
    let mut reader = csv::Reader::from_path(path).with_context(context)?;
    reader.deserialize().collect::<Result<_, _>>().with_context(context)
}
