//! Maps: what `rattlemap map` computes, handed back as columns and, where asked for, written to a folder, too.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::cli;
use rattlemap::gpu::Precision;
use rattlemap::map::engine::Engine;
use rattlemap::map::engine_choice::{self, Ask, Chosen};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::Scene as Read;
use rattlemap::map::schedule::Schedule;
use rattlemap::map::{attractors, coexistence, effect, sweep};
use rattlemap::output::map::Run;
use rattlemap::output::{
    self, Cells, Folder, Identity, Order, RECORDS, RecordFile, RecordFileError, in_memory, unfinished,
};
use rattlemap::record::Record;

use crate::arrays::columns;
use crate::problem::Problem;
use crate::scene::Scene;
use crate::waiting::{self, Watch};

/// Which engine is asked for.
///
/// # Errors
/// If there is none of the name, or it does not know the precision.
pub(crate) fn ask(engine: &str, precision: Option<&str>) -> Result<Ask, Problem> {
    let named = |name: &str| {
        let known = Precision::ALL.into_iter().find(|precision| precision.name() == name);
        known.ok_or_else(|| Problem::engine(format!("the precision {name:?} is none of f32 and f64")))
    };
    let ask = Ask { engine: engine.parse()?, precision: precision.map(named).transpose()?, ..Ask::default() };
    engine_choice::check(&ask)?;
    Ok(ask)
}

/// Where a map is written, if it is.
struct Out {
    path: PathBuf,
    force: bool,
    resume: bool,
}

/// What a map came to.
struct Made {
    map: in_memory::Map,
    why: String,
    files: Vec<String>,
}

/// Computes a map.
#[pyfunction]
#[pyo3(signature = (scene, engine, precision=None, out=None, force=false, resume=false, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn map<'py>(
    py: Python<'py>,
    scene: &Scene,
    engine: &str,
    precision: Option<&str>,
    out: Option<PathBuf>,
    force: bool,
    resume: bool,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let ask = ask(engine, precision)?;
    cli::fits(&scene.scene, ask.engine, out.as_deref()).map_err(Problem::from)?;
    let out = out.map(|path| Out { path, force, resume });
    let (scene, sets) = (Arc::clone(&scene.scene), scene.sets.clone());
    let made = waiting::run(py, progress, move |watch| compute(&scene, &sets, &ask, out.as_ref(), watch))?;
    let told = PyDict::new(py);
    told.set_item("manifest", made.map.manifest)?;
    told.set_item("columns", columns(py, made.map.columns)?)?;
    told.set_item("texts", made.map.texts)?;
    told.set_item("attractors", made.map.attractors)?;
    told.set_item("why", made.why)?;
    told.set_item("files", made.files)?;
    Ok(told)
}

/// None if it was told to end before the last cell.
fn compute(
    scene: &Read,
    sets: &[String],
    ask: &Ask,
    out: Option<&Out>,
    watch: &Watch,
) -> Result<Option<Made>, Problem> {
    let plan = Plan::new(scene);
    plan.check()?;
    let folder = out.map(open_folder).transpose()?;
    let clock = Instant::now();
    let Chosen { mut engine, why, .. } = pollster::block_on(engine_choice::open(&plan, ask))?;
    let opening = clock.elapsed();
    if watch.is_halted() {
        return Ok(None);
    }
    let mut schedule = Schedule::new(&plan);
    let mut records = vec![Record::default(); plan.run_count()];
    let mut kept = match (&folder, out) {
        (Some(folder), Some(out)) => {
            Some(Kept::open(folder, out.resume, &plan, scene, &engine, &mut schedule, &mut records)?)
        }
        _ => None,
    };
    let resumed_cells = kept.as_ref().map_or(0, |kept| kept.file.count());
    let clock = Instant::now();
    let mut done = resumed_cells;
    watch.tell(done, schedule.expected());
    let keep = |batch: &[(u32, Record)], expected| {
        if let Some(kept) = &mut kept {
            kept.file.append(batch)?;
            unfinished::keep_elapsed(kept.folder, kept.elapsed_before + clock.elapsed())?;
        }
        done += batch.len();
        watch.tell(done, expected);
        Ok(())
    };
    let swept = sweep::run(&plan, &mut schedule, &mut engine, &mut records, watch.halt(), keep);
    if !pollster::block_on(swept)? {
        return Ok(None);
    }
    let elapsed = clock.elapsed();
    let refined = schedule.finish(&mut records);
    let attractors = coexistence::attractors(&plan, &records);
    let filled_from = refined.as_ref().map_or(&[][..], |refined| &refined.filled_from);
    let basins = attractors::basins(&plan, &records, filled_from);
    let cells = Cells::new(scene, &plan, &records)
        .counting(attractors.as_deref())
        .in_basins(basins.as_ref())
        .refined(refined.as_ref());
    let rounding = effect::ROUNDING[usize::from(engine.precision() == "f64")];
    let idle = effect::without_effect(&plan, &records, rounding);
    let (device, processor) = (engine.device(), cli::described_processor());
    let run = Run {
        sets,
        engine: engine.name(),
        precision: engine.precision(),
        device: &device,
        adapter: engine.adapter(),
        cards: engine.cards(),
        processor: &processor,
        opening,
        elapsed,
        elapsed_before: kept.as_ref().map_or(Duration::ZERO, |kept| kept.elapsed_before),
        resumed_cells,
        lane_grid: engine.steps_per_period(),
        refined: refined.clone(),
        merged: None,
        without_effect: idle.iter().map(|parameter| parameter.name.to_string()).collect(),
    };
    let files = match &folder {
        Some(folder) => output::map::write(folder, &cells, &run)?,
        None => Vec::new(),
    };
    Ok(Some(Made { map: in_memory::map(&cells, &run)?, why, files }))
}

fn open_folder(out: &Out) -> Result<Folder, Problem> {
    if out.resume && !out.path.join(RECORDS).is_file() && Folder::holds_results(&out.path) {
        return Err(RecordFileError::NothingToResume { folder: out.path.clone() }.into());
    }
    let folder = Folder::open(&out.path, out.force || out.resume)?;
    folder.refuse_links(output::map::names())?;
    Ok(folder)
}

/// What outlives a map that is interrupted.
struct Kept<'f> {
    folder: &'f Folder,
    file: RecordFile,
    /// How long earlier runs took.
    elapsed_before: Duration,
}

impl<'f> Kept<'f> {
    /// The record file, and what it holds already.
    fn open(
        folder: &'f Folder,
        resume: bool,
        plan: &Plan,
        scene: &Read,
        engine: &Engine<'_>,
        schedule: &mut Schedule,
        records: &mut [Record],
    ) -> Result<Kept<'f>, Problem> {
        let path = folder.path().join(RECORDS);
        let identity = Identity::new(engine.name(), engine.precision(), &engine.device(), scene.identity());
        let (file, elapsed_before) = if resume && path.is_file() {
            let order = if schedule.takes_any_order() { Order::Any } else { Order::AsKept };
            let take =
                |batch: &[(u32, Record)]| plan.admits(batch) && sweep::replay(schedule, records, batch);
            (RecordFile::resume(&path, &identity, order, take)?, unfinished::elapsed(folder))
        } else {
            (RecordFile::create(&path, &identity)?, Duration::ZERO)
        };
        if elapsed_before.is_zero() {
            unfinished::clear(folder)?;
        } else {
            unfinished::keep_elapsed(folder, elapsed_before)?;
        }
        output::map::begin(folder, scene)?;
        Ok(Kept { folder, file, elapsed_before })
    }
}
