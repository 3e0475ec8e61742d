//! `rattlemap validate`: a finished map's folder in, its validation beside it.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use crate::gpu::{self, AdapterChoice, Gpu, Precision};
use crate::map::plan::Plan;
use crate::show::cells::Cells;
use crate::show::cells::Survey;
use crate::store;
use crate::store::finished_map::{FinishedMap, StoredManifest};
use crate::store::folder::Folder;
use crate::store::inventory::Finding;
use crate::store::map::{MANIFEST, Provenance, write_validation};
use crate::validate::{
    self, HORIZON, HalfMesh, Judge, Kind, Lanes, Sample, StratumResult, Subject, Validation,
};
use anyhow::{Context, anyhow};

use crate::cli::arguments::Validate;
use crate::cli::check;
use crate::cli::interrupt::Interrupt;
use crate::cli::progress::Progress;
use crate::cli::say;
use crate::job::capacity;
use crate::job::error::Failure;

/// Reads, replays, writes.
pub(crate) fn run(ask: &Validate) -> Result<(), Failure> {
    let clock = Instant::now();
    let interrupt = Interrupt::listen(ask.quiet)?;
    let dir = &ask.folder;
    check::require_folder(dir)?;
    // From here on: what is read must not be another map's by the time that something is written.
    let folder = Folder::open(dir, true)?;
    folder.refuse_links(store::map::names())?;
    let map = FinishedMap::open_own(dir)?;
    let manifest = map.manifest();
    let findings = check::check_files(dir, &manifest.files, ask.quiet)?;
    let scene = &map.scene()?;
    capacity::check_finished(scene)?;
    let plan = Plan::new(scene);
    plan.check()?;
    let stored = map.records(scene, &plan)?;
    check::warn(&stored);
    let (records, refined) = (stored.records, stored.refined);
    let subject = Subject {
        plan: &plan,
        records: &records,
        precision: precision(manifest).map_err(Failure::Usage)?,
        is_lane: manifest.engine == "gpu",
    };
    let survey = Survey::of(&plan, &records, refined);
    let sample = validate::sample(&plan, &records, ask.samples as usize, ask.seed);
    let count = sample.ids().len();
    let tell = |what: &str| (!ask.quiet).then(|| say::note(format_args!("{what}")));
    tell(&format!("computing {count} cells of the map once more, on a graphics device if there is one"));
    let interrupted = |done: usize| {
        let path = dir.display();
        interrupt
            .failure(anyhow!("interrupted after {done} of {count} cells, and nothing was written to {path}"))
    };
    let path = dir.display();
    let words = format!("none of {count} cells was replayed, and nothing was written to {path}");
    interrupt.ends_at_once(words, folder.leaver());
    let again = run_again(&subject, &sample, &manifest.device, interrupt.raised());
    if !interrupt.wait_for(None) {
        return Err(interrupted(0));
    }
    let (lanes, note) = again?;
    tell(&format!("replaying {count} cells without early stops: each may take its whole budget"));
    let progress = Progress::new(count, 0, "cells replayed", ask.quiet);
    let replayed = AtomicUsize::new(0);
    let report = |done| {
        replayed.fetch_max(done, Ordering::Relaxed);
        progress.report(done, count);
    };
    let replay =
        validate::replay_until(&subject, survey.basins(), &sample, &lanes, &report, interrupt.raised());
    let Some(validation) = replay else { return Err(interrupted(replayed.into_inner())) };
    let cells = Cells::new(scene, &plan, &records).surveyed(&survey);
    let made =
        Provenance { engine: &manifest.engine, precision: &manifest.precision, device: &manifest.device };
    let device = lanes.device.as_deref();
    let files = write_validation(&folder, &cells, &made, device, &validation, clock.elapsed())?;
    let summary = summary(&validation, device.map(say::quoted).as_deref());
    progress.finish(&format!("{summary}{note}\n{}: {}", say::path(dir), files.join(", ")));
    verdict(dir, &plan, &validation)?;
    // What was rewritten is good again.
    let is_left = |finding: &&Finding| finding.is_lost() && !files.contains(&finding.name.as_str());
    let left: Vec<&Finding> = findings.iter().filter(is_left).collect();
    match left.is_empty() {
        true => Ok(()),
        false => Err(Failure::Run(anyhow!(
            "{}; `{}` makes anew what can be made of the records",
            check::named(dir, &left),
            check::repair_command(dir)
        ))),
    }
}

fn precision(manifest: &StoredManifest) -> anyhow::Result<Precision> {
    match (manifest.engine.as_str(), manifest.precision.as_str()) {
        ("cpu" | "gpu", "f64") => Ok(Precision::F64),
        ("gpu", "f32") => Ok(Precision::F32),
        (engine, precision) => Err(anyhow!("{MANIFEST}: no engine `{engine}` computes in `{precision}`")),
    }
}

