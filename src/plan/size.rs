//! How large a map is, before anything of it exists.

use crate::record::Record;
use crate::scene::{Format, Scene};

/// Bytes per cell in memory beside its record: its place in the order, and what the outputs
/// make of it.
const MEMORY_BESIDE: u64 = 64;

/// Bytes per period of one cell under way: strobe state and growth of a tangent vector.
const PER_PERIOD: u64 = 40;

/// Bytes per cell on disk of each output.
const CSV: u64 = 190;
const NPY: u64 = 132;
const HTML: u64 = 24;
/// Starts of cells that follow their neighbours, in the report.
const HTML_START: u64 = 44;

/// The size of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Number of cells.
    pub cells: u64,
    /// Number of runs: cells times starts per cell.
    pub runs: u64,
    /// Bytes of memory that a run on the CPU with one thread needs, about.
    pub memory: u64,
    /// Bytes of memory for every further thread.
    pub memory_per_thread: u64,
    /// Bytes on disk, about.
    pub disk: u64,
}

impl Size {
    /// The size of a scene's map.
    pub fn of(scene: &Scene) -> Size {
        let cells = scene.axes().iter().map(|axis| axis.count() as u64).product::<u64>();
        let runs = cells.saturating_mul(scene.draw().map_or(1, |draw| u64::from(draw.count)));
        let record = size_of::<Record>() as u64;
        let per_file = |format: &Format| match format {
            Format::Csv => CSV,
            Format::Npy => NPY,
            Format::Html if scene.start().follows() => HTML + HTML_START,
            Format::Html => HTML,
            Format::Png => 1,
        };
        let settings = scene.orbit_settings();
        let periods = u64::from(settings.transient_periods) + u64::from(settings.observed_periods);
        let one_cell = periods * PER_PERIOD;
        Size {
            cells,
            runs,
            memory: runs.saturating_mul(record + MEMORY_BESIDE) + one_cell,
            memory_per_thread: one_cell,
            disk: runs.saturating_mul(record)
                + cells * scene.outputs().files.iter().map(per_file).sum::<u64>(),
        }
    }

    /// Whether a `u32` can number the runs.
    pub fn is_countable(&self) -> bool {
        self.runs <= u64::from(u32::MAX)
    }
}
