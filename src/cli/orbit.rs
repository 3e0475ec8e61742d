//! `rattlemap orbit`: one motion, read and written down.

use std::time::Instant;

use anyhow::anyhow;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{self, Class, LONGEST_TIME};

use super::arguments::{FigureFormat, Orbit};
use super::interrupt::Interrupt;
use crate::cli::say;
use crate::cli::stdout::print;
use crate::job::error::{Failure, fail_if};
use crate::job::model_choice;
use crate::map::scene;
use crate::show::orbit_summary::summary;
use crate::store;
use crate::store::folder::Folder;
use crate::store::orbit::{Instant as At, OrbitRequest};

pub(crate) fn run(ask: &Orbit) -> Result<(), Failure> {
    let model = model_choice::find(&ask.model)?;
    if let Some(start) = &ask.start {
        model_choice::check_components(&model, start.count)?;
    }
    let model = scene::single_cell(&model, &ask.set)?;
    let flow = Flow::of(&*model)?;
    check_time(ask.time, flow.period)?;
    let interrupt = Interrupt::listen(true)?;
    let folder = ask.out.as_ref().map(|dir| Folder::open(dir, ask.force)).transpose()?;
    if let Some(folder) = &folder {
        folder.refuse_links(store::orbit::names())?;
    }
    let clock = Instant::now();
    let (start, settings) = (ask.start(), ask.settings());
    let interrupted =
        || interrupt.failure(anyhow!("interrupted before the motion was decided; nothing was written"));
    let at = |time| state_at(&*model, &flow, start, time, &interrupt)?.ok_or_else(interrupted);
    let instant = ask.time.map(|time| at(time).map(|state| At { time, state })).transpose()?;
    let (shown, halt) = (orbit::EVENT_PERIODS, interrupt.raised());
    let orbit = orbit::analyse_until(&*model, start, &settings, shown, halt)?.ok_or_else(interrupted)?;
    let asked = OrbitRequest { start, settings, elapsed: clock.elapsed(), instant };
    print(&match ask.json {
        true => store::orbit::json(&*model, &orbit, instant),
        false => summary(&*model, &orbit, instant),
    })?;
    let failed = orbit.class == Class::Failed;
    if let Some(folder) = folder {
        let files = store::orbit::write(&folder, &*model, &orbit, &asked, &FigureFormat::scene(&ask.format))?;
        say::notes(format_args!("{}: {}", say::path(folder.path()), files.join(", ")));
    }
    fail_if(failed, "the integration failed; `status` says why")
}

/// Refuses a time that a minute is not enough for.
fn check_time(time: Option<f64>, forcing_period: f64) -> Result<(), Failure> {
    let most = LONGEST_TIME * forcing_period;
    match time {
        Some(time) if time > most => Err(Failure::Usage(anyhow!(
            "--time {time:?}: it must be at most {most:.0}, {LONGEST_TIME:.0} forcing periods, which take a minute"
        ))),
        _ => Ok(()),
    }
}

/// The state at a time; none once a signal has come.
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
            "--time {time:?}: the motion cannot be followed as far ({status}); ask for an earlier time"
        ))
    })
}
