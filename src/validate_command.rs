//! `rattlemap validate`: a finished map's folder in, its validation beside it.

use std::fs;
use std::path::Path;

use anyhow::{Context, anyhow};
use rattlemap::coexistence;
use rattlemap::gpu::{self, AdapterChoice, Gpu, Precision};
use rattlemap::output::map::{MANIFEST, Made, write_validation};
use rattlemap::output::{Cells, Extent, Folder, Identity, RECORDS, RecordFile, RecordFileError};
use rattlemap::plan::Plan;
use rattlemap::record::Record;
use rattlemap::scene::{Purpose, Scene, Steps};
use rattlemap::schedule::{Refined, Schedule};
use rattlemap::sweep;
use rattlemap::validate::{self, Explanation, Sample, StateCheck, StateSource, Subject, Validation};
use serde::Deserialize;

use crate::cli::Validate;
use crate::error::Failure;
use crate::map_command::unit;
use crate::progress::Progress;
use crate::say;

/// What a manifest has to say.
#[derive(Deserialize)]
struct Manifest {
    command: String,
    crate_version: String,
    engine: String,
    precision: String,
    device: String,
    scene: String,
    set: Vec<String>,
}

/// Reads, replays, writes.
pub(crate) fn run(ask: &Validate) -> Result<(), Failure> {
    let dir = &ask.folder;
    let manifest = read_manifest(dir).map_err(Failure::Usage)?;
    let name = dir.join(MANIFEST).display().to_string();
    let scene = Scene::parse(&manifest.scene, &name, &manifest.set, Purpose::Map)?;
    let plan = Plan::new(&scene);
    let (records, refined) = read_records(dir, &manifest, &scene, &plan).map_err(Failure::Usage)?;
    let folder = Folder::open(dir, true)?;
    let subject = Subject {
        plan: &plan,
        records: &records,
        precision: precision(&manifest).map_err(Failure::Usage)?,
        is_lane: manifest.engine == "gpu",
    };
    let sample = validate::sample(&plan, &records, ask.samples as usize, ask.seed);
    let count = sample.picks.len();
    let tell = |what: &str| (!ask.quiet).then(|| say::note(format_args!("{what}")));
    if subject.is_lane {
        tell(&format!("running the lanes of {count} cells again over a few periods"));
    }
    let Again { source, device, note } = states(&subject, &scene, &manifest, &sample)?;
    tell(&format!("replaying {count} cells on the reference"));
    let progress = Progress::new(count, 0, "cells replayed", ask.quiet);
    let validation = validate::replay(&subject, &sample, source, &|done| progress.report(done, count));
    let attractors = coexistence::attractors(&plan, &records);
    let cells = Cells::new(&scene, &plan, &records).counting(attractors.as_deref()).refined(refined.as_ref());
    let made = Made { engine: &manifest.engine, precision: &manifest.precision, device: &manifest.device };
    let files = write_validation(&folder, &cells, &made, device.as_deref(), &validation)?;
    progress.finish(&format!("{}{note}\n{}: {}", summary(&validation), dir.display(), files.join(", ")));
    verdict(dir, &plan, &validation)
}

fn read_manifest(dir: &Path) -> anyhow::Result<Manifest> {
    if !dir.is_dir() {
        return Err(anyhow!("{}: there is no such folder; name the folder of a finished map", dir.display()));
    }
    let path = dir.join(MANIFEST);
    if !path.is_file() {
        let advice = if dir.join(RECORDS).is_file() {
            "the run is unfinished: go on with `rattlemap map SCENE --resume`"
        } else {
            "it is not the folder of a map: `rattlemap map SCENE` makes one"
        };
        return Err(anyhow!("{}: there is no {MANIFEST}; {advice}", dir.display()));
    }
    let foreign = || format!("{}: this is not the manifest of a map", path.display());
    let text = fs::read_to_string(&path).with_context(foreign)?;
    let manifest: serde_json::Value = serde_json::from_str(&text).with_context(foreign)?;
    if manifest["command"] != "map" {
        let made = manifest["command"].as_str().unwrap_or("something else");
        return Err(anyhow!("{}: this is not the manifest of a map, but of `{made}`", path.display()));
    }
    let manifest: Manifest = serde_json::from_value(manifest).with_context(foreign)?;
    let own = env!("CARGO_PKG_VERSION");
    if manifest.crate_version != own {
        return Err(anyhow!(
            "{}: the map was made by rattlemap {}, this is {own}; validate it with that version, or make it \
             again with `rattlemap {} --force`",
            path.display(),
            manifest.crate_version,
            manifest.command
        ));
    }
    Ok(manifest)
}

