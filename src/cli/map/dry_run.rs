//! `rattlemap map --dry-run`: prints the memory, disk space and time that a map needs.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::cli::arguments::Map;
use crate::cli::console::Console;
use crate::cli::failure::Failure;
use crate::cli::say::{path, quoted};
use crate::cli::stdout::{print, print_json};
use crate::job::dry_run::DryRun;
use crate::job::forecast::Forecast;
use crate::job::map::MapJob;
use crate::job::processor;
use crate::job::size::Free;
use crate::map::plan::Plan;
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
    let dry = DryRun::of(job, plan, out, arguments.run.force, free, console)?;
    if arguments.json {
        return print_json(&object(&dry, job, plan, out));
    }
    print(&text(&dry, job, plan, out))
}

fn text(dry: &DryRun, job: &MapJob<'_>, plan: &Plan, out: &Path) -> String {
    let counts: Vec<String> = job.scene.axes().iter().map(|axis| axis.count().to_string()).collect();
    let grid = if plan.is_list() { String::new() } else { format!("{} = ", counts.join(" x ")) };
    let unit = plan.unit();
    let starts = match plan.start_count() {
        1 => String::new(),
        starts => format!(", {starts} starts each: {} runs", plan.run_count()),
    };
    let shard =
        job.shard.map_or(String::new(), |shard| format!("; {} {unit} of them in shard {shard}", dry.runs));
    let stored =
        if dry.stored > 0 { format!("; {} {unit} are stored already", dry.stored) } else { String::new() };
    let device = if dry.device_memory.is_some() { quoted(&dry.device) } else { processor::described() };
    let reason = if dry.reason.is_empty() { String::new() } else { format!(": {}", dry.reason) };
    let on_device =
        dry.device_memory.map_or(String::new(), |most| format!(", and up to {} on the device", bytes(most)));
    let free = |free: Option<u64>| free.map_or(String::new(), |free| format!("; {} are free", bytes(free)));
    [
        format!("cells    {grid}{}{starts}{shard}{stored}", plan.cell_count()),
        format!("engine   {} ({}) on {device}{reason}", dry.engine, dry.precision),
        format!("model    {}", dry.model),
        format!("memory   about {}{on_device}{}", bytes(dry.host_memory), free(dry.free.memory)),
        format!("disk     about {}{} for {}", bytes(dry.disk), free(dry.free.disk), path(out)),
        format!("time     {}", time(&dry.forecast, dry.is_adaptive)),
        format!(
            "         predicted from {} cells; opening the engine ({}) and writing tables and figures are not included",
            dry.forecast.sampled,
            seconds(dry.open_seconds)
        ),
        match dry.is_taken {
            true => "folder   not empty: the run needs --resume or --force; nothing was written".to_owned(),
            false => "nothing was written".to_owned(),
        },
    ]
    .join("\n")
}

fn object(dry: &DryRun, job: &MapJob<'_>, plan: &Plan, out: &Path) -> Value {
    json!({
        "folder": out.to_string_lossy(),
        "needs_resume_or_force": dry.is_taken,
        "cells": plan.cell_count(),
        "runs": dry.runs,
        "shard": job.shard,
        "kept": dry.stored,
        "engine": dry.engine,
        "precision": dry.precision,
        "device": dry.device,
        "why": dry.reason,
        "memory_bytes": { "host": dry.host_memory, "free": dry.free.memory, "device": dry.device_memory },
        "disk_bytes": { "needed": dry.disk, "free": dry.free.disk },
        "seconds": {
            "open": dry.open_seconds,
            "integrate": dry.forecast.seconds,
            "interval": dry.forecast.interval,
        },
        "is_upper_bound": dry.is_upper_bound(),
        "sampled": dry.forecast.sampled,
    })
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
