//! Progress on stderr: a bar on a terminal, plain lines in a pipe, nothing if asked.

use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use crate::say;

/// Plain lines come once per this many parts of the whole.
const LINES: usize = 10;

/// Who is told how far a run has come.
pub(crate) enum Progress {
    Quiet,
    Bar(ProgressBar),
    Lines(Lines),
}

/// Plain lines, for pipes and logs.
pub(crate) struct Lines {
    unit: &'static str,
    /// What was done before this run, and when this run began.
    from: usize,
    clock: Instant,
    said: AtomicUsize,
}

impl Progress {
    /// Progress over `total` columns or other units, at least one, of which `from` are done.
    pub(crate) fn new(total: usize, from: usize, unit: &'static str, quiet: bool) -> Progress {
        if quiet {
            return Progress::Quiet;
        }
        if !stderr().is_terminal() {
            let (clock, said) = (Instant::now(), AtomicUsize::new(from * LINES / total));
            return Progress::Lines(Lines { unit, from, clock, said });
        }
        let template = format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
        let style = ProgressStyle::with_template(&template);
        let bar = ProgressBar::new(total as u64).with_position(from as u64);
        bar.reset_eta();
        Progress::Bar(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())))
    }

    /// Says that `done` of `total` units are done so far; calls may come from any thread, in
    /// any order. The total may grow.
    pub(crate) fn report(&self, done: usize, total: usize) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                bar.set_length(total as u64);
                if done as u64 > bar.position() {
                    bar.set_position(done as u64);
                }
            }
            Progress::Lines(lines) => {
                // Of a total that has grown, what has been said may be said again.
                let part = done * LINES / total;
                if lines.said.swap(part, Ordering::Relaxed) < part {
                    say::note(lines.text(done, total));
                }
            }
        }
    }

    /// Says something else meanwhile.
    pub(crate) fn suspend(&self, say: impl FnOnce()) {
        match self {
            Progress::Bar(bar) => bar.suspend(say),
            Progress::Quiet | Progress::Lines(_) => say(),
        }
    }

    /// Clears the bar, if there is one, and says one last line unless quiet.
    pub(crate) fn finish(&self, line: &str) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                bar.finish_and_clear();
                say::note(line);
            }
            Progress::Lines(_) => say::note(line),
        }
    }
}

impl Lines {
    fn text(&self, done: usize, total: usize) -> String {
        let unit = self.unit;
        let seconds = self.clock.elapsed().as_secs_f64();
        let rate = (done - self.from.min(done)) as f64 / seconds.max(1e-9);
        let left = (total - done) as f64 / rate.max(1e-9);
        if done == total || seconds < 1.0 {
            return format!("{done} of {total} {unit}");
        }
        format!("{done} of {total} {unit}, {rate:.0} per second, {left:.0} s left")
    }
}
