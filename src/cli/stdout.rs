//! Prints results to stdout.

use std::io::{ErrorKind, Write, stdout};

use serde::Serialize;

use crate::cli::failure::Failure;
use crate::text::printable;
use anyhow::{Context, anyhow};

/// Prints lines to stdout. Characters that a terminal would interpret are escaped: see [`printable`].
///
/// # Errors
/// If stdout cannot be written. It is no error if a reader such as `head` has closed it.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    match writeln!(stdout(), "{}", printable::lines(text.trim_end())) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(|error| Failure::Run(anyhow!("cannot write to stdout: {error}"))),
    }
}

/// Prints an object as JSON.
///
/// # Errors
/// If stdout cannot be written, or the object cannot be converted to JSON.
pub(crate) fn print_json(object: &impl Serialize) -> Result<(), Failure> {
    print(&serde_json::to_string_pretty(object).context("cannot convert the result to JSON")?)
}
