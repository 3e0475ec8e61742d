//! `rattlemap map`: a scene into a folder, resumable at every batch.

use std::ops::ControlFlow;
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, anyhow};
use rattlemap::coexistence;
use rattlemap::engine::Engine;
use rattlemap::gpu::Precision;
use rattlemap::orbit::Class;
use rattlemap::output::{self, Cells, Folder, Identity, RECORDS, RecordFile, RecordFileError};
use rattlemap::plan::{Plan, count_classes};
use rattlemap::record::Record;
use rattlemap::scene::{Purpose, Scene};
use rattlemap::schedule::{Refined, Schedule};
use rattlemap::sweep::{self, SweepError};

use crate::capacity;
use crate::cli::{EngineChoice, EngineOptions, Map};
use crate::engine_choice::{self, Chosen};
use crate::error::{Failure, fail_if};
use crate::progress::Progress;
use crate::{say, scene_file};

/// Exit code after a second Ctrl-C, as shells count it.
const KILLED: i32 = 130;

/// Asks, checks, computes, writes.
pub(crate) fn run(ask: &Map) -> Result<(), Failure> {
    let scene = scene_file::load(&ask.run.scene, &ask.run.set, Purpose::Map)?;
    engine_choice::check(&ask.engine)?;
    capacity::check(&scene, ask.engine.engine, &ask.run.out())?;
    let folder = open_folder(ask)?;
    let plan = Plan::new(&scene);
    let Chosen { mut engine, why } = engine_choice::open(&plan, &engine_of(ask, &folder))?;
    if !ask.run.quiet && !why.is_empty() {
        say::note(format_args!("{} ({}): {why}", engine.name(), engine.precision()));
    }
    let mut work = Work::new(&plan);
    let mut file = open_records(ask, &folder, &scene, &mut work, &engine)?;
    let resumed_cells = file.count();
    let clock = Instant::now();
    let unit = unit(&plan);
    let progress = Progress::new(work.schedule.expected(), resumed_cells, unit, ask.run.quiet);
    integrate(ask, &mut work, &mut engine, &mut file, &progress)?;
    let Work { schedule, mut records, .. } = work;
    let refined = schedule.finish(&mut records);
    let elapsed = clock.elapsed();
    let attractors = coexistence::attractors(&plan, &records);
    let cells = Cells::new(&scene, &plan, &records).counting(attractors.as_deref()).refined(refined.as_ref());
    let (device, lane_steps) = (engine.device(), engine.lane_steps());
    let (engine, precision) = (engine.name(), engine.precision());
    let run = output::map::Run {
        sets: &ask.run.set,
        engine,
        precision,
        device: &device,
        elapsed,
        resumed_cells,
        refined: refined.clone(),
    };
    let files = output::map::write(&folder, &cells, &run)?;
    progress.finish(&format!(
        "{}\n{}: {}",
        summary(&cells, &run, lane_steps, clock.elapsed().as_secs_f64()),
        folder.path().display(),
        files.join(", ")
    ));
    let all_failed = cells.classes().all(|class| class == Class::Failed);
    fail_if(all_failed, "every cell failed; the status column says why")
}

/// A new folder, an earlier run's with `--force`, an interrupted one's with `--resume`.
fn open_folder(ask: &Map) -> Result<Folder, Failure> {
    let out = ask.run.out();
    let is_new = out.read_dir().map_or(true, |mut entries| entries.next().is_none());
    if ask.resume && !is_new && !out.join(RECORDS).is_file() {
        return Err(RecordFileError::NothingToResume { folder: out }.into());
    }
    Ok(Folder::open(&out, ask.run.force || ask.resume)?)
}

/// The engine that was asked for; where that is left open, an interrupted run goes on with
/// its own.
fn engine_of(ask: &Map, folder: &Folder) -> EngineOptions {
    let asked = ask.engine;
    if !ask.resume || asked.engine != EngineChoice::Auto || asked.precision.is_some() {
        return asked;
    }
    match Identity::read(&folder.path().join(RECORDS)) {
        Ok(identity) if identity.engine() == "cpu" => EngineOptions { engine: EngineChoice::Cpu, ..asked },
        Ok(identity) => {
            let precision = Precision::ALL.into_iter().find(|p| p.name() == identity.precision());
            EngineOptions { engine: EngineChoice::Gpu, precision }
        }
        // What is wrong with the file is said when it is resumed.
        Err(_) => asked,
    }
}

/// The record file, and what it holds already, by run.
fn open_records(
    ask: &Map,
    folder: &Folder,
    scene: &Scene,
    work: &mut Work<'_>,
    engine: &Engine<'_>,
) -> Result<RecordFile, Failure> {
    let path = folder.path().join(RECORDS);
    let identity = Identity::new(engine.name(), engine.precision(), &engine.device(), scene.identity());
    let file = if ask.resume && path.is_file() {
        let Work { schedule, records, .. } = work;
        RecordFile::resume(&path, &identity, |batch| sweep::replay(schedule, records, batch))?
    } else {
        RecordFile::create(&path, &identity)?
    };
    output::map::clear(folder)?;
    Ok(file)
}

