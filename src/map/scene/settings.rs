//! `[integration]`, `[refine]` and `[outputs]`.

use super::Purpose;
use super::document::Value;
use super::error::SceneError;
use super::keys;
use super::limits::{LONGEST_TITLE, MAX_PERIODS};
use super::section::{Field, Section};
use crate::record::limits::{LONGEST_CYCLE, MOST_STEPS};
use crate::record::measures::{self, Group, Subjects};
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit;

/// Resolution of the lanes' time grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steps {
    /// Chosen for each cell from its fastest motion.
    Auto,
    /// This number of steps per forcing period in every cell.
    PerPeriod(u32),
}

/// How long each cell is integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integration {
    /// Time grid of the lanes. The event-driven reference has none.
    pub steps_per_period: Steps,
    /// Number of forcing periods before the observation.
    pub transient_periods: u32,
    /// Number of observed forcing periods.
    pub observed_periods: u32,
    /// Whether a cell may stop as soon as its class is certain.
    pub early_stop: bool,
    /// Number of further periods for undecided cells. It needs `early_stop`.
    pub undecided_periods: u32,
    /// Number of further periods for chaotic cells, after all others.
    pub confirm_chaos: u32,
    /// Longest cycle that is searched for; at most half of the observed periods.
    pub max_period: u32,
}

impl Default for Integration {
    fn default() -> Self {
        let orbit::Settings { transient_periods, observed_periods, max_period } = Default::default();
        Integration {
            steps_per_period: Steps::Auto,
            transient_periods,
            observed_periods,
            early_stop: true,
            undecided_periods: 0,
            confirm_chaos: 0,
            max_period,
        }
    }
}

impl From<&Integration> for orbit::Settings {
    fn from(integration: &Integration) -> Self {
        orbit::Settings {
            transient_periods: integration.transient_periods,
            observed_periods: integration.observed_periods,
            max_period: integration.max_period,
        }
    }
}

/// Settings of an adaptive map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refine {
    /// Distance of the lines of the coarse grid, in cells. Cells where lines cross are always integrated.
    pub minimum_grid: u32,
    /// Largest number of times that a block is halved; none means down to single cells. A block in which the audit
    /// finds a wrong cell is halved further in any case.
    pub rounds: Option<u32>,
    /// Allowed fraction of wrong filled cells, as measured by the audit.
    pub max_error: f64,
    /// Number of filled cells that an audit integrates at first; none means [`DEFAULT_AUDIT`], or a quarter of the
    /// filled cells if that is less. If the result may be due to chance, the audit integrates up to sixteen times as
    /// many.
    pub audit: Option<u32>,
    /// Whether a change of the word alone is a border, if the scene computes words; of the pattern alone, if it
    /// computes patterns. At low frequencies words change between most neighbouring cells, while class, period and
    /// symmetry do not.
    pub word: bool,
    /// Treatment of the continuous quantities in filled cells.
    pub continuous: Continuous,
}

/// Number of filled cells that an audit integrates by default: enough to detect an error of 0.3 %.
pub const DEFAULT_AUDIT: u32 = 2000;

impl Default for Refine {
    fn default() -> Self {
        Refine {
            minimum_grid: 8,
            rounds: None,
            max_error: 0.003,
            audit: None,
            word: false,
            continuous: Continuous::Interpolated,
        }
    }
}

impl Refine {
    /// Returns how many of `filled` cells an audit integrates. By default it is at most a quarter, because an audit of
    /// all filled cells of a small map would cancel the saving.
    pub fn audited(&self, filled: usize) -> usize {
        match self.audit {
            Some(cells) => filled.min(cells as usize),
            None => filled.div_ceil(4).min(DEFAULT_AUDIT as usize),
        }
    }
}

named! {
    /// Values of continuous quantities in filled cells.
    pub enum Continuous {
        /// The bilinear average of the corners of the block.
        Interpolated = "interpolated",
        /// None.
        Empty = "empty",
    }
}

