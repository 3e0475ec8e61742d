//! One writer at a time: a file in the folder that the operating system locks for as long as its process lives.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use fs4::fs_std::FileExt;
use same_file::Handle;

use crate::store::plain_file::refuse_link;

/// Its name. It is there while a folder is written, and after a kill; then nobody holds it.
pub(crate) const LOCK: &str = ".rattlemap.lock";

/// How often a lock is tried for whose file goes away under it.
const TRIES: usize = 100;

/// A lock that is held until it is dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    /// Takes the lock of a folder; none if somebody else holds it.
    pub(crate) fn take(folder: &Path) -> io::Result<Option<Lock>> {
        let path = folder.join(LOCK);
        refuse_link(&path)?;
        for _ in 0..TRIES {
            let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path)?;
            // Some network disks have no locks; that is no reason not to run there.
            let has_locks = match FileExt::try_lock_exclusive(&file) {
                Ok(false) => return Ok(None),
                Ok(true) => true,
                Err(_) => false,
            };
            // Who held it before has removed the file, and somebody may have made another.
            if !has_locks || is_at(&file, &path)? {
                return Ok(Some(Lock { path, _file: file }));
            }
        }
        Ok(None)
    }
}

impl Lock {
    /// Whether somebody holds the lock of a folder; takes none that lasts, and makes no file.
    pub(crate) fn is_held(folder: &Path) -> bool {
        let file = OpenOptions::new().write(true).open(folder.join(LOCK));
        file.is_ok_and(|file| matches!(FileExt::try_lock_exclusive(&file), Ok(false)))
    }

    /// Its file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // A file that stays is in nobody's way.
        let _ = fs::remove_file(&self.path);
    }
}

/// Whether a file is still the one of its name.
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    match Handle::from_path(path) {
        Ok(named) => Ok(named == Handle::from_file(file.try_clone()?)?),
        Err(reason) if reason.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(reason) => Err(reason),
    }
}
