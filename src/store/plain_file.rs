//! Plain files: temporary names, no writing through links, and bounded reading.

use std::borrow::Cow;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::text::size::bytes;

/// Prefix of the name under which a file is written until it is complete.
pub(crate) const PARTIAL: &str = "partial-";

/// Returns the name under which a file is written until it is complete.
pub(crate) fn partial(path: &Path) -> PathBuf {
    path.with_file_name(format!("{PARTIAL}{}", name_of(path)))
}

/// Refuses to write to anything but a plain file: a symbolic link may point anywhere, and opening a pipe blocks.
pub(crate) fn refuse_link(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Ok(data) if data.is_symlink() => Err(io::Error::other(format!(
            "{} is a symbolic link, and no file is written through one; remove it",
            name_of(path)
        ))),
        Ok(data) if !data.is_file() => {
            Err(io::Error::other(format!("{} is no plain file; remove it", name_of(path))))
        }
        _ => Ok(()),
    }
}

/// Reads a text of at most `most` bytes; `remedy` ends the message about a longer one.
///
/// # Errors
/// If the file is not a regular file, is longer, or cannot be read.
pub(crate) fn read_text(path: &Path, most: u64, remedy: &str) -> io::Result<String> {
    let data = fs::metadata(path)?;
    if !data.is_file() {
        return Err(io::Error::other("it is no regular file"));
    }
    if data.len() > most {
        let (size, most) = (bytes(data.len()), bytes(most));
        return Err(io::Error::other(format!("it has {size}, and at most {most} are read: {remedy}")));
    }
    fs::read_to_string(path)
}

fn name_of(path: &Path) -> Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}
