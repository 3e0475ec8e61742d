//! `host-cost`: costs of the host by phase, per million cells.

use anyhow::Context;
use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;
use rattlemap::gpu::Traffic;
use rattlemap::job::engine_choice::{EngineKind, EngineRequest};
use rattlemap_bench::host_cost::{self, HostCost};
use rattlemap_bench::phase::Cost;
use rattlemap_bench::write_rows;

use crate::arguments;

pub(crate) fn run(arguments: &arguments::HostCost) -> Result<(), Failure> {
    let counts = if arguments.run.quick { [40, 30] } else { [arguments.columns, arguments.rows] };
    let kind = if arguments.gpu { EngineKind::Gpu } else { EngineKind::Cpu };
    let engine = EngineRequest { kind, precision: None, adapter: None };
    let dir = arguments.run.out("host-cost");
    let outer = rattlemap::store::folder::Folder::open(&dir, arguments.run.force)?;
    let cost = host_cost::run(counts, arguments.all, engine, &dir.join("map")).context("the map")?;
    let HostCost { cells, mut phases, traffic } = cost;
    if kind == EngineKind::Cpu {
        let lanes = host_cost::alone(counts, arguments.all).context("the engine alone")?;
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
