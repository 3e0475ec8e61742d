//! `rattlemap bench engines`: the main map on every engine of this machine, in growing sizes.

mod figure;
mod measure;
pub mod spread;
mod table;

use std::time::Instant;

use anyhow::anyhow;

use crate::cli::arguments::Engines;
use crate::cli::failure::Failure;
use crate::cli::say;
use crate::gpu::{self, AdapterReport};
use crate::job::engine_choice::EngineKind;
use crate::job::size::{self, Free};
use crate::record::Record;
use crate::store::folder::Folder;
use crate::validate::{DEFAULT_SAMPLES, Kind};
use measure::{BenchPoint, OpenEngine, Run, Series, Target, scene};

/// Sides of the maps: 10^3 to 10^7 cells, two sizes per decade.
const SIDES: [u32; 9] = [32, 56, 100, 178, 316, 562, 1000, 1778, 3162];

/// Sides of the maps with `--quick`, which only shows that everything works.
const QUICK_SIDES: [u32; 2] = [6, 9];

/// Largest number of runs of one size.
const MAX_RUNS: usize = 5;

/// Share of the time budget that is reserved for comparing samples with the reference.
const CHECK_SHARE: f64 = 0.15;

/// Measures every engine, writes the folder after each, and prints a summary.
pub(crate) fn run(ask: &Engines) -> Result<(), Failure> {
    let style = ask.run.figure.style()?;
    let adapters = pollster::block_on(gpu::adapters());
    let adapters = match &ask.adapter {
        Some(wanted) => {
            let adapter = wanted.among(&adapters).map_err(|error| Failure::Usage(error.into()))?;
            std::slice::from_ref(adapter)
        }
        None => &adapters,
    };
    let targets = targets(adapters);
    let out = ask.run.out("engines");
    let folder = Folder::open(&out, ask.run.force)?;
    let clock = Instant::now();
    let budget = if ask.run.quick { f64::INFINITY } else { f64::from(ask.budget) };
    let mut all: Vec<Series> = Vec::new();
    let mut files = Vec::new();
    for (nth, target) in targets.iter().enumerate() {
        note(ask, &format!("{}:", target.label()));
        let left = ((1.0 - CHECK_SHARE) * budget - clock.elapsed().as_secs_f64()).max(0.0);
        match measure(ask, target, left / (targets.len() - nth) as f64, all.first()) {
            Ok(series) => {
                all.push(series);
                // If the run is stopped, the results of the finished engines remain.
                files = table::write(&folder, &all, f64::from(ask.budget), &style)?.to_vec();
            }
            Err(error) => note(ask, &format!("{} is left out: {error:#}", target.label())),
        }
    }
    if !ask.run.quiet && !files.is_empty() {
        say::notes(format_args!("{}\n{}: {}", summary(&all), say::path(&out), files.join(", ")));
        say::removed(&folder);
    }
    verdict(&all)
}

/// Lists the processor, then each graphics card once in each of its precisions.
fn targets(adapters: &[AdapterReport]) -> Vec<Target> {
    let mut list = vec![Target::cpu()];
    let mut cards: Vec<Card> = Vec::new();
    for adapter in adapters {
        let card = [adapter.info.vendor, adapter.info.device];
        if !is_listed(card, &cards) {
            cards.push(card);
            list.extend(adapter.precisions.iter().map(|&precision| Target::gpu(adapter, precision)));
        }
    }
    list
}

/// Vendor and model of a card, 0 where an interface does not report it.
type Card = [u32; 2];

/// Whether a better interface has listed the card already. OpenGL does not report the model.
fn is_listed([vendor, model]: Card, cards: &[Card]) -> bool {
    cards.iter().any(|&[other, its]| other == vendor && (its == model || model == 0))
}

