//! Progress on stderr: a bar on a terminal, plain lines in a pipe, nothing if asked.

use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::{ProgressBar, ProgressStyle};

/// Plain lines come once per this many parts of the whole.
const LINES: usize = 10;

/// Who is told how far a run has come.
pub(crate) enum Progress {
    Quiet,
    Bar(ProgressBar),
    Lines { total: usize, said: AtomicUsize },
}

impl Progress {
    /// Progress over `total` columns, at least one.
    pub(crate) fn new(total: usize, quiet: bool) -> Progress {
        if quiet {
            return Progress::Quiet;
        }
        if !stderr().is_terminal() {
            return Progress::Lines { total, said: AtomicUsize::new(0) };
        }
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} columns, {eta} left");
        let bar = ProgressBar::new(total as u64);
        Progress::Bar(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())))
    }

    /// Says that `done` columns are done so far; calls may come from any thread, in any order.
    pub(crate) fn report(&self, done: usize) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                if done as u64 > bar.position() {
                    bar.set_position(done as u64);
                }
            }
            Progress::Lines { total, said } => {
                let part = done * LINES / total;
                if said.fetch_max(part, Ordering::Relaxed) < part {
                    eprintln!("{done} of {total} columns");
                }
            }
        }
    }

    /// Clears the bar, if there is one, and says one last line unless quiet.
    pub(crate) fn finish(&self, line: &str) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                bar.finish_and_clear();
                eprintln!("{line}");
            }
            Progress::Lines { .. } => eprintln!("{line}"),
        }
    }
}