/// Runs the sample's lanes again, on the device that made the map or else on the best adapter there is; and in f64
/// where that can. What is to be said about it, if anything.
fn run_again(
    subject: &Subject<'_>,
    sample: &Sample,
    made_on: &str,
    halt: &Arc<AtomicBool>,
) -> Result<(Lanes, String), Failure> {
    let open =
        |precision: Precision, choice: &AdapterChoice| pollster::block_on(Gpu::open(precision, choice)).ok();
    let own = AdapterChoice::named(made_on);
    let (mut gpu, note) = match subject.is_lane {
        true => match pollster::block_on(Gpu::open(subject.precision, &own)) {
            Ok(gpu) => (Some(gpu), String::new()),
            Err(why) => match open(subject.precision, &AdapterChoice::default()) {
                Some(gpu) => {
                    let device = say::quoted(gpu::describe(gpu.adapter()));
                    let why = say::quoted(why);
                    (Some(gpu), format!("\nlanes ran again on {device}, not on the map's own device: {why}"))
                }
                None => (None, format!("\nlanes were not run again: {}", say::quoted(why))),
            },
        },
        false => (None, String::new()),
    };
    let is_double = subject.is_lane && subject.precision == Precision::F64;
    let mut double = match is_double {
        true => None,
        false => open(Precision::F64, &own).or_else(|| open(Precision::F64, &AdapterChoice::default())),
    };
    gpu.iter_mut().chain(&mut double).for_each(|gpu| gpu.stop_on(halt));
    let lanes = pollster::block_on(Lanes::run(subject, sample, gpu.as_mut(), double.as_mut()))
        .context("cannot run the sample's lanes again")?;
    Ok((lanes, note))
}

/// Rates of the map, then what else was found.
fn summary(validation: &Validation, device: Option<&str>) -> String {
    let mut lines: Vec<String> =
        validation.strata.iter().filter(|stratum| stratum.sampled > 0).map(told).collect();
    let judge = match (validation.judge, device) {
        (Judge::Reference, _) => "the event-driven reference, without early stops".to_owned(),
        (Judge::Lanes, device) => {
            format!("lanes in f64 on {}, and the reference", device.unwrap_or("a device"))
        }
        (Judge::Independent, _) => "DOP853 with event location, and the reference".to_owned(),
    };
    lines.push(format!("judged by {judge}"));
    let [same, asked] = validation.again;
    if asked > 0 {
        lines.push(format!("computed again by the same engine: {same} of {asked} the same to the bit"));
    }
    if let Some(states) = &validation.states {
        let (off, compared) = (states.off.len(), states.compared);
        let rate = states.rate().text();
        lines.push(format!("states after {HORIZON} periods: {off} of {compared} lanes are off ({rate})"));
    }
    if let Some(half) = &validation.half_mesh {
        let HalfMesh { classes, periods, words, patterns } = half;
        lines.push(format!(
            "half the mesh_speed changes the class of {} of {} meshing {}; of {} cycles the period of {}, the word of {}, \
             the pattern of {}",
            classes.count,
            classes.among,
            validation.counted(),
            periods.among,
            periods.count,
            words.count,
            patterns.count
        ));
    }
    if validation.filled > 0 {
        let (filled, runs) = (validation.filled, validation.runs);
        lines.push(format!("{filled} of {runs} were filled, not integrated, and not replayed"));
    }
    lines.join("\n")
}

/// One stratum: how many cells differ, of which kinds.
fn told(stratum: &StratumResult) -> String {
    let differing = stratum.differing();
    let kinds: Vec<String> = Kind::ALL
        .into_iter()
        .filter(|&kind| kind != Kind::Unexplained && stratum.rate(kind).count > 0)
        .map(|kind| format!("{} {}", kind.name(), stratum.rate(kind).count))
        .collect();
    let kinds = if kinds.is_empty() { String::new() } else { format!("; {}", kinds.join(", ")) };
    let unexplained = stratum.rate(Kind::Unexplained);
    format!(
        "{}: {} of {} cells differ ({}); unexplained {} ({}){kinds}",
        stratum.stratum.name(),
        differing.count,
        stratum.sampled,
        differing.text(),
        unexplained.count,
        unexplained.text()
    )
}

/// Cells that a message names; the file has all.
const NAMED: usize = 8;

fn verdict(dir: &Path, plan: &Plan, validation: &Validation) -> Result<(), Failure> {
    let faults = validation.faults();
    if faults.is_empty() {
        return Ok(());
    }
    let unexplained = validation.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
    let mut ids: Vec<u32> =
        unexplained.map(|mismatch| mismatch.id).chain(validation.not_finite.clone()).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut named: Vec<String> = ids
        .into_iter()
        .take(NAMED + 1)
        .map(|id| {
            let [i, j] = plan.indices(id);
            if plan.is_list() { i.to_string() } else { format!("({i}, {j})") }
        })
        .collect();
    let more = if named.len() > NAMED { ", ..." } else { "" };
    named.truncate(NAMED);
    let cells = if named.is_empty() { String::new() } else { format!(": cells {}{more}", named.join(" ")) };
    Err(Failure::Run(anyhow!(
        "{}{cells}; {} lists them, each with the command that replays it",
        faults.join("; "),
        dir.join("validation.json").display()
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::{Record, valid};

    /// As of a map whose cells were all filled.
    #[test]
    fn a_validation_that_replayed_nothing_fails() {
        let axis = |name: &str| format!("[[axis]]\nparameter = '{name}'\nmin = 0.5\nmax = 1\ncount = 2\n");
        let text = ["e", "omega"].map(axis).concat();
        let plan = Plan::new(&Scene::parse(&text, "s", &[], Purpose::Map).unwrap());
        let records = vec![Record { valid: valid::FILLED, ..Record::default() }; 4];
        let subject = Subject { plan: &plan, records: &records, precision: Precision::F64, is_lane: true };
        let sample = validate::sample(&plan, &records, 4, 1);
        let validation = validate::replay(&subject, &sample, &Lanes::default(), &|_| {});
        let failure = verdict(Path::new("o"), &plan, &validation).unwrap_err();
        assert!(matches!(&failure, Failure::Run(_)), "{failure}");
        assert!(failure.to_string().starts_with("none of 4 cells was replayed"), "{failure}");
    }
}
