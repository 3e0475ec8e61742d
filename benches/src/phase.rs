//! Time and memory of a phase.

use std::fs;
use std::time::Instant;

use cpu_time::{ProcessTime, ThreadTime};
use serde::Serialize;

/// Time and memory of a finished phase.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// Name of the phase.
    pub phase: &'static str,
    /// Wall time.
    pub seconds: f64,
    /// Processor time of all threads, which depends less on other programs.
    pub processor_seconds: f64,
    /// Processor time of the thread that ran the phase.
    pub thread_seconds: f64,
    /// Largest resident size of this process in bytes; `None` if the system does not report it.
    pub peak_bytes: Option<u64>,
}

/// Runs a phase and adds its cost.
pub fn run<T>(phase: &'static str, costs: &mut Vec<Cost>, work: impl FnOnce() -> T) -> T {
    // Resets the largest resident size. If the file cannot be written, later phases report that of the whole run.
    let _ = fs::write("/proc/self/clear_refs", "5");
    let (clock, processor, thread) = (Instant::now(), ProcessTime::now(), ThreadTime::now());
    let result = work();
    costs.push(Cost {
        phase,
        seconds: clock.elapsed().as_secs_f64(),
        processor_seconds: processor.elapsed().as_secs_f64(),
        thread_seconds: thread.elapsed().as_secs_f64(),
        peak_bytes: peak(),
    });
    result
}

fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}
