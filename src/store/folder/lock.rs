//! The lock of a folder: a file that the operating system locks while its process lives.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use fs4::fs_std::FileExt;
use same_file::Handle;

use crate::store::plain_file::{self, refuse_link};

/// Name of the file. After a kill it exists, but is not locked.
pub(crate) const LOCK: &str = ".rattlemap.lock";

/// Largest number of attempts to lock a file that other processes remove meanwhile.
const TRIES: usize = 100;

/// A lock, released when it is dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    /// Takes the lock of a folder; returns none if another process has it.
    pub(crate) fn take(folder: &Path) -> io::Result<Option<Lock>> {
        let path = folder.join(LOCK);
        refuse_link(&path)?;
        for _ in 0..TRIES {
            let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path)?;
            // On network disks without locks the folder is used without one.
            let has_locks = match FileExt::try_lock_exclusive(&file) {
                Ok(false) => return Ok(None),
                Ok(true) => true,
                Err(_) => false,
            };
            // Another process may have removed the file and created a new one.
            if !has_locks || is_at(&file, &path)? {
                return Ok(Some(Lock { path, _file: file }));
            }
        }
        Ok(None)
    }
}

impl Lock {
    /// Whether another process has the lock of a folder; creates no file.
    pub(crate) fn is_held(folder: &Path) -> bool {
        let file = plain_file::open(&folder.join(LOCK), OpenOptions::new().write(true));
        file.is_ok_and(|file| matches!(FileExt::try_lock_exclusive(&file), Ok(false)))
    }

    /// Path of the file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // An error is ignored: a file that is not locked does no harm.
        let _ = fs::remove_file(&self.path);
    }
}

/// Whether a path still names this open file.
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    match Handle::from_path(path) {
        Ok(named) => Ok(named == Handle::from_file(file.try_clone()?)?),
        Err(reason) if reason.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(reason) => Err(reason),
    }
}