named! {
    /// Quantities of a cell.
    #[derive(PartialOrd, Ord)]
    pub enum Quantity {
        /// Periodic, chaotic, undecided or failed, and the period.
        Class = "class",
        /// Largest Lyapunov exponent.
        Lyapunov = "lyapunov",
        /// Impacts per forcing period.
        Impacts = "impacts",
        /// Fraction of the time spent meshing.
        Mesh = "mesh",
        /// Whether a periodic orbit is its own mirror image.
        Symmetric = "symmetric",
        /// Mapping word.
        Word = "word",
        /// Mapping word with each run of one symbol counted once.
        Pattern = "pattern",
        /// Mean approach speed of impacts.
        ImpactSpeed = "impact_speed",
        /// Largest approach speed of impacts.
        ImpactSpeedMax = "impact_speed_max",
        /// Energy lost in impacts per unit time.
        ImpactEnergy = "impact_energy",
        /// Impacts per unit time.
        ImpactRate = "impact_rate",
        /// Largest force of compliant contacts.
        ContactForceMax = "contact_force_max",
        /// Root mean square force of compliant contacts over the contact time.
        ContactForceRms = "contact_force_rms",
        /// Amplitude and mean of each displacement and of the gap.
        Amplitude = "amplitude",
        /// Root mean square of each displacement and of the gap.
        Rms = "rms",
        /// Amplitude and phase of the first harmonic of each displacement and of the gap.
        Harmonic = "harmonic",
        /// Energy that dampers take per unit time.
        Dissipated = "dissipated",
        /// Modulus and argument of the largest Floquet multiplier.
        Multiplier = "multiplier",
        /// Share of the time in which dry friction sticks.
        StickFraction = "stick_fraction",
        /// Energy that dry friction takes per unit time.
        FrictionEnergy = "friction_energy",
        /// Energy that walls with `pull = false` still hold when contact ends, per unit time.
        ReleaseEnergy = "release_energy",
        /// Time of a cycle without force.
        CycleTime = "cycle_time",
        /// Last state at phase 0.
        State = "state",
    }
}

named! {
    /// Kinds of output files.
    pub enum Format {
        /// Text table.
        Csv = "csv",
        /// Structured array.
        Npy = "npy",
        /// Figures as bitmaps.
        Png = "png",
        /// Figures as vector graphics; maps in them are bitmaps.
        Svg = "svg",
        /// Figures as vector graphics; maps in them are bitmaps.
        Pdf = "pdf",
        /// Interactive report.
        Html = "html",
    }
}

/// Quantities that are computed and files that are written.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs {
    /// Quantities of a map's cells; a bifurcation diagram always has its section points.
    pub quantities: Vec<Quantity>,
    /// Kinds of file.
    pub files: Vec<Format>,
}

impl Quantity {
    /// Returns the quantities that describe the size of a motion, its contacts and its energy.
    pub fn measured() -> Vec<Quantity> {
        let is_measured =
            |quantity: &Quantity| quantity.group().is_some() || *quantity == Quantity::ImpactRate;
        Quantity::ALL.into_iter().filter(is_measured).collect()
    }

    /// Returns the names of its columns for a model with these names, if it is a measured quantity or the state.
    pub fn columns(self, names: &Subjects) -> Vec<String> {
        match self {
            Quantity::ImpactRate => vec![self.name().to_owned()],
            Quantity::State => names.states.iter().map(|name| format!("state_{name}")).collect(),
            _ => {
                let measures = self.group().into_iter().flat_map(|group| group.measures());
                let each =
                    measures::of_gaps().filter(|m| !names.gaps.is_empty() && m.group.name == self.name());
                let measures = measures.chain(each);
                measures.filter(|m| m.is_of(names)).map(|m| m.name(names)).collect()
            }
        }
    }

    /// Returns its entry in the table of measured quantities; none if its values have fields of their own in records.
    pub fn group(self) -> Option<&'static Group> {
        Group::named(self.name())
    }
}

impl Format {
    /// The kinds of files that contain figures.
    pub const FIGURES: [Format; 3] = [Format::Png, Format::Svg, Format::Pdf];
}

/// Reads the heading of figures and reports.
pub(super) fn read_title(field: &Field<'_>) -> Result<String, SceneError> {
    let title = field.text()?;
    match title.chars().count() {
        0..=LONGEST_TITLE => Ok(title.to_owned()),
        count => Err(field
            .out_of_range(&format!("at most {LONGEST_TITLE} characters long; it has {count}, shorten it"))),
    }
}

pub(super) fn read_integration(root: &Section<'_>) -> Result<Integration, SceneError> {
    let section = root.section("integration", &keys::names("integration"))?;
    let periods = |name, least, default| match section.get(name) {
        Some(field) => field.whole(least..=MAX_PERIODS),
        None => Ok(default),
    };
    let default = Integration::default();
    let transient_periods = periods("transient_periods", 1, default.transient_periods)?;
    let observed_periods = match section.get("observed_periods") {
        // A cycle is recognized only after it has repeated once.
        Some(field) => field.whole(2..=MAX_PERIODS)?,
        None => default.observed_periods,
    };
    Ok(Integration {
        steps_per_period: read_steps(&section)?,
        transient_periods,
        observed_periods,
        early_stop: section.get("early_stop").map_or(Ok(default.early_stop), |field| field.flag())?,
        undecided_periods: periods("undecided_periods", 0, default.undecided_periods)?,
        confirm_chaos: periods("confirm_chaos", 0, default.confirm_chaos)?,
        max_period: read_max_period(&section, observed_periods)?,
    })
}

