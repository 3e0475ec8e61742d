//! `rattlemap map`: a scene into a folder, resumable at every batch.

mod dry_run;
mod resume_command;
mod shard;
mod stopped;
mod summary;

use std::path::Path;
use std::time::Instant;

use crate::findings::effect;
use crate::job::engine_choice::{self, Ask, Chosen};
use crate::job::resumed_engine;
use crate::map::engine::{Engine, Loss};
use crate::map::plan::Plan;
use crate::map::scene::{Scene, Steps};
use crate::map::sweep::{self, SweepError};
use crate::record::Record;
use crate::record::classify::status;
use crate::show::cells::{Cells, Survey};
use crate::store;
use crate::store::folder::Folder;
use crate::store::map::{LIST, Provenance, Run};
use crate::store::run_records::{RunRecords, Work, open_folder};
use anyhow::anyhow;
use rattlemap_dynamics::orbit::{Class, Status};

use crate::cli::arguments::Map;
use crate::cli::interrupt::Interrupt;
use crate::cli::progress::Progress;
use crate::cli::say;
use crate::cli::stdout::print_json;
use crate::job::capacity;
use crate::job::error::{Failure, fail_if};
use crate::job::{processor, scene_file};
pub use shard::open_engine;
use summary::summary;

/// Asks, checks, computes, writes.
pub(crate) fn run(ask: &Map) -> Result<(), Failure> {
    shard::require_engine(ask)?;
    let kept = ask.resume.then(|| ask.out().join(LIST));
    let run = scene_file::map_with_figures(&ask.run, kept.as_deref())?;
    let ask = &Map { run, ..ask.clone() };
    let scene = scene_file::load(&ask.run.scene, &ask.run.set, kept.as_deref())?;
    engine_choice::check(&ask.engine.ask())?;
    let free = capacity::check(&scene, ask.shard, ask.engine.engine, &ask.out())?;
    let plan = Plan::new(&scene);
    if let Some(shard) = ask.shard {
        shard.check(&plan).map_err(|error| Failure::Usage(anyhow!("--shard {error}")))?;
    }
    plan.check()?;
    if ask.dry_run {
        return dry_run::run(ask, &scene, &plan, free);
    }
    if shard::is_done(ask, &scene, &plan) {
        return shard::say_done(ask, &plan);
    }
    let interrupt = Interrupt::listen(ask.run.quiet)?;
    let folder = open_folder(&ask.out(), ask.run.force, ask.resume)?;
    interrupt.ends_at_once(stopped::before_anything(ask, &plan), folder.leaver());
    let clock = Instant::now();
    let asked = engine_of(ask, folder.path());
    let Chosen { mut engine, why, notes, warnings } = pollster::block_on(engine_choice::open(&plan, &asked))
        .map_err(|error| stopped::before_it_began(error.into(), ask, &folder, &plan))?;
    let opening = clock.elapsed();
    interrupt.wait_for(None);
    if !ask.run.quiet && !why.is_empty() {
        say::note(format_args!("{} ({}): {why}", engine.name(), engine.precision()));
    }
    if !ask.run.quiet {
        notes.iter().for_each(say::note);
    }
    warnings.iter().for_each(say::note);
    engine.listen(|loss| {
        let Loss { adapter, cells, reason } = loss;
        say::note(format_args!(
            "warning: adapter {adapter} was lost ({reason}); {cells} cells go back to the queue"
        ));
    });
    let lane_grid = engine.steps_per_period();
    if let (false, Some(raised)) = (ask.run.quiet, raised_steps(&scene, lane_grid)) {
        say::note(raised);
    }
    let mut work = Work::new(&plan, ask.shard);
    let mut kept = open_records(ask, &folder, &scene, &mut work, &engine)?;
    let resumed_cells = kept.resumed();
    let total = work.schedule.expected();
    let progress = match plan.refine() {
        Some(_) => Progress::of_at_least(total, resumed_cells, plan.unit(), ask.run.quiet),
        None => Progress::new(total, resumed_cells, plan.unit(), ask.run.quiet),
    };
    integrate(ask, &mut work, &mut engine, &mut kept, &progress, &interrupt)?;
    interrupt.ends_at_once(stopped::go_on(ask, &plan, kept.count()), || {});
    if let Some(shard) = ask.shard {
        let ended = shard::Ended { shard, opening, kept: &kept, tally: &work.tally };
        return shard::finish(ask, &scene, &plan, &engine, &ended, &progress);
    }
    let Work { schedule, mut records, .. } = work;
    let refined = schedule.finish(&mut records);
    let elapsed = kept.elapsed();
    let survey = Survey::of(&plan, &records, refined);
    let cells = Cells::new(&scene, &plan, &records).surveyed(&survey);
    let (device, processor, lane_steps) = (engine.device(), processor::described(), engine.lane_steps());
    let made = Provenance { engine: engine.name(), precision: engine.precision(), device: &device };
    let run = Run {
        opening,
        elapsed,
        elapsed_before: kept.elapsed_before(),
        resumed_cells,
        without_effect: effect::names(&plan, &records, made.precision),
        ..Run::new(made, &ask.run.set, &processor).on(&engine)
    };
    let written = Instant::now();
    let files = store::map::write(&folder, &cells, &run)?;
    let writing = written.elapsed();
    let every = if plan.refine().is_some() { "every cell that was integrated" } else { "every cell" };
    let idle = run.without_effect.iter().map(|name| {
        format!("\n{name} changed nothing that was measured: along it {every} is like the others")
    });
    let idle: String = idle.collect();
    progress.finish(&format!(
        "{}{idle}\n{}: {}",
        summary(&cells, &run, lane_steps, kept.elapsed().as_secs_f64()),
        say::path(folder.path()),
        files.join(", ")
    ));
    if ask.json {
        print_json(&store::map_json::object(folder.path(), &files, &cells, &run, writing))?;
    }
    let all_failed = cells.classes().all(|class| class == Class::Failed);
    fail_if(all_failed, "every cell failed; the status column says why")
}

