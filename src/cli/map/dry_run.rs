//! `rattlemap map --dry-run`: what a map would take. Nothing is written.

use std::path::Path;
use std::time::Instant;

use anyhow::anyhow;
use serde_json::{Value, json};

use super::{engine_of, shard};
use crate::cli::arguments::Map;
use crate::cli::say;
use crate::cli::stdout::{print, print_json};
use crate::job::capacity::{Free, bytes};
use crate::job::engine_choice::{self, Chosen};
use crate::job::error::Failure;
use crate::job::forecast::Forecast;
use crate::job::processor;
use crate::map::engine::Engine;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::map::size::Size;
use crate::store;
use crate::store::folder::Folder;
use crate::store::record_file::{Identity, RECORDS, RecordFileError};
use crate::store::run_records::Work;

/// What is foreseen.
struct Foreseen<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    /// A part of the map, and how many runs it has.
    shard: Option<(Shard, usize)>,
    engine: &'a Engine<'a>,
    why: String,
    /// Runs that an interrupted run has kept.
    kept: usize,
    size: Size,
    free: Free,
    /// To open the engine.
    opening: f64,
    forecast: Forecast,
}

/// Checks what a run would check, times some cells and says what all of them take.
pub(super) fn run(ask: &Map, scene: &Scene, plan: &Plan, free: Free) -> Result<(), Failure> {
    let out = ask.out();
    check_folder(ask, &out)?;
    let clock = Instant::now();
    let Chosen { mut engine, why, notes, warnings } =
        pollster::block_on(engine_choice::open(plan, &engine_of(ask, &out)))?;
    let opening = clock.elapsed().as_secs_f64();
    if !ask.run.quiet {
        notes.iter().for_each(say::note);
    }
    warnings.iter().for_each(say::note);
    let kept = if ask.resume { kept_runs(ask, &out, scene, plan, &engine)? } else { 0 };
    let runs = shard::runs(ask, plan);
    let left = runs.saturating_sub(kept);
    let forecast = match left {
        0 => Forecast { seconds: 0.0, interval: Some([0.0; 2]), sampled: 0 },
        left => Forecast::of(plan, &mut engine, left).map_err(|error| Failure::Run(anyhow!("{error}")))?,
    };
    let size = Size::of_shard(scene, ask.shard);
    let foreseen = Foreseen {
        scene,
        shard: ask.shard.map(|shard| (shard, runs)),
        plan,
        engine: &engine,
        why,
        kept,
        size,
        free,
        opening,
        forecast,
    };
    if ask.json { print_json(&foreseen.object(&out)) } else { print(&foreseen.text(&out)) }
}

/// Refuses a folder that a run would refuse, as far as that can be seen without making it.
fn check_folder(ask: &Map, out: &Path) -> Result<(), Failure> {
    if ask.resume && !out.join(RECORDS).is_file() && Folder::holds_results(out) {
        return Err(RecordFileError::NothingToResume { folder: out.to_owned() }.into());
    }
    Ok(Folder::check(out, ask.run.force || ask.resume, store::map::names())?)
}

/// How many runs are kept of those that are asked for.
fn kept_runs(
    ask: &Map,
    out: &Path,
    scene: &Scene,
    plan: &Plan,
    engine: &Engine<'_>,
) -> Result<usize, Failure> {
    let path = out.join(RECORDS);
    if !path.is_file() {
        return Ok(0);
    }
    let identity = Identity::new(engine.name(), engine.precision(), &engine.device(), scene.identity())
        .of_shard(ask.shard);
    Ok(Work::new(plan, ask.shard).read(&path, &identity)?.count)
}

