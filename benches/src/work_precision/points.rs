//! One row per method and setting: the table that figures are drawn from, and that programs
//! outside of this crate join by.

use std::io::Write;
use std::path::Path;

use anyhow::Context;
use rattlemap::show::error::WriteError;
use serde::{Deserialize, Serialize};

/// A point of the work-precision diagram. Times are seconds of wall time per forcing period of
/// one lane, errors those of [`super::outcome::Error`]; infinite where a lane was lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The method's name in tables, such as `lane-f64`.
    pub method: String,
    /// What it ran on.
    pub device: String,
    /// `f32` or `f64`.
    pub precision: String,
    /// Steps per forcing period that were asked for, of methods with a grid.
    pub steps: Option<u32>,
    /// Tolerance, of adaptive methods.
    pub tolerance: Option<f64>,
    /// Processor cores in use; none on a graphics card.
    pub cores: Option<u32>,
    /// Lanes of one run.
    pub lanes: usize,
    /// Forcing periods of each.
    pub periods: u32,
    /// Runs that were timed.
    pub rounds: usize,
    /// Median over the rounds.
    pub seconds_per_lane_period: f64,
    /// The fastest round.
    pub fastest: f64,
    /// The slowest round.
    pub slowest: f64,
    /// Median state error over the subjects.
    pub state_error_median: f64,
    /// Largest state error.
    pub state_error_worst: f64,
    /// Median error of event times over the subjects with events.
    pub event_error_median: f64,
    /// Largest error of event times.
    pub event_error_worst: f64,
    /// Subjects that did not come to an end.
    pub lost: usize,
}

impl Point {
    /// Seconds per lane-period, multiplied by the cores in use; of a graphics card as a whole.
    pub fn cost(&self) -> f64 {
        self.seconds_per_lane_period * f64::from(self.cores.unwrap_or(1))
    }
}

/// Reads a table of points.
///
/// # Errors
/// A file that cannot be read, or a row that is no point, by name.
pub fn read(path: &Path) -> anyhow::Result<Vec<Point>> {
    let context = || format!("{}: this is no table of points", path.display());
    let mut reader = csv::Reader::from_path(path).with_context(context)?;
    reader.deserialize().collect::<Result<_, _>>().with_context(context)
}

/// Writes a table of points.
///
/// # Errors
/// If the table cannot be written.
pub fn write(out: impl Write, points: &[Point]) -> Result<(), WriteError> {
    let mut writer = csv::Writer::from_writer(out);
    for point in points {
        writer.serialize(point)?;
    }
    Ok(writer.flush()?)
}
