//! Messages to the user. A closed stderr ends no run.

use std::fmt::Display;
use std::io::{Write, stderr};
use std::path::Path;

use crate::map::printable;

/// Says a line, or several, on stderr. Where that is closed or full they are dropped: nobody would read them, and the
/// run goes on. What they hold from outside reaches no terminal raw: see [`printable`].
pub fn note(line: impl Display) {
    let text = format!("{line}\n");
    // One write, lest lines of several threads mix.
    let _ = stderr().write_all(printable::lines(&text).as_bytes());
}

/// A path within a message of several lines, on one of them.
pub(crate) fn path(path: &Path) -> String {
    printable::line(&path.display().to_string()).into_owned()
}
