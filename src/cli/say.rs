//! Prints messages on stderr. Characters that a terminal would interpret are escaped.

use std::fmt::Display;
use std::io::{Write, stderr};
use std::path::Path;
use std::sync::OnceLock;

use crate::cli::progress::Progress;
use crate::job::observer::Observer;
use crate::text::printable;

/// Prints a line on stderr; line feeds in it are escaped. If stderr is closed or full, the line is dropped and the run
/// continues.
pub fn note(line: impl Display) {
    write(&printable::line(&line.to_string()));
}

/// Prints several lines on stderr. Text from outside must have passed [`path`] or [`quoted`].
pub(crate) fn notes(lines: impl Display) {
    write(&printable::lines(&lines.to_string()));
}

fn write(text: &str) {
    // One call, so that lines of several threads do not mix.
    let _ = stderr().write_all(format!("{text}\n").as_bytes());
}

/// Escapes a path for a message of several lines.
pub(crate) fn path(path: &Path) -> String {
    quoted(path.display())
}

/// Escapes text from outside for a message of several lines.
pub(crate) fn quoted(text: impl Display) -> String {
    printable::line(&text.to_string()).into_owned()
}

/// Prints the reports of a job on stderr.
pub(crate) struct Console {
    quiet: bool,
    /// What progress counts.
    unit: &'static str,
    /// Whether the total can grow.
    grows: bool,
    progress: OnceLock<Progress>,
}

impl Console {
    /// Returns a console that prints nothing but warnings if it is quiet.
    pub(crate) fn new(quiet: bool, unit: &'static str, grows: bool) -> Console {
        Console { quiet, unit, grows, progress: OnceLock::new() }
    }

    /// Removes the progress bar, and prints lines unless the console is quiet.
    pub(crate) fn finish(&self, lines: &str) {
        match self.progress.get() {
            Some(progress) => progress.finish(lines),
            None if !self.quiet => notes(lines),
            None => {}
        }
    }
}

impl Observer for Console {
    fn note(&self, text: &str) {
        if !self.quiet {
            note(text);
        }
    }

    fn warn(&self, text: &str) {
        note(format_args!("warning: {text}"));
    }

    fn progress(&self, done: usize, expected: usize) {
        let start = || match self.grows {
            true => Progress::of_at_least(expected, done, self.unit, self.quiet),
            false => Progress::new(expected, done, self.unit, self.quiet),
        };
        self.progress.get_or_init(start).report(done, expected);
    }
}
