//! `rattlemap orbit`: computes and describes one motion.

use std::cell::OnceCell;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use rattlemap_dynamics::model::{Model, ModelError, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{self, Class, LONGEST_TIME};

use super::arguments::{Orbit, figures_and_added};
use super::failure::{Failure, fail_if};
use super::interrupt::Interrupt;
use super::progress::Progress;
use super::stdout::print;
use crate::cli::say;
use crate::job::model_choice;
use crate::map::scene::{self, Format};
use crate::show::orbit_json::{history_to_json, to_json};
use crate::show::orbit_summary::{history_summary, run_up_summary, summary, timing};
use crate::show::run_up::Ramp;
use crate::store;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::orbit::OrbitRequest;

/// Time after which an analysis shows its progress.
const SILENCE: Duration = Duration::from_secs(2);

/// Computes the motion, prints it, and writes its folder if there is one.
pub(crate) fn run(arguments: &Orbit) -> Result<(), Failure> {
    let style = arguments.figure.style()?;
    let model = model_choice::find(&arguments.model)?;
    if let Some(start) = &arguments.start {
        model_choice::check_components(&model, start.count)?;
    }
    let model = scene::single_cell(&model, &arguments.set)?;
    arguments.by.as_deref().map(|name| model.index(name)).transpose().map_err(ModelError::from)?;
    if let Some(ramp) = arguments.ramp().map_err(|text| Failure::Usage(anyhow!(text)))? {
        return run_up(arguments, &*model, ramp, &style);
    }
    let flow = Flow::of(&*model)?;
    check_time(arguments.time, flow.period)?;
    let request = arguments.history().map_err(|text| Failure::Usage(anyhow!(text)))?;
    let interrupt = Interrupt::listen(true)?;
    let folder = arguments.out.as_ref().map(|dir| Folder::open(dir, arguments.force)).transpose()?;
    if let Some(folder) = &folder {
        folder.prepare(store::orbit::names())?;
    }
    let clock = Instant::now();
    let (start, settings) = (arguments.start(), arguments.settings());
    let stopped = || {
        let result = if request.is_some() { "motion was computed" } else { "class was decided" };
        interrupt.failure(format!("interrupted before the {result}; nothing was written"))
    };
    let at = |time| state_at(&*model, &flow, start, time, &interrupt)?.ok_or_else(stopped);
    let instant =
        arguments.time.map(|time| at(time).map(|state| store::orbit::Instant { time, state })).transpose()?;
    if let Some(request) = request {
        let history = request.compute(&*model, &flow, interrupt.raised());
        let stops = |stopped| Failure::Run(anyhow!("--from-start {}: {stopped}", request.periods));
        let history = history.map_err(stops)?.ok_or_else(stopped)?;
        let place = (&start, request.skipped + 1, request.last());
        print(&match arguments.json {
            true => history_to_json(&*model, &history, place, instant),
            false => broken(&history_summary(&*model, &history, place, instant)),
        })?;
        let write = |folder: &Folder, figures: Figures<'_>| {
            store::orbit::write_history(folder, &*model, &history, &request, clock.elapsed(), figures)
        };
        return finish(arguments, folder, &style, write);
    }
    let (shown, longest, halt) = (orbit::EVENT_PERIODS, arguments.longest_window(), interrupt.raised());
    let progress = OnceCell::new();
    let report = |done: u64, total: u64| {
        if clock.elapsed() > SILENCE {
            let begin =
                || Progress::of(total as usize, done as usize, timing(&*model).names()[1], false, true);
            progress.get_or_init(begin).report(done as usize, total as usize);
        }
    };
    let orbit = orbit::analyse_until(&*model, start, &settings, longest, shown, halt, &report);
    if let Some(progress) = progress.get() {
        progress.clear();
    }
    let orbit = orbit?.ok_or_else(stopped)?;
    let model = model.on_cycle(orbit.cycle_time);
    let refine = || arguments.refined().find(&*model, (&orbit, &start), interrupt.raised());
    // Without such a cycle the motion is printed all the same.
    let (refined, failure) = match arguments.refine.then(refine).transpose() {
        Ok(Some(None)) => return Err(stopped()),
        Ok(refined) => (refined.flatten(), None),
        Err(error) => (None, Some(Failure::Run(anyhow!("--refine: {error}")))),
    };
    print(&match arguments.json {
        true => to_json(&*model, &orbit, instant, refined.as_ref()),
        false => {
            let cycle = refined.as_ref().map(|refined| refined.summary(&*model)).unwrap_or_default();
            broken(&(summary(&*model, &orbit, instant) + &cycle))
        }
    })?;
    let request = OrbitRequest { start, settings, elapsed: clock.elapsed(), instant, refined };
    finish(arguments, folder, &style, |folder, figures| {
        store::orbit::write(folder, &*model, &orbit, &request, figures)
    })?;
    fail_if(orbit.class == Class::Failed, "the integration failed; `status` says why")?;
    failure.map_or(Ok(()), Err)
}

