//! `rattlemap map --dry-run`: prints the memory, disk space and time that a map needs.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::cli::arguments::Map;
use crate::cli::console::Console;
use crate::cli::failure::Failure;
use crate::cli::say::{path, quoted};
use crate::cli::stdout::{print, print_json};
use crate::job::engine_choice::EngineKind;
use crate::job::error::JobError;
use crate::job::forecast::{self, Forecast};
use crate::job::map::{MapJob, OpenMap};
use crate::job::observer::Observer;
use crate::job::size::{Free, Size};
use crate::job::{model_engine, processor};
use crate::map::plan::Plan;
use crate::map::sweep::SweepError;
use crate::store::folder::{Folder, FolderError};
use crate::store::map;
use crate::store::record_file::{Identity, RECORDS};
use crate::store::run_records::{self, Work};
use crate::text::size::bytes;

/// Estimates memory, disk space and time, and prints them.
pub(super) fn run(
    job: &MapJob<'_>,
    plan: &Plan,
    out: &Path,
    arguments: &Map,
    free: Free,
    console: Arc<Console>,
) -> Result<(), Failure> {
    let job = MapJob { engine: job.engine_request(Some(out)), ..job.clone() };
    let dry = DryRun::of(&job, plan, out, arguments.run.force, free, console)?;
    if arguments.json { print_json(&dry.object()) } else { print(&dry.text()) }
}

/// A map that is not computed, and what it needs.
struct DryRun<'a> {
    job: &'a MapJob<'a>,
    plan: &'a Plan,
    out: &'a Path,
    /// Whether the folder contains files, and the run needs `--resume` or `--force`.
    is_taken: bool,
    /// Number of runs of the map or shard.
    runs: usize,
    /// Number of runs whose records are already in the folder.
    stored: usize,
    opened: OpenMap<'a>,
    size: Size,
    free: Free,
    forecast: Forecast,
}

