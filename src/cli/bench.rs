//! `rattlemap bench engines`: the same scene on every engine.

pub mod measure;
pub mod statistics;

use std::time::Instant;

use crate::cli::bench::measure::check::check;
use crate::cli::bench::measure::output::{Asked, device_share, shares_of_peak, write};
use crate::cli::bench::measure::work::work;
use crate::cli::bench::measure::{
    Answers, Bench, Engine, Extent, LEAST_RUNS, Point, QUICK_SIDES, RUNS, Run, SIDES, Series, peak,
};
use crate::gpu::{self, AdapterReport, Precision};
use crate::map::scene::Scene;
use crate::store::folder::Folder;
use crate::validate::{DEFAULT_SAMPLES, Kind};
use anyhow::anyhow;

use crate::cli::arguments::{EngineChoice, Engines};
use crate::cli::say;
use crate::job::capacity;
use crate::job::error::Failure;
use crate::job::processor;

/// Side of the map on which operations are counted.
const COUNTED_SIDE: u32 = 24;

/// Share of the time that checks and counting may be left with.
const FOR_CHECKS: f64 = 0.15;

/// Measures every engine there is, writes, and says what came out.
pub(crate) fn run(ask: &Engines) -> Result<(), Failure> {
    let adapters = pollster::block_on(gpu::adapters());
    let adapters = match &ask.adapter {
        Some(wanted) => wanted.among(&adapters).map_err(|error| Failure::Usage(error.into()))?,
        None => &adapters,
    };
    let engines = engines(adapters);
    let out = ask.run.out("engines");
    let folder = Folder::open(&out, ask.run.force)?;
    let scratch = Folder::open(&out.join("scratch"), true)?;
    let clock = Instant::now();
    let budget = if ask.run.quick { 0.0 } else { f64::from(ask.budget) };
    let mut answers = Answers::new();
    let mut all: Vec<Series> = Vec::new();
    for (nth, engine) in engines.iter().enumerate() {
        let left = (1.0 - FOR_CHECKS) * budget - clock.elapsed().as_secs_f64();
        let seconds =
            if ask.run.quick { f64::INFINITY } else { left.max(0.0) / (engines.len() - nth) as f64 };
        let is_first_lane = !all.iter().any(|series| series.engine.threads().is_none());
        match measure(ask, engine, &scratch, seconds, &mut answers, is_first_lane) {
            Ok(series) => {
                all.push(series);
                // Whoever is stopped before the last engine has the others.
                write(&folder, &all, &asked_of(ask, &all, budget))?;
            }
            // The others are there to be measured all the same.
            Err(error) => say(ask, &format!("{} is left out: {error:#}", engine.label())),
        }
    }
    std::fs::remove_dir_all(scratch.path()).map_err(anyhow::Error::from)?;
    let asked = asked_of(ask, &all, budget);
    let files = write(&folder, &all, &asked)?;
    if !ask.run.quiet {
        let summary = summary(&all, &asked);
        say::notes(format_args!("{summary}\n{}: {}", say::path(&out), files.join(", ")));
    }
    verdict(&all)
}

fn asked_of(ask: &Engines, all: &[Series], budget_seconds: f64) -> Asked {
    Asked {
        budget_seconds,
        quick: ask.run.quick,
        cores: processor::cores(),
        processor: processor::described(),
        peaks: all.iter().map(|series| peak_of(ask, &series.engine)).collect(),
    }
}

/// The CPU on all cores, which the others are compared with; adapters, the best first; the CPU
/// on fewer cores.
fn engines(adapters: &[AdapterReport]) -> Vec<Engine> {
    let most = processor::cores();
    let mut list = vec![Engine::Cpu { threads: most }];
    let mut cards: Vec<Card> = Vec::new();
    for adapter in adapters {
        let card = [adapter.info.vendor, adapter.info.device];
        if is_listed(card, &cards) {
            continue;
        }
        cards.push(card);
        let device = gpu::describe(&adapter.info);
        let is_hardware = gpu::is_hardware(&adapter.info);
        let number = adapter.number;
        let lanes =
            |&precision: &Precision| Engine::Gpu { precision, number, device: device.clone(), is_hardware };
        list.extend(adapter.precisions.iter().map(lanes));
    }
    let mut threads = 1;
    while threads < most {
        list.push(Engine::Cpu { threads });
        threads *= 2;
    }
    list
}

/// Maker and model, 0 where an interface does not tell.
type Card = [u32; 2];

/// Whether a card has been listed by a better interface: OpenGL does not tell the model.
fn is_listed([maker, model]: Card, cards: &[Card]) -> bool {
    cards.iter().any(|&[other, its]| other == maker && (its == model || model == 0))
}

