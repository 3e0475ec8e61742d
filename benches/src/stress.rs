//! Numerical stress: tests of both engines where computations of this kind tend to fail.
//!
//! Each of the eight parts writes a table and ends with a verdict that can fail: long runs ([`long_runs`]), the laws of
//! impact ([`impacts`]), the approach to grazing ([`grazing`]), chatter as restitution goes to one ([`chatter`]), stiff
//! meshing ([`stiffness`]), coarse grids ([`grid`]), the work of single cells ([`work`]) and random parameters
//! ([`fuzz`]). The correct answer is a closed form if there is one, else the reference's result. The allowed error follows
//! from how far the reference itself moves when starts and parameters move within rounding.

mod cells;
pub mod chatter;
mod figures;
pub mod fuzz;
pub mod grazing;
pub mod grid;
pub mod impacts;
mod lanes;
pub mod long_runs;
pub mod output;
mod perturbed;
mod readout;
pub mod stiffness;
pub mod work;

pub use cells::EngineName;
pub use lanes::Lanes;

use anyhow::{Context, Result};
use output::Files;

/// One of the eight parts. Each is described in its module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the modules describe the parts")]
pub enum Part {
    LongRuns,
    Impacts,
    Grazing,
    Chatter,
    Stiffness,
    Grid,
    Work,
    Fuzz,
}

impl Part {
    /// Every part in the order in which they run, with its name on the command line and in file names.
    pub const ALL: [(Part, &'static str); 8] = [
        (Part::LongRuns, "long_runs"),
        (Part::Impacts, "impacts"),
        (Part::Grazing, "grazing"),
        (Part::Chatter, "chatter"),
        (Part::Stiffness, "stiffness"),
        (Part::Grid, "grid"),
        (Part::Work, "work"),
        (Part::Fuzz, "fuzz"),
    ];
}

/// How many cells, starts and periods are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Runs for seconds and shows that everything works.
    Quick,
    /// Runs for a minute or two on two cores, in the tests.
    Small,
    /// Gives the published results.
    Full,
}

impl Size {
    /// Returns the value for this size.
    fn pick<T>(self, quick: T, small: T, full: T) -> T {
        match self {
            Size::Quick => quick,
            Size::Small => small,
            Size::Full => full,
        }
    }
}

/// Whether a part passes, and a sentence with its figures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// Whether all requirements of the part hold.
    pub holds: bool,
    /// The figures.
    pub sentence: String,
}

/// Receives the progress of a run.
pub trait Watch: Sync {
    /// Called when `done` of `total` units of some work are done, such as cells on the reference. Calls come from any
    /// thread, in any order.
    fn progress(&self, work: &'static str, done: usize, total: usize);

    /// Called when something is found that makes a part fail, long before the part ends.
    fn found(&self, what: &str);

    /// Called when a part has ended.
    fn judged(&self, part: &'static str, verdict: &Verdict);
}

/// Ignores the progress.
impl Watch for () {
    fn progress(&self, _: &'static str, _: usize, _: usize) {}

    fn found(&self, _: &str) {}

    fn judged(&self, _: &'static str, _: &Verdict) {}
}

/// Runs these parts and writes their tables and figures. Returns the verdicts.
///
/// # Errors
/// If a device fails or a file cannot be written.
pub fn run(
    parts: &[Part],
    size: Size,
    seed: u64,
    lanes: &mut Lanes,
    files: &mut Files<'_>,
    watch: &dyn Watch,
) -> Result<Vec<(&'static str, Verdict)>> {
    let mut verdicts = Vec::new();
    let device = lanes.device();
    let device = &*device;
    for (part, name) in Part::ALL.into_iter().filter(|(part, _)| parts.contains(part)) {
        let context = || format!("{name}: the device failed");
        let verdict = match part {
            Part::LongRuns => {
                let rows = long_runs::measure(size, lanes, watch).with_context(context)?;
                files.table("long_runs.csv", &rows)?;
                files.write("long_runs.png", &|out| figures::long_runs(out, device, &rows))?;
                long_runs::judge(&rows)
            }
            Part::Impacts => {
                let rows = impacts::measure(size, seed, lanes).with_context(context)?;
                files.table("impacts.csv", &rows)?;
                impacts::judge(&rows)
            }
            Part::Grazing => {
                let rows = grazing::measure(size, seed, lanes).with_context(context)?;
                files.table("grazing.csv", &rows)?;
                files.write("grazing.png", &|out| figures::grazing(out, device, &rows))?;
                grazing::judge(&rows)
            }
            Part::Chatter => {
                let rows = chatter::measure(size, lanes).with_context(context)?;
                files.table("chatter.csv", &rows)?;
                chatter::judge(&rows)
            }
            Part::Stiffness => {
                let rows = stiffness::measure(size, lanes).with_context(context)?;
                files.table("stiffness.csv", &rows)?;
                files.write("stiffness.png", &|out| figures::stiffness(out, device, &rows))?;
                stiffness::judge(&rows)
            }
            Part::Grid => {
                let rows = grid::measure(size, seed, lanes, watch).with_context(context)?;
                files.table("grid_swings.csv", &rows.swings)?;
                files.table("grid_motions.csv", &rows.motions)?;
                files.write("grid.png", &|out| figures::grid(out, device, &rows.swings))?;
                grid::judge(&rows)
            }
            Part::Work => {
                let rows = work::measure_cells(size, seed, watch);
                files.table("work.csv", &rows)?;
                work::judge(&rows)
            }
            Part::Fuzz => {
                let rows = fuzz::measure(size, seed, lanes, watch).with_context(context)?;
                files.table("fuzz.csv", &rows.counts)?;
                files.write("fuzz_mismatches.csv", &|out| output::mismatches(out, &rows.mismatches))?;
                fuzz::judge(&rows)
            }
        };
        watch.judged(name, &verdict);
        verdicts.push((name, verdict));
    }
    Ok(verdicts)
}
