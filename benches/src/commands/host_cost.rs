//! `host-cost`: costs of the host by phase, per million cells.

use anyhow::Context;
use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;
use rattlemap::gpu::Traffic;
use rattlemap::job::engine_choice::{EngineKind, EngineRequest};
use rattlemap_bench::host_cost::{self, CONTACT_FREE, HostCost, RATTLING};
use rattlemap_bench::phase::Cost;
use rattlemap_bench::scaling::{self, CORES, Scaling};
use rattlemap_bench::write_rows;

use crate::arguments;

pub(crate) fn run(arguments: &arguments::HostCost) -> Result<(), Failure> {
    let counts = if arguments.run.quick { [40, 30] } else { [arguments.columns, arguments.rows] };
    if arguments.scaling {
        return scaling(arguments, counts);
    }
    let kind = if arguments.gpu { EngineKind::Gpu } else { EngineKind::Cpu };
    let engine = EngineRequest { kind, precision: None, adapter: None };
    let dir = arguments.run.out("host-cost");
    let outer = rattlemap::store::folder::Folder::open(&dir, arguments.run.force)?;
    let cost =
        host_cost::run(counts, CONTACT_FREE, arguments.all, engine, &dir.join("map")).context("the map")?;
    let HostCost { cells, mut phases, traffic, .. } = cost;
    if kind == EngineKind::Cpu {
        let lanes = host_cost::alone(counts, CONTACT_FREE, arguments.all).context("the engine alone")?;
        let left = |of: fn(&Cost) -> f64| phases.iter().map(of).sum::<f64>() - of(&lanes);
        let [seconds, processor_seconds, thread_seconds] = [
            left(|cost| cost.seconds),
            left(|cost| cost.processor_seconds),
            left(|cost| cost.thread_seconds),
        ];
        let host = Cost { phase: "host", seconds, processor_seconds, thread_seconds, peak_bytes: None };
        phases.extend([lanes, host]);
    }
    let per_million = 1e6 / cells as f64;
    for Cost { seconds, processor_seconds, thread_seconds, .. } in &mut phases {
        [seconds, processor_seconds, thread_seconds].into_iter().for_each(|time| *time *= per_million);
    }
    outer.replace("host_cost.csv", |out| write_rows(out, &phases))?;
    if arguments.run.quiet {
        return Ok(());
    }
    note(format_args!("{cells} cells; seconds per million cells:"));
    note(format_args!("{:<12} {:>8} {:>10} {:>12}", "phase", "wall", "processor", "main thread"));
    for Cost { phase, seconds, processor_seconds, thread_seconds, .. } in &phases {
        note(format_args!("{phase:<12} {seconds:>8.3} {processor_seconds:>10.3} {thread_seconds:>12.3}"));
    }
    if let Some(Traffic { dispatches, submissions, waits, written_bytes, read_bytes }) = traffic {
        note(format_args!(
            "device: {dispatches} dispatches in {submissions} submissions, {waits} waits; {:.1} MB written, {:.1} MB read",
            written_bytes as f64 / 1e6,
            read_bytes as f64 / 1e6
        ));
    }
    Ok(())
}

/// Measures how maps scale with the number of threads.
fn scaling(arguments: &arguments::HostCost, counts: [u32; 2]) -> Result<(), Failure> {
    let dir = arguments.run.out("host-cost");
    let folder = rattlemap::store::folder::Folder::open(&dir, arguments.run.force)?;
    let of = |map, counts, force| scaling::run(map, counts, force, arguments.all, &dir).context(map);
    let found = [
        of("cheap", counts, CONTACT_FREE)?,
        of("expensive", counts.map(|count| (count / 8).max(2)), RATTLING)?,
    ];
    folder.replace("scaling.csv", |out| write_rows(out, &found))?;
    if arguments.run.quiet {
        return Ok(());
    }
    let threads = found[0].threads;
    note(format_args!("seconds per million cells; {CORES} cores are simulated:"));
    note(format_args!(
        "{:<10} {:>10} {:>10} {:>8} {:>10} {:>6}",
        "cells",
        "1 thread",
        format!("{threads} threads"),
        "serial",
        format!("{CORES} cores"),
        "busy"
    ));
    for Scaling { map, one, all, serial, simulated, busy, .. } in &found {
        note(format_args!(
            "{map:<10} {one:>10.3} {all:>10.3} {serial:>8.3} {simulated:>10.3} {:>5.0}%",
            100.0 * busy
        ));
    }
    Ok(())
}
