//! What is said to the user: one place that outlives whoever listens.

use std::fmt::Display;
use std::io::{Write, stderr};

/// Says a line on stderr. Where that is closed or full the line is dropped: nobody would read it, and the run goes on.
pub(crate) fn note(line: impl Display) {
    // One write, lest lines of several threads mix.
    let _ = stderr().write_all(format!("{line}\n").as_bytes());
}
