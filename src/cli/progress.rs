//! Progress on stderr: a bar on a terminal, plain lines in a pipe, nothing if asked.

use std::fmt::Write;
use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use crate::cli::say;

/// Plain lines come once per this many parts of the whole.
const LINES: usize = 10;

/// How often a bar is drawn again while nothing ends.
const TICK: Duration = Duration::from_secs(1);

/// Who is told how far a run has come.
pub enum Progress {
    /// Nobody.
    Quiet,
    /// A person at a terminal.
    Bar(ProgressBar),
    /// A pipe or a log.
    Lines(Lines),
}

/// Plain lines, for pipes and logs.
pub struct Lines {
    unit: &'static str,
    total: Total,
    /// What was done before this run, and when this run began.
    from: usize,
    clock: Instant,
    said: AtomicUsize,
}

/// What a total means.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Total {
    Exact,
    /// What is foreseen, and may grow: nobody knows how much time is left.
    AtLeast,
}

impl Progress {
    /// Progress over `total` columns or other units, at least one, of which `from` are done.
    pub fn new(total: usize, from: usize, unit: &'static str, quiet: bool) -> Progress {
        Progress::with(Total::Exact, total, from, unit, quiet)
    }

    /// The same over a total that may grow.
    pub fn of_at_least(total: usize, from: usize, unit: &'static str, quiet: bool) -> Progress {
        Progress::with(Total::AtLeast, total, from, unit, quiet)
    }

    fn with(kind: Total, total: usize, from: usize, unit: &'static str, quiet: bool) -> Progress {
        if quiet {
            return Progress::Quiet;
        }
        if !stderr().is_terminal() {
            let (clock, said) = (Instant::now(), AtomicUsize::new(from * LINES / total));
            return Progress::Lines(Lines { unit, total: kind, from, clock, said });
        }
        let bar = ProgressBar::new(total as u64).with_position(from as u64).with_style(style(kind, unit));
        bar.reset_eta();
        bar.enable_steady_tick(TICK);
        Progress::Bar(bar)
    }

    /// Says that `done` of `total` units are done so far; calls may come from any thread, in
    /// any order. The total may grow.
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
                // Of a total that has grown, what has been said may be said again.
                let part = done * LINES / total;
                if lines.said.swap(part, Ordering::Relaxed) < part {
                    say::note(lines.text(done, total, lines.clock.elapsed()));
                }
            }
        }
    }

    /// Says something else meanwhile.
    pub fn suspend(&self, say: impl FnOnce()) {
        match self {
            Progress::Bar(bar) => bar.suspend(say),
            Progress::Quiet | Progress::Lines(_) => say(),
        }
    }

    /// Clears the bar, if there is one, and says one last line, or several, unless quiet.
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

fn style(total: Total, unit: &str) -> ProgressStyle {
    let style = ProgressStyle::with_template(&template(total, unit));
    style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key(
        "rate",
        |state: &ProgressState, text: &mut dyn Write| {
            // Nothing to be done about a bar that cannot be written.
            let _ = text.write_str(&rate(state.per_sec()));
        },
    )
}

fn template(total: Total, unit: &str) -> String {
    match total {
        Total::Exact => format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{rate}}/s, {{eta}} left"),
        Total::AtLeast => format!("{{bar:40}} {{pos}} of at least {{len}} {unit}, {{rate}}/s"),
    }
}

/// A rate in as many digits as tell anything.
fn rate(per_second: f64) -> String {
    if per_second < 10.0 { format!("{per_second:.1}") } else { format!("{per_second:.0}") }
}

impl Lines {
    fn text(&self, done: usize, total: usize, elapsed: Duration) -> String {
        let unit = self.unit;
        let at_least = if self.total == Total::AtLeast { "at least " } else { "" };
        let seconds = elapsed.as_secs_f64();
        let rate = (done - self.from.min(done)) as f64 / seconds.max(1e-9);
        let left = (total - done) as f64 / rate.max(1e-9);
        if done == total || seconds < 1.0 {
            return format!("{done} of {at_least}{total} {unit}");
        }
        let left = if self.total == Total::AtLeast { String::new() } else { format!(", {left:.0} s left") };
        format!("{done} of {at_least}{total} {unit}, {} per second{left}", self::rate(rate))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(total: Total, done: usize) -> String {
        let lines = Lines { unit: "cells", total, from: 0, clock: Instant::now(), said: AtomicUsize::new(0) };
        lines.text(done, 400, Duration::from_secs(10))
    }

    #[test]
    fn time_is_left_where_the_total_is_known() {
        assert_eq!(text(Total::Exact, 200), "200 of 400 cells, 20 per second, 10 s left");
        assert_eq!(text(Total::AtLeast, 200), "200 of at least 400 cells, 20 per second");
        assert_eq!(text(Total::AtLeast, 400), "400 of at least 400 cells");
    }

    #[test]
    fn rates_have_no_more_digits_than_they_mean() {
        assert_eq!([7816.8616, 12.5, 3.31, 0.0].map(rate), ["7817", "12", "3.3", "0.0"]);
    }

    #[test]
    fn templates_can_be_read() {
        for total in [Total::Exact, Total::AtLeast] {
            assert!(ProgressStyle::with_template(&template(total, "cells")).is_ok());
        }
    }
}