fn measure(
    ask: &Engines,
    engine: &Engine,
    scratch: &Folder,
    seconds: f64,
    answers: &mut Answers,
    is_first_lane: bool,
) -> anyhow::Result<Series> {
    say(ask, &format!("{}:", engine.label()));
    let mut bench = match engine {
        Engine::Cpu { threads } => Bench::cpu(*threads, scratch)?,
        Engine::Gpu { precision, number, .. } => Bench::gpu(*precision, *number, scratch)?,
    };
    let choice = if engine.threads().is_some() { EngineChoice::Cpu } else { EngineChoice::Gpu };
    let misfit = |scene: &Scene| {
        capacity::check(scene, None, choice, scratch.path()).err().map(|failure| failure.to_string())
    };
    let sides = if ask.run.quick { &QUICK_SIDES[..] } else { &SIDES };
    let runs = if ask.run.quick { LEAST_RUNS } else { RUNS };
    let extent = Extent { sides, runs, seconds, misfit: &misfit };
    let report = &mut |_: &Engine, point: &Point| say(ask, &progress(point));
    let mut series = Series::measure(&mut bench, &extent, answers, report)?;
    if let Some((lanes, why)) = series.skipped.first() {
        say(ask, &format!("{lanes:>10} lanes and more are left out: {why}"));
    }
    // The reference on fewer threads is the same reference.
    if engine.threads().is_none_or(|threads| threads == processor::cores()) {
        series.check = check(&mut bench, if ask.run.quick { 9 } else { DEFAULT_SAMPLES });
    }
    if peak_of(ask, engine).is_some() || ask.run.quick && is_first_lane {
        series.work = work(&mut bench, if ask.run.quick { 4 } else { COUNTED_SIDE })?;
    }
    Ok(series)
}

/// What was given, or else is known of the adapter.
fn peak_of(ask: &Engines, engine: &Engine) -> Option<f64> {
    let Engine::Gpu { precision, device, is_hardware, .. } = engine else { return None };
    let given = match precision {
        Precision::F32 => ask.peak_f32,
        Precision::F64 => ask.peak_f64,
    };
    given.filter(|_| *is_hardware).map(|tera| 1e12 * tera).or_else(|| peak::of(device, *precision))
}

fn say(ask: &Engines, text: &str) {
    if !ask.run.quiet {
        say::note(text);
    }
}

fn progress(point: &Point) -> String {
    let rate = point.spread(Run::rate);
    let time = point.spread(|run| run.times.running());
    format!(
        "{:>10} lanes: {} lane-periods/s ({} to {}), {:.3} s, {} runs",
        point.lanes,
        figure(rate.median),
        figure(rate.low),
        figure(rate.high),
        time.median,
        point.runs.len()
    )
}

/// Three significant digits.
fn figure(x: f64) -> String {
    format!("{x:.2e}")
}

fn summary(all: &[Series], asked: &Asked) -> String {
    let mut lines = vec![format!(
        "{:<44} {:>10} {:>10} {:>9} {:>9} {:>8} {:>8}",
        "largest map on each engine", "lanes", "periods/s", "steps/s", "device", "of peak", "differ"
    )];
    for (series, &peak) in all.iter().zip(&asked.peaks) {
        let Some(point) = series.largest() else { continue };
        let known = |x: f64, text: String| if x.is_finite() { text } else { "-".to_owned() };
        let steps = point.spread(Run::step_rate).median;
        let device = point.spread(device_share).median;
        let shares = shares_of_peak(series, point, peak);
        lines.push(format!(
            "{:<44} {:>10} {:>10} {:>9} {:>9} {:>8} {:>8}",
            series.engine.label(),
            point.lanes,
            figure(point.spread(Run::rate).median),
            known(steps, figure(steps)),
            known(device, format!("{:.0} %", 100.0 * device)),
            shares.map_or("-".to_owned(), |[low, high]| format!("{:.0}-{:.0} %", 100.0 * low, 100.0 * high)),
            point.differing.map_or("-".to_owned(), |count| count.to_string()),
        ));
    }
    lines.extend(all.iter().filter_map(checked));
    lines.join("\n")
}

fn checked(series: &Series) -> Option<String> {
    let check = series.check.as_ref()?;
    let validation = &check.validation;
    Some(format!(
        "{}: {} of {} cells replayed: {} mismatches, {} unexplained",
        series.engine.label(),
        validation.replayed,
        check.lanes,
        validation.mismatches.len(),
        validation.of_kind(Kind::Unexplained)
    ))
}

fn verdict(all: &[Series]) -> Result<(), Failure> {
    if all.iter().all(|series| series.points.is_empty()) {
        return Err(Failure::Run(anyhow!("nothing could be measured")));
    }
    let of = |series: &Series| {
        let check = series.check.as_ref()?;
        let cells: Vec<String> =
            check.unexplained.iter().map(|[e, omega]| format!("e = {e}, omega = {omega}")).collect();
        let faults = check.validation.faults();
        let told = || format!("{}: {}: {}", series.engine.label(), faults.join("; "), cells.join("; "));
        (!faults.is_empty()).then(told)
    };
    let faults: Vec<String> = all.iter().filter_map(of).collect();
    if faults.is_empty() { Ok(()) } else { Err(Failure::Run(anyhow!("{}", faults.join(". ")))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_is_measured_by_one_interface() {
        let listed = [[0x10de, 0x2331]];
        assert!(is_listed([0x10de, 0x2331], &listed), "the same card");
        assert!(is_listed([0x10de, 0], &listed), "the same maker's, by an interface that tells no more");
        assert!(!is_listed([0x10de, 0x2335], &listed), "another model");
        assert!(!is_listed([0x1002, 0], &listed), "another maker's");
    }
}
