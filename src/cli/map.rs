//! `rattlemap map`: computes a map or a shard of one into a folder.

mod dry_run;
mod restart;
mod summary;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rattlemap_dynamics::orbit::Class;

use crate::cli::arguments::{Map, figures};
use crate::cli::console::Console;
use crate::cli::failure::{Failure, fail_if};
use crate::cli::interrupt::Interrupt;
use crate::cli::say;
use crate::cli::stdout::print_json;
use crate::job::error::JobError;
use crate::job::map::{ComputedMap, MapJob, MapRun, OpenMap, require_engine};
use crate::job::observer::Observer;
use crate::job::scene_file::{FILES, SceneFile};
use crate::map::scene::Format;
use crate::map::sweep::SweepError;
use crate::store;
use crate::store::folder::Folder;
use crate::store::inventory::figure_formats;
use crate::store::map::LIST;
use crate::store::run_records::open_folder;
use crate::store::shard;
use restart::Restart;

/// Loads and checks the scene, computes the map, and writes its files.
pub(crate) fn run(arguments: &Map) -> Result<(), Failure> {
    let engine = arguments.engine.request();
    require_engine(arguments.shard, engine.kind)?;
    let Map { run: options, shard, resume, .. } = arguments;
    let (out, quiet) = (arguments.out(), options.quiet);
    let list_copy = resume.then(|| out.join(LIST));
    let file = SceneFile { list_copy: list_copy.as_deref(), ..SceneFile::map(&options.scene) };
    let sets = file.with_formats(
        [options.set.clone(), options.figure.sets()].concat(),
        &figures(&options.format),
        &formats_of_folder(arguments, &out),
    )?;
    let scene = file.load(&sets)?;
    let job = MapJob { scene: &scene, sets: &sets, engine, shard: *shard, resume: *resume };
    if scene.sample().is_some() {
        return super::shares::run(arguments, &job);
    }
    let free = job.check(Some(&out))?;
    let plan = job.plan()?;
    let console = Arc::new(Console::new(quiet, plan.unit(), plan.refine().is_some()));
    if arguments.dry_run {
        return dry_run::run(&job, &plan, &out, arguments, free, console);
    }
    if let Some(shard) = shard.filter(|_| *resume && job.is_finished_shard(&plan, &out)) {
        let (count, unit) = (job.run_count(&plan), plan.unit());
        console.note(&format!("{}: shard {shard} is finished: all {count} {unit} are there", out.display()));
        return Ok(());
    }
    let restart = Restart { arguments, sets: &sets, job: &job, plan: &plan };
    let interrupt = Interrupt::listen(quiet)?;
    let folder = open_folder(&out, &scene, options.force, *resume)?;
    interrupt.ends_at_once(restart.before_begin(), folder.leaver());
    let opened = job.open(&plan, Some(&folder), console.clone());
    let opened = opened.map_err(|error| restart.engine_not_opened(error, &folder))?;
    interrupt.wait_for(None);
    let OpenMap { engine, reason, .. } = &opened;
    if !reason.is_empty() {
        console.note(&format!("{} ({}): {reason}", engine.name(), engine.precision()));
    }
    let computed = compute(opened, &restart, &interrupt, &folder, &console);
    if !quiet {
        say::removed(&folder);
    }
    computed
}

/// Formats that the run writes because the folder has them. A list that the user gave with `--set` is complete.
fn formats_of_folder(arguments: &Map, out: &Path) -> Vec<Format> {
    let Map { run: options, resume, .. } = arguments;
    if *resume {
        let is_given = options.set.iter().any(|set| set.starts_with(FILES));
        return if is_given { Vec::new() } else { store::map::formats(out) };
    }
    if options.format.is_empty() { Vec::new() } else { figure_formats(out, "map") }
}

/// Computes the map or shard, and writes its files.
fn compute(
    opened: OpenMap<'_>,
    restart: &Restart<'_>,
    interrupt: &Interrupt,
    folder: &Folder,
    console: &Console,
) -> Result<(), Failure> {
    let arguments = restart.arguments;
    let mut run = opened.begin()?;
    if arguments.resume && run.done() == 0 && !run.is_damaged() {
        console.note(&format!(
            "{}: the folder has no records; the map starts from its first cell",
            folder.path().display()
        ));
    }
    integrate(&mut run, restart, interrupt, folder)?;
    let clock = Instant::now();
    interrupt.ends_at_once(restart.text(run.done()), || {});
    match arguments.shard {
        Some(_) => finish_shard(&run, folder.path(), arguments, console),
        None => finish_map(&run.finish(), clock, folder, arguments, console),
    }
}

/// Computes the remaining runs. After a signal it stores the runs that have ended, and stops; unfinished runs are lost.
fn integrate(
    run: &mut MapRun<'_>,
    restart: &Restart<'_>,
    interrupt: &Interrupt,
    folder: &Folder,
) -> Result<(), Failure> {
    let integrated = match interrupt.wait_for(Some("finished cells are stored")) {
        true => run.integrate(interrupt.raised()),
        false => Ok(false),
    };
    match integrated {
        Ok(true) => Ok(()),
        Ok(false) => Err(interrupt.failure(format!("interrupted; {}", restart.text(run.done())))),
        Err(error) => {
            let is_engine = matches!(error, SweepError::Engine(_));
            let other = if is_engine { restart.with_the_cpu() } else { String::new() };
            // Not all runs that are done have been stored.
            let stored = restart.text(Restart::stored(folder));
            Err(JobError::Failed(format!("{error}; {stored}{other}")).into())
        }
    }
}

fn finish_map(
    map: &ComputedMap<'_>,
    clock: Instant,
    folder: &Folder,
    arguments: &Map,
    console: &Console,
) -> Result<(), Failure> {
    let start = Instant::now();
    let files = map.write()?;
    let (writing, finishing) = (start.elapsed(), clock.elapsed());
    let (cells, run) = (map.cells(), map.description());
    let every = if cells.refinement().is_some() { "every integrated cell" } else { "every cell" };
    let without_effect: String = run
        .without_effect
        .iter()
        .map(|name| format!("\n{name} has no effect: along this axis {every} has the same result"))
        .collect();
    console.finish(&format!(
        "{}{without_effect}\n{}: {}",
        summary::map(&cells, &run, map.run.open.engine.lane_steps(), finishing.as_secs_f64())
            + &summary::times(&run, finishing, folder.writing_times()),
        say::path(folder.path()),
        files.join(", ")
    ));
    if arguments.json {
        print_json(&store::map_json::object(folder.path(), &files, &cells, &run, writing))?;
    }
    let all_failed = cells.classes().all(|class| class == Class::Failed);
    fail_if(all_failed, "every cell failed; the status column says why")
}

fn finish_shard(run: &MapRun<'_>, folder: &Path, arguments: &Map, console: &Console) -> Result<(), Failure> {
    let (files, description) = (run.write_shard()?, run.description());
    let Some(finished) = run.finished_shard(&description) else { return Ok(()) };
    console.finish(&summary::shard(&finished, folder, &files));
    if arguments.json {
        print_json(&shard::object(folder, &files, &finished))?;
    }
    if finished.tally.all_failed() {
        console.warn(
            "every cell of the shard failed; `rattlemap merge` fails if every cell of the other shards failed, too",
        );
    }
    Ok(())
}
