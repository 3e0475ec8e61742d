//! Reports progress on stderr: a bar on a terminal, lines in a pipe, nothing with `--quiet`.

use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::sync::{Mutex, PoisonError};
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
    /// Draws a bar on a terminal. The number is the largest that was reported as done.
    Bar(ProgressBar, Mutex<usize>),
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
    /// Largest number of units that were reported as done, and number of lines that are printed.
    reported: Mutex<[usize; 2]>,
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
            let (clock, reported) = (Instant::now(), Mutex::new([from, from * LINES / total]));
            return Progress::Lines(Lines { unit, grows, from, clock, reported });
        }
        let style = ProgressStyle::with_template(&template(grows, unit));
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key("rate", write_rate);
        let bar = ProgressBar::new(total as u64).with_position(from as u64).with_style(style);
        bar.reset_eta();
        bar.enable_steady_tick(TICK);
        Progress::Bar(bar, Mutex::new(from))
    }

    /// Reports that `done` of `total` units are done. Threads may call it in any order. The total may grow.
    pub fn report(&self, done: usize, total: usize) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar, most) => {
                bar.set_length(total as u64);
                let mut most = most.lock().unwrap_or_else(PoisonError::into_inner);
                *most = done.max(*most);
                bar.set_position(*most as u64);
            }
            Progress::Lines(lines) => lines.report(done, total, say::note),
        }
    }

    /// Removes the bar.
    pub(super) fn clear(&self) {
        if let Progress::Bar(bar, _) = self {
            bar.finish_and_clear();
        }
    }

    /// Removes the bar and prints lines, unless quiet.
    pub fn finish(&self, line: &str) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar, _) => {
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
    /// Prints a line if a further tenth of the total is done. The lock keeps lines in order.
    fn report(&self, done: usize, total: usize, print: impl FnOnce(String)) {
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        let [most, printed] = *reported;
        if done < most {
            // Another thread has reported more.
            return;
        }
        // After the total has grown, the same share can be reached again.
        let part = done * LINES / total;
        *reported = [done, part];
        if printed < part {
            print(self.text(done, total, self.clock.elapsed()));
        }
    }

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

    fn lines(grows: bool) -> Lines {
        Lines { unit: "cells", grows, from: 0, clock: Instant::now(), reported: Mutex::new([0, 0]) }
    }

    fn text(grows: bool, done: usize) -> String {
        lines(grows).text(done, 400, Duration::from_secs(10))
    }

    #[test]
    fn progress_never_runs_backwards() {
        let (lines, mut printed) = (lines(true), Vec::new());
        let mut report = |done, total| lines.report(done, total, |line| printed.push(line));
        // Threads report in any order. The last total is larger, so a share of 4 tenths is reached twice.
        for (done, total) in [(9, 100), (41, 100), (20, 100), (40, 100), (45, 100), (50, 200), (80, 200)] {
            report(done, total);
        }
        assert_eq!(
            printed,
            [(41, 100), (80, 200)].map(|(done, total)| format!("{done} of at least {total} cells"))
        );
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