/// What is to be done, and what has been.
struct Work<'p> {
    plan: &'p Plan,
    schedule: Schedule,
    /// By run.
    records: Vec<Record>,
}

impl<'p> Work<'p> {
    fn new(plan: &'p Plan) -> Work<'p> {
        Work { plan, schedule: Schedule::new(plan), records: vec![Record::default(); plan.run_count()] }
    }
}

/// Integrates what is left. Ctrl-C ends it once some cells have ended; those under way are computed again.
fn integrate(
    ask: &Map,
    work: &mut Work<'_>,
    engine: &mut Engine<'_>,
    file: &mut RecordFile,
    progress: &Progress,
) -> Result<(), Failure> {
    let stop = stop_on_interrupt(ask.run.quiet)?;
    let Work { plan, schedule, records } = work;
    let swept = pollster::block_on(sweep::run(plan, schedule, engine, records, |batch, known| {
        file.append(batch)?;
        progress.report(file.count(), known);
        let stopped = stop.load(Ordering::Relaxed);
        Ok(if stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }));
    let go_on = || {
        let (done, total, unit) = (file.count(), plan.run_count(), unit(plan));
        let most = if plan.refine().is_some() { "at most " } else { "" };
        format!("{done} of {most}{total} {unit} are kept; go on with: {}", ask.resume_command())
    };
    match swept {
        Ok(true) => Ok(()),
        Ok(false) => Err(Failure::Run(anyhow!("interrupted; {}", go_on()))),
        Err(error @ SweepError::Engine(_)) => Err(Failure::Run(anyhow!("{error}; {}", go_on()))),
        Err(error) => Err(Failure::Run(anyhow!("{error}; make room there; {}", go_on()))),
    }
}

/// A flag that the first Ctrl-C raises; the second one ends the process at once, which the
/// record file survives, too.
fn stop_on_interrupt(quiet: bool) -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            process::exit(KILLED);
        }
        if !quiet {
            say::note("stopping as soon as some cells have ended; Ctrl-C again ends at once");
        }
    })
    .context("cannot listen for Ctrl-C")?;
    Ok(stop)
}

/// What is counted while a map is made.
pub(crate) fn unit(plan: &Plan) -> &'static str {
    if plan.start_count() > 1 { "runs" } else { "cells" }
}

/// What was done, how fast, and what came out.
fn summary(cells: &Cells<'_>, run: &output::map::Run<'_>, lane_steps: Option<u64>, seconds: f64) -> String {
    let (count, [columns, rows]) = (cells.runs(), cells.counts());
    let unit = if count > columns * rows { "runs" } else { "cells" };
    let integrated = run.refined.as_ref().map_or(count, |refined| refined.integrated);
    let integrating = run.elapsed.as_secs_f64().max(1e-9);
    let here = (integrated - run.resumed_cells) as f64;
    let periods = cells.periods() as f64 * here / integrated as f64;
    let [periodic, chaotic, undecided, failed] = count_classes(cells.classes());
    let resumed = match run.resumed_cells {
        0 => String::new(),
        cells => format!(", {cells} of them before"),
    };
    let per_step = lane_steps.filter(|&steps| steps > 0).map_or(String::new(), |steps| {
        format!(", {} ns per lane-step", rounded(1e9 * integrating / steps as f64))
    });
    let refined = run.refined.as_ref().map_or(String::new(), |refined| refinement(refined, count));
    format!(
        "{integrated} {unit}{resumed} on {} ({}) in {integrating:.3} s: {:.0} {unit}/s, {:.0} lane-periods/s\
         {per_step}; outputs {:.3} s\n{refined}\
         {periodic} periodic, {chaotic} chaotic, {undecided} undecided, {failed} failed",
        run.engine,
        run.precision,
        here / integrating,
        periods / integrating,
        seconds - integrating,
    )
}

/// Three significant digits.
fn rounded(x: f64) -> String {
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{x:.digits$}")
}

/// How much an adaptive map left out, and what the audit says of it.
fn refinement(refined: &Refined, count: usize) -> String {
    let share = 100.0 * refined.integrated as f64 / count as f64;
    let audit = refined.audits.last().map_or(String::new(), |audit| {
        let [low, high] = audit.interval().map(|rate| 100.0 * rate);
        let (wrong, sampled, rate) = (audit.wrong, audit.sampled, 100.0 * audit.rate());
        let words = match (audit.wrong_words, audit.words) {
            (_, 0) => String::new(),
            (wrong, words) => format!(", and {wrong} of {words} filled words"),
        };
        let failed = if audit.rate() > refined.max_error {
            let allowed = 100.0 * refined.max_error;
            format!(", more than the {allowed:.2} % of refine.max_error, but refine.rounds lets no block be halved again")
        } else {
            String::new()
        };
        format!(
            "; audit: {wrong} of {sampled} filled cells wrong, {rate:.2} % (95 %: {low:.2} to {high:.2} %){words}{failed}"
        )
    });
    format!("{share:.1} % of {count} cells integrated, the others filled{audit}\n")
}