impl Foreseen<'_> {
    fn threads(&self) -> u64 {
        processor::cores() as u64
    }

    fn is_gpu(&self) -> bool {
        self.engine.device_bytes().is_some()
    }

    /// Bytes of the host's memory.
    fn host(&self) -> u64 {
        if self.is_gpu() { self.size.on_gpu() } else { self.size.on_cpu(self.threads()) }
    }

    /// Fewer cells of an adaptive map are integrated; nobody knows how many.
    fn is_adaptive(&self) -> bool {
        self.plan.refine().is_some()
    }

    fn text(&self, out: &Path) -> String {
        let Foreseen { scene, plan, engine, kept, size, free, forecast, .. } = self;
        let counts: Vec<String> = scene.axes().iter().map(|axis| axis.count().to_string()).collect();
        let grid = if plan.is_list() { String::new() } else { format!("{} = ", counts.join(" x ")) };
        let starts = match plan.start_count() {
            1 => String::new(),
            starts => format!(", {starts} starts each: {} runs", plan.run_count()),
        };
        let of_shard = self.shard.map_or(String::new(), |(shard, runs)| {
            format!("; {runs} {} of them in shard {shard}", plan.unit())
        });
        let kept =
            if *kept > 0 { format!("; {kept} {} are kept already", plan.unit()) } else { String::new() };
        let of = |free: Option<u64>| free.map_or(String::new(), |free| format!("; {} are free", bytes(free)));
        let device = engine
            .device_bytes()
            .map_or(String::new(), |most| format!(", and up to {} on the device", bytes(most)));
        let why = if self.why.is_empty() { String::new() } else { format!(": {}", self.why) };
        let place = crate::cli::say::path(out);
        [
            format!("cells    {grid}{}{starts}{of_shard}{kept}", plan.cell_count()),
            format!("engine   {} ({}) on {}{why}", engine.name(), engine.precision(), self.device()),
            format!("memory   about {}{device}{}", bytes(self.host()), of(free.memory)),
            format!("disk     about {}{} for {place}", bytes(size.disk), of(free.disk)),
            format!("time     {}", time(&self.forecast, self.is_adaptive())),
            format!("         from {} cells, computed and thrown away; {} more to open the engine, and tables and \
                     figures come on top", forecast.sampled, in_words(self.opening)),
            "nothing was written".to_owned(),
        ]
        .join("\n")
    }

    fn device(&self) -> String {
        if self.is_gpu() { crate::cli::say::quoted(self.engine.device()) } else { processor::described() }
    }

    fn object(&self, out: &Path) -> Value {
        let Foreseen { scene, plan, engine, size, free, forecast, .. } = self;
        json!({
            "folder": out.to_string_lossy(),
            "cells": scene.cell_count(),
            "runs": self.shard.map_or(plan.run_count(), |(_, runs)| runs),
            "shard": self.shard.map(|(shard, _)| shard),
            "kept": self.kept,
            "engine": engine.name(),
            "precision": engine.precision(),
            "device": engine.device(),
            "why": self.why,
            "memory_bytes": { "host": self.host(), "free": free.memory, "device": engine.device_bytes() },
            "disk_bytes": { "needed": size.disk, "free": free.disk },
            "seconds": {
                "open": self.opening,
                "integrate": forecast.seconds,
                "interval": forecast.interval,
            },
            "is_upper_bound": is_upper_bound(forecast, self.is_adaptive()),
            "sampled": forecast.sampled,
        })
    }
}

/// Whether a map takes no longer than foreseen: as long only if every cell is integrated, and all of the sample ended.
fn is_upper_bound(forecast: &Forecast, is_adaptive: bool) -> bool {
    is_adaptive && forecast.interval.is_some()
}

/// How long a map takes.
fn time(forecast: &Forecast, is_adaptive: bool) -> String {
    let seconds = in_words(forecast.seconds);
    let at_most = if is_upper_bound(forecast, is_adaptive) { "at most " } else { "" };
    match forecast.interval {
        // Fewer cells may take less than that.
        None if is_adaptive => format!("if every cell were integrated, more than {seconds}"),
        None => format!("more than {seconds}"),
        Some([low, high]) if high > low => {
            format!("{at_most}about {seconds} (95 %: {} to {})", in_words(low), in_words(high))
        }
        Some(_) => format!("{at_most}about {seconds}"),
    }
}

/// A time in few digits.
fn in_words(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 600.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units_that_fit() {
        let told = [0.04, 9.4, 75.0, 600.0, 9000.0, 1e6].map(in_words);
        assert_eq!(told, ["0.0 s", "9.4 s", "75 s", "10 min", "2.5 h", "11.6 days"]);
    }

    #[test]
    fn a_sample_that_did_not_end_bounds_no_adaptive_map() {
        let ended = Forecast { seconds: 75.0, interval: Some([60.0, 90.0]), sampled: 16 };
        let cut = Forecast { interval: None, ..ended };
        assert_eq!(time(&ended, false), "about 75 s (95 %: 60 s to 90 s)");
        assert_eq!(time(&ended, true), "at most about 75 s (95 %: 60 s to 90 s)");
        assert_eq!(time(&cut, false), "more than 75 s");
        assert_eq!(time(&cut, true), "if every cell were integrated, more than 75 s");
        let bounds = [(&ended, false), (&ended, true), (&cut, false), (&cut, true)];
        assert_eq!(
            bounds.map(|(forecast, adaptive)| is_upper_bound(forecast, adaptive)),
            [false, true, false, false]
        );
    }
}
