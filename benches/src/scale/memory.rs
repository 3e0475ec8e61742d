//! How much memory a phase needs at most.

use std::fs;

/// The largest resident size of this process since it was last asked.
#[derive(Clone, Copy, Debug)]
pub struct Memory;

impl Memory {
    /// Starts a phase: its peak is what is resident now.
    pub fn begin() -> Memory {
        // Where the system has no such file, or will not have it written, peaks are those of the whole run.
        let _ = fs::write("/proc/self/clear_refs", "5");
        Memory
    }

    /// Bytes at the most since; none where the system does not tell.
    pub fn peak(self) -> Option<u64> {
        let status = fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
    }
}
