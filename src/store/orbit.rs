//! One orbit on the terminal and in its folder: `orbit.json`, tables and figures.

use std::io::Write;
use std::sync::LazyLock;
use std::time::{Duration, Instant as Clock};

use serde::Serialize;

use crate::map::scene::Format;
use crate::show::figure::orbit::{OrbitFigure, OrbitPlot, spectrum};
pub use crate::show::instant::Instant;
use crate::show::names;
use crate::show::orbit_json::to_json;
use crate::show::orbit_spectrum::{Spectrum, samples_per_period};
use crate::show::orbit_summary::summary;
use crate::show::parameters::Parameters;
use crate::show::table::orbit_tables;
pub use crate::show::table::orbit_tables::Moment;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::{Head, MANIFEST, ModelObject, TimingsObject};
use rattlemap_dynamics::model::{Model, ModelError, State};
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, trace};

const JSON: &str = "orbit.json";
const TRAJECTORY: &str = "trajectory.csv";
const SPECTRUM: &str = "spectrum.csv";

/// Samples in the table of the motion, and in a forcing period at least.
const TABLED: usize = 2000;
const LEAST_TABLED: usize = 50;

/// What makes the folder again, and what is in it.
#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    engine: &'static str,
    model: ModelObject,
    parameters: Parameters,
    start: Vec<f64>,
    transient_periods: u32,
    observed_periods: u32,
    max_period: u32,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

/// How an orbit was asked for, and how long that took.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// The state at phase 0 to start from.
    pub start: State,
    /// How long to integrate.
    pub settings: Settings,
    /// How long it took.
    pub elapsed: Duration,
    /// Where the motion is at the time that was asked for.
    pub instant: Option<Instant>,
}

/// Files of the figures of the motion.
static FIGURES: LazyLock<Vec<(OrbitFigure, Format, String)>> = LazyLock::new(|| {
    let files =
        |figure: OrbitFigure| names::figures(figure.name()).map(|(format, name)| (figure, format, name));
    OrbitFigure::ALL.into_iter().flat_map(files).collect()
});
/// Files of the figure of the spectrum.
static SPECTRUM_FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures(spectrum::NAME));

/// Every file that an orbit may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    let figures = FIGURES.iter().map(|(.., name)| name).chain(SPECTRUM_FIGURES.iter().map(|(_, name)| name));
    [MANIFEST, JSON, TRAJECTORY, SPECTRUM].into_iter().chain(figures.map(String::as_str))
}

/// Prints the orbit to stdout, as JSON or as a summary for the eye.
///
/// # Errors
/// [`OutputError`] if stdout cannot be written, unless its reader has closed it.
pub fn print(model: &dyn Model, orbit: &Orbit, asked: &Asked, json: bool) -> Result<(), OutputError> {
    let text = if json { to_json(model, orbit, asked.instant) } else { summary(model, orbit, asked.instant) };
    crate::store::stdout::print(&text)
}

/// Writes the orbit and, unless it failed, its tables, and its figures in these formats; the manifest last. Returns their
/// names.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write(
    folder: &Folder,
    model: &dyn Model,
    orbit: &Orbit,
    asked: &Asked,
    formats: &[Format],
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Clock::now();
    // Figures of an earlier orbit must not stand beside this one.
    folder.remove(&names().collect::<Vec<_>>())?;
    let json = to_json(model, orbit, asked.instant);
    folder.replace(JSON, |out| Ok(writeln!(out, "{json}")?))?;
    let mut files = vec![JSON];
    if orbit.class != Class::Failed {
        let samples = samples_per_period(&model.oscillator()?);
        let trace = trace(model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, samples)?;
        let plot = OrbitPlot::new(model, orbit, &trace)?;
        for (figure, format, name) in FIGURES.iter().filter(|(_, format, _)| formats.contains(format)) {
            folder.replace(name, |out| figure.write(out, *format, &plot))?;
            files.push(name);
        }
        write_trajectory(folder, model, orbit)?;
        files.push(TRAJECTORY);
        if let Some(spectrum) = Spectrum::of(model, orbit)? {
            folder.replace(SPECTRUM, |out| orbit_tables::write_spectrum(out, &spectrum))?;
            files.push(SPECTRUM);
            for (format, name) in SPECTRUM_FIGURES.iter().filter(|(format, _)| formats.contains(format)) {
                folder.replace(name, |out| spectrum::write(out, *format, model, orbit, &spectrum))?;
                files.push(name);
            }
        }
    }
    let listed = inventory::entries(folder, &files)?;
    let Settings { transient_periods, observed_periods, max_period } = asked.settings;
    let manifest = Manifest {
        head: Head::of("orbit"),
        engine: "reference f64",
        model: ModelObject::of(model),
        parameters: Parameters::of(model),
        start: asked.start[..model.state_names().len()].to_vec(),
        transient_periods,
        observed_periods,
        max_period,
        timings: TimingsObject {
            integrate: asked.elapsed.as_secs_f64(),
            write: clock.elapsed().as_secs_f64(),
        },
        files: &listed,
    };
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST);
    Ok(files)
}

fn write_trajectory(folder: &Folder, model: &dyn Model, orbit: &Orbit) -> Result<(), OutputError> {
    let samples = TABLED.div_ceil(orbit.cycle_periods.max(1) as usize).max(LEAST_TABLED);
    let moments = moments(model, orbit, samples)?;
    folder.replace(TRAJECTORY, |out| orbit_tables::write_trajectory(out, &model.state_names(), &moments))
}

/// An orbit's motion over the periods that its events span: so many samples in a forcing period, and every event.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub fn moments(
    model: &dyn Model,
    orbit: &Orbit,
    samples_per_period: usize,
) -> Result<Vec<Moment>, ModelError> {
    let trace = trace(model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, samples_per_period)?;
    Ok(orbit_tables::moments(&model.oscillator()?, orbit, &trace, samples_per_period))
}

/// Returns what `orbit --json` prints.
pub fn json(model: &dyn Model, orbit: &Orbit, instant: Option<Instant>) -> String {
    to_json(model, orbit, instant)
}
