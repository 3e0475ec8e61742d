//! The folder of an orbit: `orbit.json`, tables, figures and manifest.

use std::io::Write;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant as Clock};

use serde_json::{Value, json};

use crate::map::scene::{FigureStyle, Format};
use crate::show::drawing::write_figure;
use crate::show::figure::orbit::{self as figure, OrbitFigure, OrbitPlot, spectrum};
use crate::show::figure::run_up as run_up_figures;
pub use crate::show::instant::Instant;
use crate::show::names;
use crate::show::orbit_json::to_json;
use crate::show::orbit_spectrum::{Spectrum, samples_per_period};
use crate::show::parameters::Parameters;
use crate::show::refined_cycle::Refined;
use crate::show::run_up::{RunUp, Series};
use crate::show::table::orbit_tables::{self, Moment};
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory;
use crate::store::manifest::{self, Head, MANIFEST, joined};
use rattlemap_dynamics::model::{Model, ModelError, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, History, Orbit, Settings, Stopped, history, trace};

const JSON: &str = "orbit.json";
const TRAJECTORY: &str = "trajectory.csv";
const EVENTS: &str = "events.csv";
const SPECTRUM: &str = "spectrum.csv";
const ORDERS: &str = "orders.csv";

/// Number of samples in the table of the motion, and smallest number of samples per forcing period.
pub const TABLED: usize = 2000;
const LEAST_TABLED: usize = 50;

/// Settings of an orbit, and the time of its computation.
#[derive(Clone, Debug)]
pub struct OrbitRequest {
    /// Initial state, at phase 0.
    pub start: State,
    /// Length of the integration.
    pub settings: Settings,
    /// Time of the computation.
    pub elapsed: Duration,
    /// State at a requested time.
    pub instant: Option<Instant>,
    /// The cycle that solves its equations, if one is requested.
    pub refined: Option<Refined>,
}

/// Files of the figures of the motion.
static FIGURES: LazyLock<Vec<(OrbitFigure, Format, String)>> = LazyLock::new(|| {
    let files =
        |figure: OrbitFigure| names::figures(figure.name()).map(|(format, name)| (figure, format, name));
    OrbitFigure::ALL.into_iter().flat_map(files).collect()
});
/// Files of the figure of the spectrum.
static SPECTRUM_FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures(spectrum::NAME));

/// Files of the figure of a motion from the start.
static HISTORY_FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures(figure::HISTORY));

/// Files of the figures of a run-up.
static RUN_UP_FIGURES: LazyLock<[(Format, String); 3]> =
    LazyLock::new(|| names::figures(run_up_figures::RUN_UP));
static CAMPBELL_FIGURES: LazyLock<[(Format, String); 3]> =
    LazyLock::new(|| names::figures(run_up_figures::CAMPBELL));

/// Names of all files that an orbit may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    let alone = [&SPECTRUM_FIGURES, &HISTORY_FIGURES, &RUN_UP_FIGURES, &CAMPBELL_FIGURES];
    let alone = alone.into_iter().flat_map(|figures| figures.iter()).map(|(_, name)| name);
    let figures = FIGURES.iter().map(|(.., name)| name).chain(alone);
    [MANIFEST, JSON, TRAJECTORY, EVENTS, SPECTRUM, ORDERS].into_iter().chain(figures.map(String::as_str))
}

