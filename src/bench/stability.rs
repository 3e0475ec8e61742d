//! Numerical stress: where computations of this kind go wrong, and whether these do.
//!
//! Seven parts, each with rows for a table and a verdict that can fail: long runs
//! ([`long_runs`]), the laws of impact ([`impacts`]), the approach to grazing ([`grazing`]),
//! chatter as restitution goes to one ([`chatter`]), stiff meshing ([`stiffness`]), coarse grids
//! ([`grid`]) and random parameters ([`fuzz`]). Truth comes from closed forms where there are any,
//! else from the reference, and what an error may be from how far the reference itself moves
//! when starts and parameters move within rounding.

mod cells;
pub mod chatter;
pub mod fuzz;
pub mod grazing;
pub mod grid;
pub mod impacts;
mod lanes;
pub mod long_runs;
mod readout;
pub mod stiffness;

pub use cells::EngineName;
pub use lanes::Lanes;

use crate::gpu::GpuError;

/// How much of everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Seconds: shows that everything works.
    Quick,
    /// A minute or two on two cores: what the tests run.
    Small,
    /// What is published.
    Full,
}

impl Size {
    /// One of three values.
    fn pick<T>(self, quick: T, small: T, full: T) -> T {
        match self {
            Size::Quick => quick,
            Size::Small => small,
            Size::Full => full,
        }
    }
}

/// Whether a part holds, and the sentence that says so with its figures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// Name of the part, as in file names.
    pub part: &'static str,
    /// Whether everything that was asked of it held.
    pub holds: bool,
    /// What was found.
    pub sentence: String,
}

/// The rows of every part and what they come to.
#[derive(Clone, Debug)]
pub struct Report {
    /// Errors over many periods.
    pub long_runs: Vec<long_runs::Row>,
    /// Momentum and energy at impacts.
    pub impacts: Vec<impacts::Row>,
    /// Approach speeds near grazing.
    pub grazing: Vec<grazing::Row>,
    /// Endless series of impacts.
    pub chatter: Vec<chatter::Row>,
    /// Stiff meshing.
    pub stiffness: Vec<stiffness::Row>,
    /// Coarse grids.
    pub grid: grid::Rows,
    /// Random parameters.
    pub fuzz: fuzz::Rows,
    /// One verdict per part, in this order.
    pub verdicts: Vec<Verdict>,
}

/// Runs every part; `tell` hears of each verdict as it falls.
///
/// # Errors
/// A [`GpuError`] if a device gives up.
pub fn run(
    size: Size,
    seed: u64,
    lanes: &mut Lanes,
    tell: &mut dyn FnMut(&Verdict),
) -> Result<Report, GpuError> {
    let mut verdicts = Vec::new();
    let mut judged = |verdict: Verdict| {
        tell(&verdict);
        verdicts.push(verdict);
    };
    let long_runs = long_runs::measure(size, lanes)?;
    judged(long_runs::judge(&long_runs));
    let impacts = impacts::measure(size, seed, lanes)?;
    judged(impacts::judge(&impacts));
    let grazing = grazing::measure(size, seed, lanes)?;
    judged(grazing::judge(&grazing));
    let chatter = chatter::measure(size, lanes)?;
    judged(chatter::judge(&chatter));
    let stiffness = stiffness::measure(size, lanes)?;
    judged(stiffness::judge(&stiffness));
    let grid = grid::measure(size, seed, lanes)?;
    judged(grid::judge(&grid));
    let fuzz = fuzz::measure(size, seed, lanes)?;
    judged(fuzz::judge(&fuzz));
    Ok(Report { long_runs, impacts, grazing, chatter, stiffness, grid, fuzz, verdicts })
}