impl<'a> DryRun<'a> {
    /// Opens the engine and computes a sample of the cells, whose records are discarded. Notes and warnings about the
    /// engine go to the console.
    ///
    /// # Errors
    /// [`JobError`] if the folder cannot be used, or the engine cannot be opened or fails.
    fn of(
        job: &'a MapJob<'a>,
        plan: &'a Plan,
        out: &'a Path,
        force: bool,
        free: Free,
        console: Arc<Console>,
    ) -> Result<DryRun<'a>, JobError> {
        if job.resume {
            run_records::require_records(out)?;
        }
        let is_taken = match Folder::check(out, force || job.resume, map::names_of(job.scene)) {
            Err(FolderError::NotEmpty { .. }) => true,
            checked => checked.map(|()| false)?,
        };
        if let Some(warning) = forecast::long_cells(plan) {
            console.warn(&warning);
        }
        let mut opened = job.open(plan, None, console)?;
        let engine = &mut opened.engine;
        let records = out.join(RECORDS);
        let stored = if job.resume && records.is_file() {
            let identity = Identity::of_run(engine, job.scene, job.shard);
            Work::new(plan, job.shard, false).read(&records, &identity)?.count
        } else {
            0
        };
        let runs = job.run_count(plan);
        let forecast = Forecast::of(plan, engine, runs.saturating_sub(stored)).map_err(SweepError::Engine)?;
        let size = Size::of(job.scene, job.shard);
        Ok(DryRun { job, plan, out, is_taken, runs, stored, opened, size, free, forecast })
    }

    /// Memory of the host, in bytes.
    fn host_memory(&self) -> u64 {
        let is_on_device = self.opened.engine.device_bytes().is_some();
        self.size.memory(if is_on_device { EngineKind::Gpu } else { EngineKind::Cpu })
    }

    fn text(&self) -> String {
        let DryRun { job, plan, out, runs, stored, size, forecast, .. } = self;
        let OpenMap { engine, reason, opening, .. } = &self.opened;
        let counts: Vec<String> = job.scene.axes().iter().map(|axis| axis.count().to_string()).collect();
        let grid = if plan.is_list() { String::new() } else { format!("{} = ", counts.join(" x ")) };
        let unit = plan.unit();
        let starts = match plan.start_count() {
            1 => String::new(),
            starts => format!(", {starts} starts each: {} runs", plan.run_count()),
        };
        let shard =
            job.shard.map_or(String::new(), |shard| format!("; {runs} {unit} of them in shard {shard}"));
        let stored =
            if *stored > 0 { format!("; {stored} {unit} are stored already") } else { String::new() };
        let most = engine.device_bytes();
        let device = if most.is_some() { quoted(engine.device()) } else { processor::described() };
        let reason = if reason.is_empty() { String::new() } else { format!(": {reason}") };
        let on_device =
            most.map_or(String::new(), |most| format!(", and up to {} on the device", bytes(most)));
        let free =
            |free: Option<u64>| free.map_or(String::new(), |free| format!("; {} are free", bytes(free)));
        [
            format!("cells    {grid}{}{starts}{shard}{stored}", plan.cell_count()),
            format!("engine   {} ({}) on {device}{reason}", engine.name(), engine.precision()),
            format!("model    {}", model_engine::described(&plan.oscillator(0))),
            format!("memory   about {}{on_device}{}", bytes(self.host_memory()), free(self.free.memory)),
            format!("disk     about {}{} for {}", bytes(size.disk), free(self.free.disk), path(out)),
            format!("time     {}", time(forecast, plan.refine().is_some())),
            format!(
                "         predicted from {} cells; opening the engine ({}) and writing tables and figures are not included",
                forecast.sampled,
                seconds(opening.as_secs_f64())
            ),
            match self.is_taken {
                true => "folder   not empty: the run needs --resume or --force; nothing was written".to_owned(),
                false => "nothing was written".to_owned(),
            },
        ]
        .join("\n")
    }

    fn object(&self) -> Value {
        let DryRun { free, forecast, .. } = self;
        let OpenMap { engine, reason, opening, .. } = &self.opened;
        json!({
            "folder": self.out.to_string_lossy(),
            "needs_resume_or_force": self.is_taken,
            "cells": self.plan.cell_count(),
            "runs": self.runs,
            "shard": self.job.shard,
            "kept": self.stored,
            "engine": engine.name(),
            "precision": engine.precision(),
            "device": engine.device(),
            "why": reason,
            "memory_bytes": { "host": self.host_memory(), "free": free.memory, "device": engine.device_bytes() },
            "disk_bytes": { "needed": self.size.disk, "free": free.disk },
            "seconds": {
                "open": opening.as_secs_f64(),
                "integrate": forecast.seconds,
                "interval": forecast.interval,
            },
            // An adaptive map integrates fewer cells than predicted, if the whole sample ended in time.
            "is_upper_bound": self.plan.refine().is_some() && forecast.interval.is_some(),
            "sampled": forecast.sampled,
        })
    }
}

/// Formats the predicted time. It is an upper bound for an adaptive map, which integrates fewer cells.
fn time(forecast: &Forecast, is_adaptive: bool) -> String {
    let total = seconds(forecast.seconds);
    let at_most = if is_adaptive { "at most " } else { "" };
    match forecast.interval {
        None if is_adaptive => format!("if every cell were integrated, more than {total}"),
        None => format!("more than {total}"),
        Some([low, high]) if high > low => {
            format!("{at_most}about {total} (95 %: {} to {})", seconds(low), seconds(high))
        }
        Some(_) => format!("{at_most}about {total}"),
    }
}

/// Formats a time with a suitable unit.
fn seconds(seconds: f64) -> String {
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
    fn times_have_suitable_units() {
        let texts = [0.04, 9.4, 75.0, 600.0, 9000.0, 1e6].map(seconds);
        assert_eq!(texts, ["0.0 s", "9.4 s", "75 s", "10 min", "2.5 h", "11.6 days"]);
    }

    #[test]
    fn only_a_sample_that_ended_bounds_the_time_of_an_adaptive_map() {
        let ended = Forecast { seconds: 75.0, interval: Some([60.0, 90.0]), sampled: 16 };
        let cut = Forecast { interval: None, ..ended };
        assert_eq!(time(&ended, false), "about 75 s (95 %: 60 s to 90 s)");
        assert_eq!(time(&ended, true), "at most about 75 s (95 %: 60 s to 90 s)");
        assert_eq!(time(&cut, false), "more than 75 s");
        assert_eq!(time(&cut, true), "if every cell were integrated, more than 75 s");
    }
}
