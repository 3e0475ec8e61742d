//! How long a phase takes, and how much memory at most.

use std::fs;
use std::time::Instant;

use cpu_time::ProcessTime;
use serde::Serialize;

/// A phase that has begun.
#[derive(Clone, Copy, Debug)]
pub struct Phase {
    name: &'static str,
    clock: Instant,
    processor: ProcessTime,
}

/// What a phase took.
#[derive(Clone, Debug, Serialize)]
pub struct Taken {
    /// Which it is.
    pub phase: &'static str,
    /// Wall time.
    pub seconds: f64,
    /// Time of all threads on a processor: it says more where the machine does other things, too.
    pub processor_seconds: f64,
    /// The largest resident size of this process in it, in bytes; none where the system does not tell.
    pub peak_bytes: Option<u64>,
}

impl Phase {
    /// Begins one.
    pub fn begin(name: &'static str) -> Phase {
        // Where there is no such file, or it may not be written, peaks are those of the whole run.
        let _ = fs::write("/proc/self/clear_refs", "5");
        Phase { name, clock: Instant::now(), processor: ProcessTime::now() }
    }

    /// Ends it.
    pub fn end(self) -> Taken {
        Taken {
            phase: self.name,
            seconds: self.clock.elapsed().as_secs_f64(),
            processor_seconds: self.processor.elapsed().as_secs_f64(),
            peak_bytes: peak(),
        }
    }
}

fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}
