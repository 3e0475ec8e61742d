//! Messages to the user. A closed stderr ends no run.

use std::fmt::Display;
use std::io::{Write, stderr};

/// Says a line on stderr. Where that is closed or full the line is dropped: nobody would read it, and the run goes on.
pub fn note(line: impl Display) {
    // One write, lest lines of several threads mix.
    let _ = stderr().write_all(format!("{line}\n").as_bytes());
}
