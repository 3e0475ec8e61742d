//! Prints results to stdout.

use std::io::{ErrorKind, Write, stdout};

use serde::Serialize;

use crate::job::error::Failure;
use crate::text::printable;
use anyhow::{Context, anyhow};

/// Prints lines to stdout. Characters that a terminal would interpret are escaped: see [`printable`].
///
/// # Errors
/// If stdout cannot be written. A reader that has closed it, such as `head`, is no error.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    match writeln!(stdout(), "{}", printable::lines(text.trim_end())) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|error| Failure::Run(anyhow!("cannot write to stdout: {error}"))),
    }
}

/// Prints an object as JSON.
///
/// # Errors
/// As [`print`], or if the object cannot be put into JSON.
pub(crate) fn print_json(object: &impl Serialize) -> Result<(), Failure> {
    print(&serde_json::to_string_pretty(object).context("cannot put the result into JSON")?)
}
