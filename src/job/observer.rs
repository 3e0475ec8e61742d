//! Reports from a running job.

/// Receives reports from a running job. Methods may be called from any thread.
pub trait Observer: Send + Sync {
    /// Receives a remark, one line.
    fn note(&self, _text: &str) {}

    /// Receives a warning, one line.
    fn warn(&self, _text: &str) {}

    /// Receives the number of runs that are done and the number expected so far; the latter can grow.
    fn progress(&self, _done: usize, _expected: usize) {}
}

/// Ignores all reports.
impl Observer for () {}