/// Writes the orbit, its tables and figures unless it failed, and the manifest last. Returns the names of the files.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write(
    folder: &Folder,
    model: &dyn Model,
    orbit: &Orbit,
    request: &OrbitRequest,
    (formats, style): (&[Format], &FigureStyle),
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Clock::now();
    // The manifest does not list files of an earlier orbit.
    inventory::clear_for(folder, names())?;
    let json = to_json(model, orbit, request.instant, request.refined.as_ref());
    folder.replace(JSON, |out| Ok(writeln!(out, "{json}")?))?;
    let mut files = vec![JSON];
    if orbit.class != Class::Failed {
        let samples = samples_per_period(&model.oscillator()?);
        let trace = trace(model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, samples)?;
        let plot = OrbitPlot::new(model, orbit, &trace)?;
        for (figure, format, name) in FIGURES.iter().filter(|(_, format, _)| formats.contains(format)) {
            folder.replace(name, |out| write_figure(out, *format, &figure.draw(style, &plot)))?;
            files.push(name);
        }
        write_trajectory(folder, model, orbit)?;
        files.push(TRAJECTORY);
        if let Some(spectrum) = Spectrum::of(model, orbit)? {
            folder.replace(SPECTRUM, |out| orbit_tables::write_spectrum(out, model, &spectrum))?;
            files.push(SPECTRUM);
            let figure = spectrum::draw(style, model, orbit, &spectrum);
            for (format, name) in SPECTRUM_FIGURES.iter().filter(|(format, _)| formats.contains(format)) {
                folder.replace(name, |out| write_figure(out, *format, &figure))?;
                files.push(name);
            }
        }
    }
    let Settings { transient_periods, observed_periods, max_period } = request.settings;
    let settings = json!({
        "transient_periods": transient_periods,
        "observed_periods": observed_periods,
        "max_period": max_period,
    });
    finish(folder, model, (&request.start, settings), (request.elapsed, clock), files)
}

/// Writes the manifest, and returns the names of all files.
fn finish(
    folder: &Folder,
    model: &dyn Model,
    (start, settings): (&State, Value),
    (elapsed, clock): (Duration, Clock),
    mut files: Vec<&'static str>,
) -> Result<Vec<&'static str>, OutputError> {
    let listed = inventory::entries(folder, &files)?;
    let (elapsed, writing) = (elapsed.as_secs_f64(), clock.elapsed().as_secs_f64());
    let manifest = joined([
        json!(Head::of("orbit")),
        json!({
            "engine": "reference f64",
            "model": manifest::model(model),
            "parameters": Parameters::of(model),
            "start": start[..model.state_names().len()],
            "start_phase": model.start_phase(),
        }),
        settings,
        json!({
            "timings": { "integrate": elapsed, "write": writing },
            "files": listed,
        }),
    ]);
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST);
    Ok(files)
}

/// A motion from the start, and the forcing periods to write.
#[derive(Clone, Copy, Debug)]
pub struct HistoryRequest {
    /// Initial state, at phase 0 and time 0.
    pub start: State,
    /// Forcing periods that are integrated, but not written.
    pub skipped: u64,
    /// Forcing periods that are written.
    pub periods: u32,
    /// Least number of samples.
    pub samples: usize,
}

impl HistoryRequest {
    /// Number of the last period, from 1.
    pub fn last(&self) -> u64 {
        self.skipped + u64::from(self.periods)
    }

    /// Integrates the motion; none if `halt` was raised.
    ///
    /// # Errors
    /// [`Stopped`] if the motion cannot be followed to the end.
    pub fn compute(
        &self,
        model: &dyn Model,
        flow: &Flow,
        halt: &AtomicBool,
    ) -> Result<Option<History>, Stopped> {
        let samples = self.samples.div_ceil(self.periods.max(1) as usize);
        history(flow, model.law(), self.start, (self.skipped, self.periods), samples, halt)
    }
}

/// Writes a motion from the start: tables, figure and manifest. Returns the names of the files.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write_history(
    folder: &Folder,
    model: &dyn Model,
    history: &History,
    request: &HistoryRequest,
    elapsed: Duration,
    (formats, style): (&[Format], &FigureStyle),
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Clock::now();
    inventory::clear_for(folder, names())?;
    let moments = orbit_tables::moments(model, history)?;
    folder.replace(TRAJECTORY, |out| orbit_tables::write_trajectory(out, model, &moments))?;
    folder.replace(EVENTS, |out| orbit_tables::write_events(out, model, &history.events, &history.slips))?;
    let mut files = vec![TRAJECTORY, EVENTS];
    let plot = OrbitPlot::of_history(model, &request.start, history)?;
    let figure = figure::draw_history(style, &plot);
    for (format, name) in HISTORY_FIGURES.iter().filter(|(format, _)| formats.contains(format)) {
        folder.replace(name, |out| write_figure(out, *format, &figure))?;
        files.push(name);
    }
    let settings = json!({ "from_start": request.periods, "to_period": request.last() });
    finish(folder, model, (&request.start, settings), (elapsed, clock), files)
}