fn precision(manifest: &Manifest) -> anyhow::Result<Precision> {
    match (manifest.engine.as_str(), manifest.precision.as_str()) {
        ("cpu" | "gpu", "f64") => Ok(Precision::F64),
        ("gpu", "f32") => Ok(Precision::F32),
        (engine, precision) => Err(anyhow!("{MANIFEST}: no engine `{engine}` computes in `{precision}`")),
    }
}

/// One record per run, and what became of an adaptive map.
fn read_records(
    dir: &Path,
    manifest: &Manifest,
    scene: &Scene,
    plan: &Plan,
) -> anyhow::Result<(Vec<Record>, Option<Refined>)> {
    let path = dir.join(RECORDS);
    if !path.is_file() {
        return Err(anyhow!(
            "{}: there is no {RECORDS}; tables alone cannot be replayed: make the map again with \
             `rattlemap map SCENE --force`",
            dir.display()
        ));
    }
    let identity = Identity::new(&manifest.engine, &manifest.precision, &manifest.device, scene.identity());
    let mut schedule = Schedule::new(plan);
    let mut records = vec![Record::default(); plan.run_count()];
    let take = |batch: &[(u32, Record)]| sweep::replay(&mut schedule, &mut records, batch);
    let again = "make the map again with `rattlemap map SCENE --force`";
    let go_on = "`rattlemap map SCENE --resume` keeps them and computes the others";
    let Extent { count, damage, .. } =
        RecordFile::read(&path, &identity, take).map_err(|error| match error {
            RecordFileError::OtherRun { path, differences } => {
                anyhow!(
                    "{} does not belong to the {MANIFEST} beside it: {differences}; {again}",
                    path.display()
                )
            }
            RecordFileError::Damaged { path, at, what } => {
                anyhow!("{} is damaged at byte {at}: {what}; {again}", path.display())
            }
            other => other.into(),
        })?;
    if !schedule.is_finished() {
        let (cells, unit) = (schedule.expected(), unit(plan));
        let damage = damage.map_or(String::new(), |damage| format!("{damage}: "));
        return Err(anyhow!("{}: {damage}{count} of {cells} {unit} are there; {go_on}", path.display()));
    }
    // Nothing is missing: it stands behind the last cell.
    if let Some(damage) = damage {
        say::note(format_args!(
            "warning: {}: {damage}; all {count} {} are there",
            path.display(),
            unit(plan)
        ));
    }
    let refined = schedule.finish(&mut records);
    Ok((records, refined))
}

/// States of the sample, made again.
struct Again {
    source: StateSource,
    /// What ran lanes again, if anything did.
    device: Option<String>,
    /// What is to be said about that; empty where it is the map's own device.
    note: String,
}

impl Again {
    fn without_lanes(source: StateSource) -> Again {
        Again { source, device: None, note: String::new() }
    }
}

