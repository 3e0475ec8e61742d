//! The console that prints the reports of a job on stderr.

use std::sync::OnceLock;

use crate::cli::progress::Progress;
use crate::cli::say::{note, notes};
use crate::job::observer::Observer;

/// Prints the reports of a job on stderr.
pub(crate) struct Console {
    quiet: bool,
    /// Unit of progress.
    unit: &'static str,
    /// Whether the total can grow.
    grows: bool,
    progress: OnceLock<Progress>,
}

impl Console {
    /// Returns a console. If `quiet`, it prints only warnings.
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
        let start = || Progress::of(expected, done, self.unit, self.quiet, self.grows);
        self.progress.get_or_init(start).report(done, expected);
    }
}
