//! Plain files: temporary names, no writing through links, and bounded reading.

use std::borrow::Cow;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Read};
#[cfg(unix)]
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use crate::text::size::bytes;

/// Prefix of the name under which a file is written until it is complete.
const PARTIAL: &str = "partial-";

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
    let file = open(path, OpenOptions::new().read(true))?;
    let length = file.metadata()?.len();
    if length > most {
        let (size, most) = (bytes(length), bytes(most));
        return Err(io::Error::other(format!("it has {size}, and at most {most} are read: {remedy}")));
    }
    let mut text = String::new();
    file.take(most).read_to_string(&mut text)?;
    Ok(text)
}

/// Opens a regular file. A pipe or a device in its place is refused at once, also behind a link.
///
/// # Errors
/// If the file is not a regular file or cannot be opened.
pub(crate) fn open(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    // Opening a device can already act on it.
    require_regular(&fs::metadata(path)?)?;
    // Without this flag, opening a pipe waits for its other end. The file may have become one since the line above.
    #[cfg(unix)]
    options.custom_flags(libc::O_NONBLOCK);
    let file = options.open(path)?;
    require_regular(&file.metadata()?)?;
    Ok(file)
}

fn require_regular(data: &Metadata) -> io::Result<()> {
    if data.is_file() { Ok(()) } else { Err(io::Error::other("it is no regular file")) }
}

fn name_of(path: &Path) -> Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}