/// Runs the sample's lanes again over a few periods, on the device that made the map or else on
/// the best adapter there is.
fn states(
    subject: &Subject<'_>,
    scene: &Scene,
    manifest: &Manifest,
    sample: &Sample,
) -> Result<Again, Failure> {
    if !subject.is_lane {
        return Ok(Again::without_lanes(StateSource::Replay));
    }
    let open = |choice: &AdapterChoice| pollster::block_on(Gpu::open(subject.precision, choice));
    let own = AdapterChoice { name: Some(manifest.device.clone()) };
    let (mut gpu, note) = match open(&own) {
        Ok(gpu) => (gpu, String::new()),
        Err(why) => match open(&AdapterChoice::default()) {
            Ok(gpu) => {
                let device = gpu::describe(gpu.adapter());
                (gpu, format!("\nlanes ran again on {device}, not on the map's own device: {why}"))
            }
            Err(error) => return Ok(Again::without_lanes(StateSource::None(error.to_string()))),
        },
    };
    let ids: Vec<u32> = sample.picks.iter().map(|pick| pick.id).collect();
    let steps = match scene.integration().steps_per_period {
        Steps::Auto => None,
        Steps::PerPeriod(steps) => Some(steps),
    };
    let Subject { plan, records, .. } = *subject;
    let lanes = pollster::block_on(validate::states::lane_states(&mut gpu, plan, records, &ids, steps))
        .context("cannot run the sample's lanes again")?;
    Ok(Again { source: StateSource::Lanes(lanes), device: Some(gpu::describe(gpu.adapter())), note })
}

fn summary(validation: &Validation) -> String {
    let states = match &validation.states {
        StateCheck::Lanes { cells, above_budget, units, .. } => {
            let worst = units.map_or(0.0, |units| units.worst);
            format!(
                "states of {}: worst error {worst:.2} budgets, {above_budget} above one",
                plural(*cells, "lane")
            )
        }
        StateCheck::Replay { cells, identical, .. } => {
            format!("states of {identical} of {cells} {} the same to the bit", validation.counted())
        }
        StateCheck::Skipped { reason } => format!("states not compared: {reason}"),
    };
    let kinds: Vec<String> = Explanation::ALL
        .into_iter()
        .filter(|&explanation| validation.explained_by(explanation) > 0)
        .map(|explanation| format!("{} {}", validation.explained_by(explanation), explanation.name()))
        .collect();
    let filled = match validation.filled {
        0 => String::new(),
        filled => format!("; {filled} of {} were filled, not integrated, and not replayed", validation.runs),
    };
    let explained = if kinds.is_empty() { String::new() } else { format!(" ({})", kinds.join(", ")) };
    format!(
        "{} replayed: {}{explained}, {} unexplained; {states}{filled}",
        plural(validation.sampled(), validation.counted().trim_end_matches('s')),
        plural(validation.mismatches.len(), "mismatch"),
        validation.unexplained()
    )
}

fn plural(count: usize, one: &str) -> String {
    let ending = match one {
        _ if count == 1 => "",
        _ if one.ends_with("ch") => "es",
        _ => "s",
    };
    format!("{count} {one}{ending}")
}

/// Cells that a message names; the file has all.
const NAMED: usize = 8;

fn verdict(dir: &Path, plan: &Plan, validation: &Validation) -> Result<(), Failure> {
    let unexplained = || validation.mismatches.iter().filter(|mismatch| mismatch.explanation.is_none());
    let count = unexplained().count();
    if count == 0 {
        return Ok(());
    }
    let named: Vec<String> = unexplained()
        .take(NAMED)
        .map(|mismatch| {
            let [i, j] = plan.indices(mismatch.id);
            format!("({i}, {j})")
        })
        .collect();
    let more = if count > NAMED { ", ..." } else { "" };
    Err(Failure::Run(anyhow!(
        "{count} of {} {} {} from the reference without an explanation: {} {}{more}; {} lists them, \
         each with the command that replays it",
        validation.sampled(),
        validation.counted(),
        if count == 1 { "differs" } else { "differ" },
        if named.len() == 1 { "cell" } else { "cells" },
        named.join(", "),
        dir.join("validation.json").display()
    )))
}
