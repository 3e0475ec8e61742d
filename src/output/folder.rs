//! The output folder: proved writable before anything is computed, and guarded against
//! overwriting an earlier run by accident.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;
use thiserror::Error;

use super::{OutputError, WriteError};

/// Why a folder cannot be used.
#[derive(Debug, Error)]
pub enum FolderError {
    /// Something other than a folder has the name.
    #[error("--out {}: there is a file of this name; choose another folder with --out", .path.display())]
    NotAFolder {
        /// The folder asked for.
        path: PathBuf,
    },
    /// The folder holds files already.
    #[error(
        "--out {}: the folder is not empty; choose another one with --out, or give --force to replace \
         the files of an earlier run",
        .path.display()
    )]
    NotEmpty {
        /// The folder asked for.
        path: PathBuf,
    },
    /// The folder cannot be made, read or written.
    #[error("--out {}: cannot write there ({reason}); choose another folder with --out", .path.display())]
    NotWritable {
        /// The folder asked for.
        path: PathBuf,
        /// The operating system's words.
        reason: io::Error,
    },
}

/// A folder that exists and can be written.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Makes the folder if need be and writes a probe file into it.
    ///
    /// # Errors
    /// [`FolderError`] if it cannot be written, or has something in it and `force` is not set.
    pub fn open(path: &Path, force: bool) -> Result<Folder, FolderError> {
        let path = path.to_owned();
        if path.exists() && !path.is_dir() {
            return Err(FolderError::NotAFolder { path });
        }
        match prepare(&path) {
            Err(reason) => Err(FolderError::NotWritable { path, reason }),
            Ok(Contents::Something) if !force => Err(FolderError::NotEmpty { path }),
            Ok(_) => match probe(&path) {
                Err(reason) => Err(FolderError::NotWritable { path, reason }),
                Ok(()) => Ok(Folder { path }),
            },
        }
    }

    /// Whether a folder has anything in it but what a run leaves that was killed before it kept anything.
    pub fn holds_results(path: &Path) -> bool {
        let is_leftover =
            |entry: &fs::DirEntry| LEFTOVERS.into_iter().any(|leftover| entry.file_name() == leftover);
        fs::read_dir(path).is_ok_and(|entries| entries.flatten().any(|entry| !is_leftover(&entry)))
    }

    /// Where it is, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file `name` whole or not at all: `write` gets a temporary name of the same
    /// extension, which is renamed once it has succeeded.
    ///
    /// # Errors
    /// [`OutputError::Write`]: whatever `write` or the file system says, with the file's path.
    pub fn replace(
        &self,
        name: &str,
        write: impl FnOnce(&Path) -> Result<(), WriteError>,
    ) -> Result<(), OutputError> {
        let target = self.path.join(name);
        let partial = partial(&target);
        let links = refuse_link(&target).and_then(|()| refuse_link(&partial));
        if let Err(reason) = links {
            return Err(OutputError::Write { path: target, reason: reason.into() });
        }
        let written = write(&partial).and_then(|()| Ok(fs::rename(&partial, &target)?));
        if written.is_err() {
            // Best effort: the error that matters is the one already at hand.
            let _ = fs::remove_file(&partial);
        }
        written.map_err(|reason| OutputError::Write { path: target, reason })
    }

    /// Writes `object` as the file `name`, in lines to be read, whole or not at all.
    ///
    /// # Errors
    /// As [`Folder::replace`].
    pub fn write_json(&self, name: &str, object: &impl Serialize) -> Result<(), OutputError> {
        self.replace(name, |path| Ok(fs::write(path, serde_json::to_string_pretty(object)? + "\n")?))
    }

    /// Removes the files `names` of an earlier run, as far as they exist.
    ///
    /// # Errors
    /// [`OutputError::Replace`] if one exists and cannot be removed.
    pub fn remove(&self, names: &[&str]) -> Result<(), OutputError> {
        for name in names {
            let path = self.path.join(name);
            match fs::remove_file(&path) {
                Err(reason) if reason.kind() != io::ErrorKind::NotFound => {
                    return Err(OutputError::Replace { path, reason });
                }
                _ => {}
            }
        }
        Ok(())
    }
}

const PROBE: &str = ".rattlemap-probe";

/// What a run that was killed at once may leave in a folder: nothing of value.
const LEFTOVERS: [&str; 3] = [PROBE, "partial-records.bin", "partial-unfinished.json"];

enum Contents {
    Nothing,
    Something,
}

/// The name under which a file is written before it is whole.
pub(super) fn partial(path: &Path) -> PathBuf {
    path.with_file_name(format!("partial-{}", path.file_name().unwrap_or_default().to_string_lossy()))
}

/// Refuses to write a file through a symbolic link, to wherever that may point.
pub(super) fn refuse_link(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Ok(data) if data.is_symlink() => {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            Err(io::Error::other(format!(
                "{name} is a symbolic link, and no file is written through one; remove it"
            )))
        }
        _ => Ok(()),
    }
}

fn prepare(path: &Path) -> io::Result<Contents> {
    fs::create_dir_all(path)?;
    match fs::read_dir(path)?.next() {
        None => Ok(Contents::Nothing),
        Some(entry) => entry.map(|_| Contents::Something),
    }
}

fn probe(path: &Path) -> io::Result<()> {
    let probe = path.join(PROBE);
    fs::write(&probe, b"")?;
    fs::remove_file(&probe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_folders_need_force() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b");
        let folder = Folder::open(&path, false).unwrap();
        assert_eq!(fs::read_dir(&path).unwrap().count(), 0, "the probe is gone");
        folder.replace("x.txt", |at| Ok(fs::write(at, "one")?)).unwrap();
        assert!(matches!(Folder::open(&path, false), Err(FolderError::NotEmpty { .. })));
        Folder::open(&path, true).unwrap().remove(&["x.txt", "absent.txt"]).unwrap();
        Folder::open(&path, false).unwrap();
    }

    #[test]
    fn files_in_the_way_are_refused() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(matches!(Folder::open(&file, true), Err(FolderError::NotAFolder { .. })));
        assert!(matches!(Folder::open(&file.join("below"), true), Err(FolderError::NotWritable { .. })));
    }

    #[test]
    fn failed_writes_leave_what_was_there() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), false).unwrap();
        folder.replace("x.txt", |at| Ok(fs::write(at, "one")?)).unwrap();
        let failed = folder.replace("x.txt", |at| {
            fs::write(at, "half")?;
            Err(io::Error::other("disk full").into())
        });
        assert!(failed.unwrap_err().to_string().contains("x.txt: disk full"));
        assert_eq!(fs::read_to_string(root.path().join("x.txt")).unwrap(), "one");
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