/// Measures growing maps on one engine until the next one would exceed its time or the machine's memory.
fn measure(ask: &Engines, target: &Target, seconds: f64, first: Option<&Series>) -> anyhow::Result<Series> {
    let clock = Instant::now();
    let mut bench = OpenEngine::open(target)?;
    let open_seconds = bench.open_seconds;
    let mut series =
        Series { target: target.clone(), open_seconds, points: Vec::new(), skipped: None, check: None };
    let choice = if target.adapter.is_some() { EngineKind::Gpu } else { EngineKind::Cpu };
    let mut largest: Option<(u32, Vec<Record>)> = None;
    for &side in if ask.run.quick { &QUICK_SIDES[..] } else { &SIDES } {
        let (scene, lanes) = (scene(side), (side * side) as usize);
        let left = (seconds - clock.elapsed().as_secs_f64()).max(0.0);
        let needed = series.points.last().map_or(0.0, |point| {
            2.0 * point.spread(|run| run.prepare + run.integrate).median * lanes as f64 / point.lanes as f64
        });
        let misfit = size::check_map(&scene, None, choice, &Free::for_output(None)).err();
        if needed > left {
            series.skipped =
                Some((lanes, format!("it would take about {needed:.0} s, {left:.0} s are left")));
        } else if let Some(misfit) = misfit {
            series.skipped = Some((lanes, misfit.to_string()));
        }
        if let Some((lanes, reason)) = &series.skipped {
            note(ask, &format!("{lanes:>10} lanes and more are left out: {reason}"));
            break;
        }
        drop(largest.take());
        let runs = if ask.run.quick { 2 } else { MAX_RUNS };
        let (mut point, records) = bench.point(&scene, runs, left)?;
        let same_size = first.and_then(|first| first.points.iter().find(|other| other.lanes == lanes));
        let differing = |other: &BenchPoint| {
            point.classes.iter().zip(&other.classes).filter(|(own, its)| own != its).count()
        };
        point.differing = same_size.map(differing);
        note(ask, &progress(&point));
        series.points.push(point);
        largest = Some((side, records));
    }
    if let Some((side, records)) = largest {
        let samples = if ask.run.quick { 9 } else { DEFAULT_SAMPLES };
        series.check = Some(bench.check(&scene(side), &records, samples)?);
    }
    Ok(series)
}

fn note(ask: &Engines, text: &str) {
    if !ask.run.quiet {
        say::note(text);
    }
}

fn progress(point: &BenchPoint) -> String {
    let rate = point.spread(Run::rate);
    format!(
        "{:>10} lanes: {:.2e} lane-periods/s ({:.2e} to {:.2e}), {:.3} s, {} runs",
        point.lanes,
        rate.median,
        rate.low,
        rate.high,
        point.spread(|run| run.integrate).median,
        point.runs.len()
    )
}

/// Builds the table of the largest map of each engine, and the result of its comparison with the reference.
fn summary(all: &[Series]) -> String {
    let mut lines = vec![format!(
        "{:<44} {:>10} {:>10} {:>9} {:>8}",
        "largest map on each engine", "lanes", "periods/s", "device", "differ"
    )];
    for series in all {
        let Some(point) = series.points.last() else { continue };
        let device = point.spread(Run::device_share).median;
        lines.push(format!(
            "{:<44} {:>10} {:>10.2e} {:>9} {:>8}",
            series.target.label(),
            point.lanes,
            point.spread(Run::rate).median,
            if device.is_finite() { format!("{:.0} %", 100.0 * device) } else { "-".to_owned() },
            point.differing.map_or("-".to_owned(), |count| count.to_string()),
        ));
    }
    lines.extend(all.iter().filter_map(|series| {
        let validation = &series.check.as_ref()?.validation;
        Some(format!(
            "{}: {} cells compared with the reference: {} mismatches, {} unexplained",
            series.target.label(),
            validation.replayed,
            validation.mismatches.len(),
            validation.of_kind(Kind::Unexplained)
        ))
    }));
    lines.join("\n")
}

/// Fails if nothing was measured, or if too many cells of an engine differ without an explanation.
fn verdict(all: &[Series]) -> Result<(), Failure> {
    if all.iter().all(|series| series.points.is_empty()) {
        return Err(Failure::Run(anyhow!("nothing could be measured")));
    }
    let fault = |series: &Series| {
        let check = series.check.as_ref()?;
        let faults = check.validation.faults();
        let cells = check.unexplained.iter().map(|[e, omega]| format!("e = {e}, omega = {omega}"));
        let cells: Vec<String> = cells.collect();
        (!faults.is_empty())
            .then(|| format!("{}: {}: {}", series.target.label(), faults.join("; "), cells.join("; ")))
    };
    let faults: Vec<String> = all.iter().filter_map(fault).collect();
    if faults.is_empty() { Ok(()) } else { Err(Failure::Run(anyhow!("{}", faults.join(". ")))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_is_measured_through_one_interface_only() {
        let listed = [[0x10de, 0x2331]];
        assert!(is_listed([0x10de, 0x2331], &listed), "the same card");
        assert!(
            is_listed([0x10de, 0], &listed),
            "the same vendor, by an interface that does not report the model"
        );
        assert!(!is_listed([0x10de, 0x2335], &listed), "another model");
        assert!(!is_listed([0x1002, 0], &listed), "another vendor");
    }
}
