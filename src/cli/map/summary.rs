//! Lines that are printed when a map or a shard is done.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use crate::cli::say::{classes, path};
use crate::map::engine::Preparation;
use crate::map::plan::count_classes;
use crate::show::cells::Cells;
use crate::show::refinement;
use crate::store::map::{Provenance, Run};
use crate::store::shard::FinishedShard;
use crate::validate::Rate;

/// Counts, speed and classes of a map. `finishing` is the time from the last cell to the last file, in seconds.
pub(super) fn map(cells: &Cells<'_>, run: &Run<'_>, lane_steps: Option<u64>, finishing: f64) -> String {
    let (count, [columns, rows]) = (cells.runs(), cells.counts());
    let unit = if count > columns * rows { "runs" } else { "cells" };
    let integrated = cells.refinement().map_or(count, |refined| refined.integrated);
    let per_step = lane_steps.filter(|&steps| steps > 0).map_or(String::new(), |steps| {
        format!(", {} ns per step", three_digits(1e9 * run.elapsed.as_secs_f64() / steps as f64))
    });
    let share = (integrated - run.resumed_cells) as f64 / integrated as f64;
    let periods = per_second(cells.periods() as f64 * share, run);
    let speed = speed(integrated, unit, run, &format!(", {periods:.0} forcing periods/s{per_step}"));
    format!(
        "{integrated} {unit}{speed}; files written in {finishing:.3} s\n{}{}",
        refinement::lines(cells).into_iter().map(|line| line + "\n").collect::<String>(),
        classes(count_classes(cells.classes()))
            + &cells.finished().map_or(String::new(), finished)
            + &cells.chaos_ends().map_or(String::new(), chaos_ends),
    )
}

/// Says where the time of a run went, in seconds. `finishing` is the time from the last cell to the last file.
pub(super) fn times(run: &Run<'_>, finishing: Duration, files: BTreeMap<String, Duration>) -> String {
    let phase = |name: &str, time: Duration| format!("{name} {:.3}", time.as_secs_f64());
    let Preparation { flows, compile } = run.preparation;
    let slowest = files.into_iter().max_by_key(|(_, time)| *time);
    let slowest = slowest.map_or(String::new(), |(name, time)| format!(" ({})", phase(&name, time)));
    let phases = [
        phase("plan", run.planning),
        phase("device", run.device()),
        phase("flows", flows),
        phase("compile", compile),
        format!("{} ({})", phase("integrate", run.elapsed), phase("records", run.storing)),
        phase("files", finishing) + &slowest,
    ];
    format!("\ntime in seconds: {}", phases.join(", "))
}

/// Says how many cells of lanes the reference finished; nothing if it finished none.
fn finished([_, by_reference]: [usize; 2]) -> String {
    match by_reference {
        0 => String::new(),
        count => format!("\nfinished by the reference (undecided lanes, contacts at phase 0): {count}"),
    }
}

/// Says at which rate chaos ends.
fn chaos_ends(rate: Rate) -> String {
    let Rate { count, among, .. } = rate;
    format!(
        "\nchaos ended {count} times in {among} forcing periods of chaotic cells: {} of these cells end in 1000 periods",
        rate.text_within(1000)
    )
}

/// Time and speed of a run; without them if earlier runs have done everything. `more` ends the speed.
fn speed(count: usize, unit: &str, run: &Run<'_>, more: &str) -> String {
    let resumed = match run.resumed_cells {
        0 => String::new(),
        cells if cells == count => return ", all by earlier runs".to_owned(),
        cells => format!(", {cells} of them by earlier runs,"),
    };
    let rate = per_second((count - run.resumed_cells) as f64, run);
    let (seconds, Provenance { engine, precision, .. }) = (run.elapsed.as_secs_f64(), run.made);
    format!("{resumed} in {seconds:.3} s on {engine} ({precision}): {rate:.0} {unit}/s{more}")
}

fn per_second(count: f64, run: &Run<'_>) -> f64 {
    count / run.elapsed.as_secs_f64().max(1e-9)
}

/// Counts, speed and classes of a shard, its files, and the next command.
pub(super) fn shard(finished: &FinishedShard<'_>, folder: &Path, files: &[String]) -> String {
    let FinishedShard { shard, plan, run, tally, .. } = finished;
    let (count, unit) = (shard.run_count(plan), plan.unit());
    format!(
        "shard {shard}: {count} of {} {unit}{}\n{}\n{}: {}; `rattlemap merge OUT PART...` combines all {} shards",
        plan.run_count(),
        speed(count, unit, run, ""),
        classes(tally.classes),
        path(folder),
        files.join(", "),
        shard.count()
    )
}

fn three_digits(x: f64) -> String {
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{x:.digits$}")
}
