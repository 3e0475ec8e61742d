//! Whether a map fits this machine, asked before anything is written or computed.

use std::path::Path;

use anyhow::anyhow;
use rattlemap::output::RECORDS;
use rattlemap::plan::Size;
use rattlemap::scene::Scene;

use crate::error::Failure;

/// Refuses a map that does not fit memory or disk, with figures. What the system does not
/// tell is taken to be enough.
pub(crate) fn check(scene: &Scene, out: &Path) -> Result<(), Failure> {
    let size = Size::of(scene);
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let memory = size.memory.saturating_add(size.memory_per_thread.saturating_mul(threads - 1));
    let kept = out.join(RECORDS).metadata().map_or(0, |data| data.len());
    let counts: Vec<String> = scene.axes().iter().map(|axis| axis.count().to_string()).collect();
    let starts = if size.runs > size.cells { format!(", {} runs,", size.runs) } else { String::new() };
    let map = format!("a map of {} = {} cells{starts}", counts.join(" x "), size.cells);
    let refuse = |what: &str, needed: u64, available: u64| {
        Err(Failure::Usage(anyhow!(
            "{map} needs about {} of {what}, and {} are free; lower axis.0.count or axis.1.count{}",
            gigabytes(needed),
            gigabytes(available),
            if what == "disk" { ", or name another disk with --out" } else { "" }
        )))
    };
    if !size.is_countable() {
        return Err(Failure::Usage(anyhow!(
            "{map} is too large: at most {} runs can be numbered; lower axis.0.count or axis.1.count",
            u32::MAX
        )));
    }
    match free_memory() {
        Some(free) if free < memory => return refuse("memory", memory, free),
        _ => {}
    }
    match free_disk(out) {
        Some(free) if free.saturating_add(kept) < size.disk => refuse("disk", size.disk, free),
        _ => Ok(()),
    }
}

/// Memory that can still be had, container limits included.
fn free_memory() -> Option<u64> {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let free = system.available_memory();
    let limited = system.cgroup_limits().map_or(free, |limits| free.min(limits.free_memory));
    (limited > 0).then_some(limited)
}

/// Room on the disk that will hold `out`, which need not exist yet.
fn free_disk(out: &Path) -> Option<u64> {
    let absolute = std::path::absolute(out).ok()?;
    let existing = absolute.ancestors().find(|folder| folder.is_dir())?;
    fs4::available_space(existing).ok()
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}
