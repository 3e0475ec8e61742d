//! Messages to the user. A closed stderr ends no run, and nothing from outside reaches a terminal raw.

use std::fmt::Display;
use std::io::{Write, stderr};
use std::path::Path;

use crate::text::printable;

/// Says a line on stderr, one whatever it quotes. Where stderr is closed or full it is dropped: nobody would read it,
/// and the run goes on.
pub fn note(line: impl Display) {
    write(&printable::line(&line.to_string()));
}

/// Says several lines; what they quote must be on one line each, as [`path`] makes it.
pub(crate) fn notes(lines: impl Display) {
    write(&printable::lines(&lines.to_string()));
}

fn write(text: &str) {
    // One write, lest lines of several threads mix.
    let _ = stderr().write_all(format!("{text}\n").as_bytes());
}

/// A path within a message of several lines, on one of them.
pub(crate) fn path(path: &Path) -> String {
    quoted(path.display())
}

/// The same of anything from outside.
pub(crate) fn quoted(text: impl Display) -> String {
    printable::line(&text.to_string()).into_owned()
}
