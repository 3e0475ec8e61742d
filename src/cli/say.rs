//! Prints messages on stderr. Characters that a terminal would interpret are escaped.

use std::fmt::Display;
use std::io::{Write, stderr};
use std::path::Path;

use crate::store::folder::Folder;
use crate::text::printable;
use rattlemap_dynamics::orbit::Class;

/// Prints a line on stderr; line feeds in it are escaped. If stderr is closed or full, the line is dropped and the run
/// continues.
pub fn note(line: impl Display) {
    write(&printable::line(&line.to_string()));
}

/// Prints several lines on stderr. Text from outside must have passed [`path`] or [`quoted`].
pub(crate) fn notes(lines: impl Display) {
    write(&printable::lines(&lines.to_string()));
}

/// Names the results of an earlier run that a command has removed. Nothing is printed if there are none.
pub(crate) fn removed(folder: &Folder) {
    let removed = folder.removed();
    if !removed.is_empty() {
        note(format_args!(
            "{}: removed files of an earlier run: {}",
            folder.path().display(),
            removed.join(", ")
        ));
    }
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

/// Lists the numbers of cells of each class. Quasi-periodic motion is listed only where it occurs.
pub(crate) fn classes([periodic, chaotic, undecided, failed, tori]: [usize; Class::NAMES.len()]) -> String {
    let tori = if tori > 0 { format!("{tori} quasi-periodic, ") } else { String::new() };
    format!("{periodic} periodic, {chaotic} chaotic, {tori}{undecided} undecided, {failed} failed")
}
