//! Reports progress on stderr: a bar on a terminal, lines in a pipe, nothing with `--quiet`.

use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use crate::cli::say;

/// Largest number of lines in a pipe.
const LINES: usize = 10;

/// Interval at which a bar is redrawn, so that its clock runs.
const TICK: Duration = Duration::from_secs(1);

/// Reports progress.
pub enum Progress {
    /// Reports nothing.
    Quiet,
    /// Draws a bar on a terminal.
    Bar(ProgressBar),
    /// Prints lines into a pipe or a log.
    Lines(Lines),
}

/// Progress as lines.
pub struct Lines {
    unit: &'static str,
    /// Whether the total is a lower bound that can grow. Then the remaining time is not shown.
    grows: bool,
    /// Number of units that earlier runs have done.
    from: usize,
    /// Start of this run.
    clock: Instant,
    /// Number of lines that are due or printed.
    printed: AtomicUsize,
}

impl Progress {
    /// Starts a report on `total` units, at least one, of which earlier runs have done `from`.
    pub fn new(total: usize, from: usize, unit: &'static str, quiet: bool) -> Progress {
        Progress::of(total, from, unit, quiet, false)
    }

    /// Starts a report on `total` units; the total may grow.
    pub(super) fn of(total: usize, from: usize, unit: &'static str, quiet: bool, grows: bool) -> Progress {
        if quiet {
            return Progress::Quiet;
        }
        if !stderr().is_terminal() {
            let (clock, printed) = (Instant::now(), AtomicUsize::new(from * LINES / total));
            return Progress::Lines(Lines { unit, grows, from, clock, printed });
        }
        let style = ProgressStyle::with_template(&template(grows, unit));
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key("rate", write_rate);
        let bar = ProgressBar::new(total as u64).with_position(from as u64).with_style(style);
        bar.reset_eta();
        bar.enable_steady_tick(TICK);
        Progress::Bar(bar)
    }

    /// Reports that `done` of `total` units are done. Threads may call it in any order. The total may grow.
    pub fn report(&self, done: usize, total: usize) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                bar.set_length(total as u64);
                if done as u64 > bar.position() {
                    bar.set_position(done as u64);
                }
            }
            Progress::Lines(lines) => {
                // After the total has grown, the same share can be reached again.
                let part = done * LINES / total;
                if lines.printed.swap(part, Ordering::Relaxed) < part {
                    say::note(lines.text(done, total, lines.clock.elapsed()));
                }
            }
        }
    }

    /// Removes the bar while `print` prints.
    pub fn suspend(&self, print: impl FnOnce()) {
        match self {
            Progress::Bar(bar) => bar.suspend(print),
            Progress::Quiet | Progress::Lines(_) => print(),
        }
    }

    /// Removes the bar and prints lines, unless quiet.
    pub fn finish(&self, line: &str) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                bar.finish_and_clear();
                say::notes(line);
            }
            Progress::Lines(_) => say::notes(line),
        }
    }
}

fn write_rate(state: &ProgressState, text: &mut dyn Write) {
    let _ = text.write_str(&rate(state.per_sec()));
}

fn template(grows: bool, unit: &str) -> String {
    match grows {
        false => format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{rate}}/s, {{eta}} left"),
        true => format!("{{bar:40}} {{pos}} of at least {{len}} {unit}, {{rate}}/s"),
    }
}

/// Formats a rate with as many digits as its accuracy allows.
fn rate(per_second: f64) -> String {
    if per_second < 10.0 { format!("{per_second:.1}") } else { format!("{per_second:.0}") }
}

impl Lines {
    fn text(&self, done: usize, total: usize, elapsed: Duration) -> String {
        let unit = self.unit;
        let at_least = if self.grows { "at least " } else { "" };
        let seconds = elapsed.as_secs_f64();
        let rate = (done - self.from.min(done)) as f64 / seconds.max(1e-9);
        let left = (total - done) as f64 / rate.max(1e-9);
        if done == total || seconds < 1.0 {
            return format!("{done} of {at_least}{total} {unit}");
        }
        let left = if self.grows { String::new() } else { format!(", {left:.0} s left") };
        format!("{done} of {at_least}{total} {unit}, {} per second{left}", self::rate(rate))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(grows: bool, done: usize) -> String {
        let lines =
            Lines { unit: "cells", grows, from: 0, clock: Instant::now(), printed: AtomicUsize::new(0) };
        lines.text(done, 400, Duration::from_secs(10))
    }

    #[test]
    fn the_remaining_time_is_shown_if_the_total_is_exact() {
        assert_eq!(text(false, 200), "200 of 400 cells, 20 per second, 10 s left");
        assert_eq!(text(true, 200), "200 of at least 400 cells, 20 per second");
        assert_eq!(text(true, 400), "400 of at least 400 cells");
    }

    #[test]
    fn fast_rates_have_no_decimals() {
        assert_eq!([7816.8616, 12.5, 3.31, 0.0].map(rate), ["7817", "12", "3.3", "0.0"]);
    }

    #[test]
    fn templates_are_valid() {
        for grows in [false, true] {
            assert!(ProgressStyle::with_template(&template(grows, "cells")).is_ok());
        }
    }
}
