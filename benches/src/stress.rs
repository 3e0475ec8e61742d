//! Numerical stress: where computations of this kind go wrong, and whether these do.
//!
//! Eight parts, each with rows for a table and a verdict that can fail: long runs
//! ([`long_runs`]), the laws of impact ([`impacts`]), the approach to grazing ([`grazing`]),
//! chatter as restitution goes to one ([`chatter`]), stiff meshing ([`stiffness`]), coarse grids
//! ([`grid`]), the work of single cells ([`work`]) and random parameters ([`fuzz`]). Truth comes from closed forms where there are any,
//! else from the reference, and what an error may be from how far the reference itself moves
//! when starts and parameters move within rounding.

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

use rattlemap::gpu::GpuError;

/// One of the eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// [`long_runs`].
    LongRuns,
    /// [`impacts`].
    Impacts,
    /// [`grazing`].
    Grazing,
    /// [`chatter`].
    Chatter,
    /// [`stiffness`].
    Stiffness,
    /// [`grid`].
    Grid,
    /// [`work`].
    Work,
    /// [`fuzz`].
    Fuzz,
}

impl Part {
    /// Every part, in the order in which they run.
    pub const ALL: [Part; 8] = [
        Part::LongRuns,
        Part::Impacts,
        Part::Grazing,
        Part::Chatter,
        Part::Stiffness,
        Part::Grid,
        Part::Work,
        Part::Fuzz,
    ];

    /// Its name on the command line and in file names.
    pub fn name(self) -> &'static str {
        match self {
            Part::LongRuns => "long_runs",
            Part::Impacts => "impacts",
            Part::Grazing => "grazing",
            Part::Chatter => "chatter",
            Part::Stiffness => "stiffness",
            Part::Grid => "grid",
            Part::Work => "work",
            Part::Fuzz => "fuzz",
        }
    }
}

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

/// The rows of the parts that ran and what they come to.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Errors over many periods.
    pub long_runs: Option<Vec<long_runs::Row>>,
    /// Momentum and energy at impacts.
    pub impacts: Option<Vec<impacts::Row>>,
    /// Approach speeds near grazing.
    pub grazing: Option<Vec<grazing::Row>>,
    /// Endless series of impacts.
    pub chatter: Option<Vec<chatter::Row>>,
    /// Stiff meshing.
    pub stiffness: Option<Vec<stiffness::Row>>,
    /// Coarse grids.
    pub grid: Option<grid::Rows>,
    /// Times of random cells.
    pub work: Option<Vec<work::Row>>,
    /// Random parameters.
    pub fuzz: Option<fuzz::Rows>,
    /// One verdict per part that ran, in this order.
    pub verdicts: Vec<Verdict>,
}

/// Who hears how a run goes.
pub trait Watch: Sync {
    /// Of some work, such as cells on the reference, `done` of `total` units are done; from any
    /// thread, in any order.
    fn progress(&self, work: &'static str, done: usize, total: usize);

    /// Something was found that makes a part fail, long before its end.
    fn found(&self, what: &str);

    /// A part has ended.
    fn judged(&self, verdict: &Verdict);
}

/// Nobody.
impl Watch for () {
    fn progress(&self, _: &'static str, _: usize, _: usize) {}

    fn found(&self, _: &str) {}

    fn judged(&self, _: &Verdict) {}
}

/// Runs the parts in `asked`.
///
/// # Errors
/// A [`GpuError`] if a device gives up.
pub fn run(
    asked: &[Part],
    size: Size,
    seed: u64,
    lanes: &mut Lanes,
    watch: &dyn Watch,
) -> Result<Report, GpuError> {
    let mut report = Report::default();
    for part in Part::ALL.into_iter().filter(|part| asked.contains(part)) {
        let verdict = match part {
            Part::LongRuns => {
                let rows = report.long_runs.insert(long_runs::measure(size, lanes, watch)?);
                long_runs::judge(rows)
            }
            Part::Impacts => impacts::judge(report.impacts.insert(impacts::measure(size, seed, lanes)?)),
            Part::Grazing => grazing::judge(report.grazing.insert(grazing::measure(size, seed, lanes)?)),
            Part::Chatter => chatter::judge(report.chatter.insert(chatter::measure(size, lanes)?)),
            Part::Stiffness => stiffness::judge(report.stiffness.insert(stiffness::measure(size, lanes)?)),
            Part::Grid => grid::judge(report.grid.insert(grid::measure(size, seed, lanes, watch)?)),
            Part::Work => work::judge(report.work.insert(work::measure_cells(size, seed, watch))),
            Part::Fuzz => fuzz::judge(report.fuzz.insert(fuzz::measure(size, seed, lanes, watch)?)),
        };
        watch.judged(&verdict);
        report.verdicts.push(verdict);
    }
    Ok(report)
}