/// Computes and writes a run-up.
fn run_up(
    arguments: &Orbit,
    model: &dyn Model,
    ramp: Ramp,
    style: &scene::FigureStyle,
) -> Result<(), Failure> {
    let given = arguments.run_up.as_deref().unwrap_or_default();
    let usage = |reason: String| Failure::Usage(anyhow!("--run-up {given}: {reason}"));
    model.get(&ramp.name).map_err(|error| usage(error.to_string()))?;
    let segments = ramp.segments(model).map_err(|error| usage(error.to_string()))?;
    let interrupt = Interrupt::listen(true)?;
    let folder = arguments.out.as_ref().map(|dir| Folder::open(dir, arguments.force)).transpose()?;
    if let Some(folder) = &folder {
        folder.prepare(store::orbit::names())?;
    }
    let (clock, start) = (Instant::now(), arguments.start());
    let total: usize = segments.iter().map(|segment| segment.periods as usize).sum();
    let mut progress = None;
    let mut report = |done: u64| {
        if clock.elapsed() > SILENCE {
            let begin = || Progress::of(total, done as usize, timing(model).names()[1], false, true);
            progress.get_or_insert_with(begin).report(done as usize, total);
        }
    };
    let run = ramp.run(model, segments, start, interrupt.raised(), &mut report);
    if let Some(progress) = progress {
        progress.clear();
    }
    let run = run.map_err(|stopped| Failure::Run(anyhow!("--run-up {given}: {stopped}")))?;
    let run = run.ok_or_else(|| interrupt.failure("interrupted; nothing was written".to_owned()))?;
    print(&broken(&run_up_summary(model, &run, &start)))?;
    finish(arguments, folder, style, |folder, figures| {
        store::orbit::write_run_up(folder, model, &run, &start, clock.elapsed(), figures)
    })
}

/// Longest row of a summary, in characters.
const LONGEST_ROW: usize = 120;

/// Width of the labels of a summary, and of the first two columns of its table.
const LABELS: usize = 21;

/// Breaks the longer rows of a summary: behind columns, so that the parts of a table stay aligned, between words, or within a
/// long one.
fn broken(text: &str) -> String {
    let row = |line: &str| {
        let (mut rows, mut rest) = (String::new(), line.to_owned());
        while rest.chars().count() > LONGEST_ROW {
            let places = || rest.char_indices().take(LONGEST_ROW + 1).skip(LABELS + 1).map(|(at, _)| at);
            let ends = || places().filter(|&at| rest[at..].starts_with(' ') && !rest[..at].ends_with(' '));
            let column = ends().filter(|&at| rest[at..].starts_with("  ")).last();
            let word = || ends().filter(|&at| !rest[at..].starts_with(" [")).last();
            let Some(end) = column.or_else(word).or(places().last()) else { break };
            rows += &format!("{}\n", &rest[..end]);
            rest = format!("{:LABELS$}{}", "", &rest[end..]);
        }
        rows + &rest
    };
    text.lines().map(row).collect::<Vec<_>>().join("\n")
}

/// Formats and style of figures.
type Figures<'a> = (&'a [Format], &'a scene::FigureStyle);

/// Writes the files into the folder, if there is one, and names them.
fn finish(
    arguments: &Orbit,
    folder: Option<Folder>,
    style: &scene::FigureStyle,
    write: impl FnOnce(&Folder, Figures<'_>) -> Result<Vec<&'static str>, OutputError>,
) -> Result<(), Failure> {
    if let Some(folder) = folder {
        let formats = figures_and_added(&arguments.format, folder.path(), "orbit");
        let files = write(&folder, (&formats, style))?;
        say::notes(format_args!("{}: {}", say::path(folder.path()), files.join(", ")));
        say::removed(&folder);
    }
    Ok(())
}

/// Refuses a time that takes longer than a minute to compute.
fn check_time(time: Option<f64>, forcing_period: f64) -> Result<(), Failure> {
    let most = LONGEST_TIME * forcing_period;
    match time {
        Some(time) if time > most => Err(Failure::Usage(anyhow!(
            "--time {time:?}: it must be at most {most:.0} ({LONGEST_TIME:.0} forcing periods), which takes a minute"
        ))),
        _ => Ok(()),
    }
}

/// Returns the state at a time. None if a signal came first.
fn state_at(
    model: &dyn Model,
    flow: &Flow,
    start: State,
    time: f64,
    interrupt: &Interrupt,
) -> Result<Option<State>, Failure> {
    orbit::state_at(flow, model.law(), start, time, interrupt.raised()).map_err(|stop| {
        let status = orbit::status_of(stop).name();
        Failure::Run(anyhow!(
            "--time {time:?}: the integration stops before this time ({status}); give an earlier time"
        ))
    })
}
