//! Results on stdout.

use std::io::{ErrorKind, Write, stdout};

use crate::store::error::OutputError;
use crate::text::printable;

/// Prints a line, or several, to stdout. What they hold from outside reaches no terminal raw: see [`printable`].
///
/// # Errors
/// If stdout cannot be written, unless its reader has closed it.
pub fn print(text: &str) -> Result<(), OutputError> {
    match writeln!(stdout(), "{}", printable::lines(text.trim_end())) {
        // A reader that has seen enough, `head` say, is no reason to leave the rest undone.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.map_err(OutputError::Stdout),
    }
}
