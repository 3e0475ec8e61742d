//! Plain files: written whole or not at all, never through links, and read up to a bound.

use std::borrow::Cow;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufWriter, IntoInnerError, Read};
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

/// Refuses to write to anything but a plain file, also under its temporary name: a symbolic link may point anywhere, and
/// opening a pipe blocks.
pub(crate) fn refuse_link(path: &Path) -> io::Result<()> {
    for path in [path, &partial(path)] {
        let name = name_of(path);
        let why = match fs::symlink_metadata(path) {
            Ok(data) if data.is_symlink() => {
                "is a symbolic link, and no file is written through one; remove it"
            }
            Ok(data) if !data.is_file() => "is no plain file; remove it",
            _ => continue,
        };
        return Err(io::Error::other(format!("{name} {why}")));
    }
    Ok(())
}

/// Writes a file completely or not at all: `write` writes to a temporary file, which gets the name when all of it is on the
/// disk. Returns the file, open for reading and writing.
///
/// # Errors
/// The error of `write` or of the file system.
pub(crate) fn replace<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<File, E> {
    refuse_link(path)?;
    let partial = partial(path);
    // A command that was killed may have left one.
    remove(&partial)?;
    // A new file is neither a link nor a pipe that has been put there since the check.
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(&partial)?;
    let whole = || {
        let mut out = BufWriter::new(file);
        write(&mut out)?;
        let file = out.into_inner().map_err(IntoInnerError::into_error)?;
        // Without this, a power cut after renaming could leave an empty file.
        file.sync_all()?;
        rename(&partial, path)?;
        Ok(file)
    };
    let written = whole();
    if written.is_err() {
        // Best effort: the error that matters is the one already at hand.
        let _ = fs::remove_file(&partial);
    }
    written
}

/// Renames a file of a folder. The new name is on the disk.
pub(crate) fn rename(from: &Path, to: &Path) -> io::Result<()> {
    fs::rename(from, to)?;
    sync_names(to)
}

/// Waits until the names in the folder of a file are on the disk. Without this, a power cut could undo renaming and creating.
pub(crate) fn sync_names(file: &Path) -> io::Result<()> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    // Windows opens no folder, and some network disks sync none.
    let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) else { return Ok(()) };
    folder
        .sync_all()
        .or_else(|reason| if reason.kind() == io::ErrorKind::InvalidInput { Ok(()) } else { Err(reason) })
}

/// Removes a file if it exists.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(reason) if reason.kind() != io::ErrorKind::NotFound => Err(reason),
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