/// Writes a run-up from a start: tables, figures and manifest. Returns the names of the files.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write_run_up(
    folder: &Folder,
    model: &dyn Model,
    run: &RunUp,
    start: &State,
    elapsed: Duration,
    (formats, style): (&[Format], &FigureStyle),
) -> Result<Vec<&'static str>, OutputError> {
    let (clock, ramp) = (Clock::now(), &run.ramp);
    inventory::clear_for(folder, names())?;
    let mut series = Series::of(model)?;
    folder.replace(TRAJECTORY, |out| {
        let mut table = csv::Writer::from_writer(out);
        orbit_tables::write_trajectory_head(&mut table, model, Some(&ramp.name))?;
        for (nth, (segment, history)) in (1..).zip(&run.parts) {
            let model = ramp.model(model, segment.value)?;
            let mut moments = orbit_tables::moments(&*model, history)?;
            series.add(segment.value, history, &moments);
            // The last sample of a segment is the first one of the next segment.
            moments.pop_if(|last| nth < run.parts.len() && last.is_sample());
            orbit_tables::write_trajectory_rows(&mut table, &*model, &moments, Some(segment.value))?;
        }
        Ok(table.flush()?)
    })?;
    folder.replace(EVENTS, |out| {
        let mut table = csv::Writer::from_writer(out);
        orbit_tables::write_event_head(&mut table, model, Some(&ramp.name))?;
        for (segment, history) in &run.parts {
            let model = ramp.model(model, segment.value)?;
            let events = (&history.events[..], &history.slips[..]);
            orbit_tables::write_event_rows(&mut table, &*model, events, Some(segment.value))?;
        }
        Ok(table.flush()?)
    })?;
    let mut files = vec![TRAJECTORY, EVENTS];
    let mut figures = vec![(&RUN_UP_FIGURES, run_up_figures::draw(style, model, run, &series)?)];
    let orders = series.orders();
    if !orders.windows.is_empty() {
        folder.replace(ORDERS, |out| orbit_tables::write_orders(out, &ramp.name, &series, &orders))?;
        files.push(ORDERS);
        figures.push((&CAMPBELL_FIGURES, run_up_figures::draw_campbell(style, model, run, &series, &orders)));
    }
    for (names, figure) in &figures {
        for (format, name) in names.iter().filter(|(format, _)| formats.contains(format)) {
            folder.replace(name, |out| write_figure(out, *format, figure))?;
            files.push(name);
        }
    }
    let settings =
        json!({ "run_up": { "parameter": ramp.name, "from": ramp.from, "to": ramp.to, "time": ramp.time } });
    finish(folder, model, (start, settings), (elapsed, clock), files)
}

fn write_trajectory(folder: &Folder, model: &dyn Model, orbit: &Orbit) -> Result<(), OutputError> {
    let samples = TABLED.div_ceil(orbit.cycle_periods.max(1) as usize).max(LEAST_TABLED);
    let moments = moments(model, orbit, samples)?;
    folder.replace(TRAJECTORY, |out| orbit_tables::write_trajectory(out, model, &moments))
}

/// Samples the motion over the periods of the orbit's events, and adds every event.
///
/// # Errors
/// [`ModelError`] if the model is not valid.
pub(crate) fn moments(
    model: &dyn Model,
    orbit: &Orbit,
    samples_per_period: usize,
) -> Result<Vec<Moment>, ModelError> {
    let samples = trace(model, orbit.strobe, orbit.strobe_meshing, orbit.cycle_periods, samples_per_period)?;
    orbit_tables::moments(model, &orbit_tables::sampled(orbit, samples, samples_per_period))
}