fn read_steps(section: &Section<'_>) -> Result<Steps, SceneError> {
    let Some(field) = section.get("steps_per_period") else { return Ok(Steps::Auto) };
    match &field.node.value {
        Value::Text(text) if text == "auto" => Ok(Steps::Auto),
        Value::Integer(_) => Ok(Steps::PerPeriod(field.whole(1..=MOST_STEPS)?)),
        _ => Err(field.wrong_type(&format!("\"auto\" or a whole number from 1 to {MOST_STEPS}"))),
    }
}

fn read_max_period(section: &Section<'_>, observed_periods: u32) -> Result<u32, SceneError> {
    let Some(field) = section.get("max_period") else {
        return Ok(Integration::default().max_period.min(observed_periods / 2));
    };
    let max_period = field.whole(1..=LONGEST_CYCLE)?;
    if max_period > observed_periods / 2 {
        return Err(field.conflict(format!(
            "a cycle must be observed twice, so `integration.observed_periods = {observed_periods}` must be at least {}",
            2 * max_period
        )));
    }
    Ok(max_period)
}

pub(super) fn read_refine(root: &Section<'_>, purpose: Purpose) -> Result<Option<Refine>, SceneError> {
    let section = root.section("refine", &keys::names("refine"))?;
    if !section.is_present() {
        return Ok(None);
    }
    if let (Purpose::Bifurcation, Some(field)) = (purpose, root.get("refine")) {
        return Err(field.conflict("`bifurcation` integrates every column; remove [refine]"));
    }
    let default = Refine::default();
    let max_error = match section.get("max_error") {
        Some(field) => {
            let value = field.number()?;
            if !(value > 0.0 && value < 1.0) {
                return Err(field.out_of_range("a fraction between 0 and 1, ends excluded"));
            }
            value
        }
        None => default.max_error,
    };
    let minimum_grid =
        section.get("minimum_grid").map_or(Ok(default.minimum_grid), |field| field.whole(1..=1024))?;
    let rounds = section.get("rounds").map(|field| field.whole(0..=32)).transpose()?;
    let audit = section.get("audit").map(|field| field.whole(1..=10_000_000)).transpose()?;
    let word = section.get("word").map_or(Ok(default.word), |field| field.flag())?;
    let continuous = match section.get("continuous") {
        Some(field) => field.choice(&Continuous::ALL.map(|continuous| (continuous.name(), continuous)))?,
        None => default.continuous,
    };
    Ok(Some(Refine { minimum_grid, rounds, max_error, audit, word, continuous }))
}

pub(super) fn read_outputs(
    root: &Section<'_>,
    purpose: Purpose,
    is_list: bool,
) -> Result<Outputs, SceneError> {
    let section = root.section("outputs", &keys::names("outputs"))?;
    let quantities = match section.get("quantities") {
        Some(field) => field.choices(&Quantity::ALL.map(|quantity| (quantity.name(), quantity)))?,
        None => vec![Quantity::Class, Quantity::Lyapunov],
    };
    // The columns of a diagram have different numbers of points, so it has no array. A list of cells has no figure.
    let (usual, figures, remedy): (_, &[Format], _) = match (purpose, is_list) {
        (Purpose::Map, true) => (
            vec![Format::Csv, Format::Npy],
            &[],
            "a list of cells has no figures; it is written as csv and npy",
        ),
        (Purpose::Map, false) => {
            (vec![Format::Csv, Format::Npy, Format::Png, Format::Html], &Format::FIGURES, "")
        }
        (Purpose::Bifurcation, _) => {
            (vec![Format::Csv, Format::Png], &Format::FIGURES, "`bifurcation` writes csv, png, svg and pdf")
        }
    };
    let Some(field) = section.get("files") else { return Ok(Outputs { quantities, files: usual }) };
    let files = field.choices(&Format::ALL.map(|format| (format.name(), format)))?;
    if let Some(i) = files.iter().position(|format| !figures.contains(format) && !usual.contains(format)) {
        let name = files[i].name();
        return Err(field.conflict(format!("{remedy}; remove \"{name}\"")));
    }
    Ok(Outputs { quantities, files })
}
