//! `map --shard`: what is other where a part of a map is made.

use std::path::Path;
use std::time::Duration;

use anyhow::anyhow;

use super::summary;
use crate::cli::arguments::{EngineChoice, Map};
use crate::cli::progress::Progress;
use crate::cli::say;
use crate::cli::stdout::print_json;
use crate::gpu::Precision;
use crate::job::error::Failure;
use crate::job::processor;
use crate::map::engine::Engine;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::store::finished_map::FinishedMap;
use crate::store::inventory::{self, Finding};
use crate::store::map::{Provenance, Run};
use crate::store::record_file::{Identity, RECORDS};
use crate::store::run_records::{RunRecords, Work};
use crate::store::shard::{self, FinishedShard, Tally};

/// Refuses to leave the engine open: two machines could choose two, whose parts make no map.
pub(super) fn require_engine(ask: &Map) -> Result<(), Failure> {
    match (ask.shard, ask.engine.engine) {
        (Some(shard), EngineChoice::Auto) => Err(open_engine(shard)),
        _ => Ok(()),
    }
}

/// Why a shard's engine is not left open.
pub fn open_engine(shard: Shard) -> Failure {
    Failure::Usage(anyhow!(
        "--shard {shard}: --engine auto may choose otherwise on another machine, and parts of two engines make no map; \
         name one, the same for all shards: --engine cpu, or --engine gpu (f32 unless told otherwise)"
    ))
}

/// How many runs are asked for.
pub(super) fn runs(ask: &Map, plan: &Plan) -> usize {
    ask.shard.map_or(plan.run_count(), |shard| shard.run_count(plan))
}

/// Whether a shard that is to be gone on with is finished, and its files are good: then no engine needs to be opened.
pub(super) fn is_done(ask: &Map, scene: &Scene, plan: &Plan) -> bool {
    let out = ask.out();
    ask.resume
        && ask.shard.is_some()
        && is_same(ask, scene, &out)
        && is_good(ask, scene, &out)
        && has_all(ask, plan, &out)
}

/// By all but the device: whoever merges compares that.
fn is_same(ask: &Map, scene: &Scene, out: &Path) -> bool {
    let Ok(Some(identity)) = Identity::read(&out.join(RECORDS)) else { return false };
    let (engine, precision) = match ask.engine.engine {
        EngineChoice::Gpu => ("gpu", ask.engine.precision.unwrap_or(Precision::F32).name()),
        EngineChoice::Cpu | EngineChoice::Auto => ("cpu", Precision::F64.name()),
    };
    let asked = Identity::new(engine, precision, identity.device(), scene.identity()).of_shard(ask.shard);
    identity.differences(&asked).is_empty()
}

fn is_good(ask: &Map, scene: &Scene, out: &Path) -> bool {
    let Ok(map) = FinishedMap::open_part(out) else { return false };
    let findings = inventory::check(out, &map.manifest().files);
    map.is_of(scene, &ask.run.set) && findings.is_ok_and(|list| !list.iter().any(Finding::is_lost))
}

/// By the records themselves: where a network disk has no locks, a second run may have spoilt them before the first one
/// took down what they are.
fn has_all(ask: &Map, plan: &Plan, out: &Path) -> bool {
    let path = out.join(RECORDS);
    let Ok(Some(identity)) = Identity::read(&path) else { return false };
    let mut work = Work::new(plan, ask.shard);
    work.read(&path, &identity).is_ok_and(|extent| extent.count == runs(ask, plan))
}

pub(super) fn say_done(ask: &Map, plan: &Plan) -> Result<(), Failure> {
    if let (false, Some(shard)) = (ask.run.quiet, ask.shard) {
        let (out, count, unit) = (ask.out(), shard.run_count(plan), plan.unit());
        say::note(format_args!("{}: shard {shard} is finished: all {count} {unit} are there", out.display()));
    }
    Ok(())
}

/// A shard whose last cell has ended.
pub(super) struct Ended<'a> {
    pub(super) shard: Shard,
    /// Time until the engine was ready.
    pub(super) opening: Duration,
    pub(super) kept: &'a RunRecords<'a>,
    pub(super) tally: &'a Tally,
}

/// Writes what belongs to the records, and says what came of them.
pub(super) fn finish(
    ask: &Map,
    scene: &Scene,
    plan: &Plan,
    engine: &Engine<'_>,
    ended: &Ended<'_>,
    progress: &Progress,
) -> Result<(), Failure> {
    let &Ended { shard, opening, kept, tally } = ended;
    let (device, processor, elapsed) = (engine.device(), processor::described(), kept.elapsed());
    let made = Provenance { engine: engine.name(), precision: engine.precision(), device: &device };
    let run = Run {
        opening,
        elapsed,
        elapsed_before: kept.elapsed_before(),
        resumed_cells: kept.resumed(),
        ..Run::new(made, &ask.run.set, &processor).on(engine)
    };
    let finished = FinishedShard { shard, scene, plan, run: &run, tally };
    let files = shard::write(kept.folder(), &finished)?;
    progress.finish(&told(&finished, kept.folder().path(), &files));
    if ask.json {
        print_json(&shard::object(kept.folder().path(), &files, &finished))?;
    }
    if tally.all_failed() && !ask.run.quiet {
        say::note(
            "warning: every cell of the shard failed; a map of which no cell is left fails when it is merged",
        );
    }
    Ok(())
}

/// What was done, how fast, and what came out.
fn told(finished: &FinishedShard<'_>, folder: &Path, files: &[String]) -> String {
    let FinishedShard { shard, plan, run, tally, .. } = finished;
    let (count, unit, seconds) = (shard.run_count(plan), plan.unit(), run.elapsed.as_secs_f64().max(1e-9));
    let before = match run.resumed_cells {
        0 => String::new(),
        resumed => format!(", {resumed} of them kept before,"),
    };
    let [periodic, chaotic, undecided, failed] = tally.classes;
    format!(
        "shard {shard}: {count} of {} {unit}{before} in {seconds:.3} s on {} ({}): {:.0} {unit}/s\n\
         {}{periodic} periodic, {chaotic} chaotic, {undecided} undecided, {failed} failed\n\
         {}: {}; the map is made of all {} shards by `rattlemap merge OUT PART...`",
        plan.run_count(),
        run.made.engine,
        run.made.precision,
        (count - run.resumed_cells) as f64 / seconds,
        summary::by_card(&run.cards, unit),
        say::path(folder),
        files.join(", "),
        shard.count()
    )
}