/// The engine that was asked for; where that is left open, an interrupted run goes on with its own.
fn engine_of(ask: &Map, folder: &Path) -> Ask {
    let asked = ask.engine.ask();
    if ask.resume { resumed_engine::engine_of(asked, folder) } else { asked }
}

/// The record file, and what it holds already, by run.
fn open_records<'f>(
    ask: &Map,
    folder: &'f Folder,
    scene: &Scene,
    work: &mut Work<'_>,
    engine: &Engine<'_>,
) -> Result<RunRecords<'f>, Failure> {
    let kept = RunRecords::open(folder, scene, engine, ask.resume, work)?;
    if let Some(damage) = kept.damage() {
        say::note(format_args!("warning: {damage}"));
    } else if ask.resume && kept.count() == 0 && !ask.run.quiet {
        say::note(format_args!(
            "{}: nothing was kept there yet; the map is begun anew",
            folder.path().display()
        ));
    }
    Ok(kept)
}

/// Integrates what is left. Ctrl-C ends it once some cells have ended; those under way are computed again.
fn integrate(
    ask: &Map,
    work: &mut Work<'_>,
    engine: &mut Engine<'_>,
    kept: &mut RunRecords<'_>,
    progress: &Progress,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let Work { plan, schedule, records, tally, .. } = work;
    let mut warning = Warning::new(kept.count(), ask.run.quiet);
    let keep = |batch: &[(u32, Record)], known| {
        kept.store(batch)?;
        tally.take(plan, batch);
        warning.heed(batch, plan.unit());
        progress.report(kept.count(), known);
        Ok(())
    };
    let swept = match interrupt.wait_for(Some("what has ended is kept")) {
        true => pollster::block_on(sweep::run(plan, schedule, engine, records, interrupt.raised(), keep)),
        false => Ok(false),
    };
    let go_on = || stopped::go_on(ask, plan, kept.count());
    match swept {
        Ok(true) => Ok(()),
        Ok(false) => Err(interrupt.failure(anyhow!("interrupted; {}", go_on()))),
        Err(error @ SweepError::Engine(_)) => {
            Err(Failure::Run(anyhow!("{error}; {}{}", go_on(), stopped::on_the_processor(ask))))
        }
        Err(error) => Err(Failure::Run(anyhow!("{error}; make room there; {}", go_on()))),
    }
}

/// Says once that a map whose first cells all failed will go on like that.
struct Warning {
    is_due: bool,
}

impl Warning {
    fn new(kept: usize, quiet: bool) -> Warning {
        Warning { is_due: kept == 0 && !quiet }
    }

    fn heed(&mut self, batch: &[(u32, Record)], unit: &str) {
        if !std::mem::take(&mut self.is_due) || !batch.iter().all(|(_, record)| status(record).is_failure()) {
            return;
        }
        let count = |of: Status| batch.iter().filter(|(_, record)| status(record) == of).count();
        let counts = Status::ALL.iter().filter(|of| count(**of) > 0);
        let list: Vec<String> = counts.map(|&of| format!("{} {}", count(of), of.name())).collect();
        say::note(format_args!(
            "warning: all of the first {} {unit} failed ({}); the rest may well do so, too: Ctrl-C ends the run",
            batch.len(),
            list.join(", ")
        ));
    }
}

/// What is to be said where lanes take more steps than the scene asks for.
fn raised_steps(scene: &Scene, lane_grid: Option<[u32; 2]>) -> Option<String> {
    let Steps::PerPeriod(asked) = scene.integration().steps_per_period else { return None };
    let [least, most] = lane_grid.filter(|&[_, most]| most > asked)?;
    let taken = if least == most { most.to_string() } else { format!("{least} to {most}") };
    Some(format!(
        "integration.steps_per_period = {asked} is raised to {taken}: lanes need as many, and an even number"
    ))
}
