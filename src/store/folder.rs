//! The output folder. It is checked before a computation, has one writer at a time, and files of an earlier run are only
//! replaced on request.

mod lock;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use thiserror::Error;

use crate::show::error::WriteError;
use crate::store::error::OutputError;
use crate::store::file_names::UNFINISHED;
use crate::store::plain_file::{self, partial, refuse_link};
pub(crate) use lock::LOCK;
use lock::Lock;

/// Why a folder cannot be used.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "`path` is the folder, and `reason` the system's error")]
pub enum FolderError {
    /// A file has the name of the folder.
    #[error("{}: there is a file of this name; choose another folder", .path.display())]
    NotAFolder { path: PathBuf },
    /// The folder contains files.
    #[error(
        "--out {}: the folder is not empty; choose another one with --out, or give --force to replace \
         the files of an earlier run",
        .path.display()
    )]
    NotEmpty { path: PathBuf },
    /// Another command writes into the folder.
    #[error("{}: another run is writing to this folder; wait for it, or choose another one", .path.display())]
    InUse { path: PathBuf },
    /// A file to be written is a symbolic link.
    #[error("{}: {reason}", .path.display())]
    Link { path: PathBuf, reason: io::Error },
    /// The folder cannot be created, read or written.
    #[error("{}: cannot write there ({reason}); choose another folder", .path.display())]
    NotWritable { path: PathBuf, reason: io::Error },
}

/// A folder that can be written. While this value lives, no other command can write into the folder.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Names of the results that were removed.
    removed: Mutex<BTreeSet<String>>,
    /// Time that it took to write each file.
    written: Mutex<BTreeMap<String, Duration>>,
    lock: Lock,
    // Dropped after the lock, whose file is in the folder.
    created: NewFolders,
}

/// Folders that were created for a run, the outermost first. Empty ones are removed in the end.
#[derive(Debug)]
struct NewFolders(Vec<PathBuf>);

impl NewFolders {
    /// Creates a folder and its missing parents.
    fn create(path: &Path) -> io::Result<NewFolders> {
        let is_missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let mut missing: Vec<PathBuf> = path.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        missing.reverse();
        let created = NewFolders(missing);
        fs::create_dir_all(path)?;
        created.0.iter().try_for_each(|folder| plain_file::sync_names(folder))?;
        Ok(created)
    }
}

impl Drop for NewFolders {
    fn drop(&mut self) {
        // The system removes only empty folders.
        let _ = self.0.iter().rev().try_for_each(fs::remove_dir);
    }
}

impl Folder {
    /// Creates the folder if it does not exist and takes its lock. A folder that was created here and stays empty is removed
    /// in the end.
    ///
    /// # Errors
    /// [`FolderError`] if the folder cannot be written, another command writes into it, or it contains files and `force`
    /// is false.
    pub fn open(path: &Path, force: bool) -> Result<Folder, FolderError> {
        let path = path.to_owned();
        if path.exists() && !path.is_dir() {
            return Err(FolderError::NotAFolder { path });
        }
        // If the file of the lock can be written, others can be, too.
        let taken = NewFolders::create(&path).and_then(|created| Ok((Lock::take(&path)?, created)));
        match taken {
            Err(reason) => Err(FolderError::NotWritable { path, reason }),
            Ok((None, _)) => Err(FolderError::InUse { path }),
            Ok((Some(lock), created)) => match is_empty(&path) {
                Err(reason) => Err(FolderError::NotWritable { path, reason }),
                Ok(false) if !force => Err(FolderError::NotEmpty { path }),
                Ok(_) => {
                    Ok(Folder { path, removed: Mutex::default(), written: Mutex::default(), lock, created })
                }
            },
        }
    }

    /// Checks whether a folder exists or can be made, as far as can be known without writing.
    ///
    /// # Errors
    /// [`FolderError::NotAFolder`] and [`FolderError::NotWritable`].
    pub fn check_writable(path: &Path) -> Result<(), FolderError> {
        let own = || path.to_owned();
        if path.exists() && !path.is_dir() {
            return Err(FolderError::NotAFolder { path: own() });
        }
        let absolute = std::path::absolute(path).unwrap_or_else(|_| own());
        let around = absolute.ancestors().find(|folder| folder.exists()).unwrap_or(path);
        match fs::metadata(around) {
            Ok(data) if data.is_dir() && !data.permissions().readonly() => Ok(()),
            Ok(_) => {
                let reason = io::Error::other(format!("{} cannot be written", around.display()));
                Err(FolderError::NotWritable { path: own(), reason })
            }
            Err(reason) => Err(FolderError::NotWritable { path: own(), reason }),
        }
    }

    /// Checks whether a folder can be opened and the files `names` be written there, without creating or locking anything.
    ///
    /// # Errors
    /// As [`Folder::open`] and [`Folder::prepare`], as far as can be known without writing.
    pub fn check(
        path: &Path,
        force: bool,
        names: impl IntoIterator<Item = impl AsRef<str>>,
    ) -> Result<(), FolderError> {
        Folder::check_writable(path)?;
        if Lock::is_held(path) {
            return Err(FolderError::InUse { path: path.to_owned() });
        }
        if !force && path.is_dir() && !is_empty(path).unwrap_or(false) {
            return Err(FolderError::NotEmpty { path: path.to_owned() });
        }
        refuse_links_in(path, names)
    }

    /// Prepares for writing the files `names`: checks that none of them is a symbolic link, and removes the incomplete ones
    /// of a command that was killed.
    ///
    /// # Errors
    /// [`FolderError::Link`] for the first link, [`FolderError::NotWritable`] if a file cannot be removed.
    pub fn prepare(&self, names: impl IntoIterator<Item = impl AsRef<str>>) -> Result<(), FolderError> {
        let names: Vec<_> = names.into_iter().collect();
        refuse_links_in(&self.path, &names)?;
        // The records of a merge have a temporary name while they are gathered, and another one before.
        let mut once = names.iter().map(|name| partial(&self.path.join(name.as_ref())));
        let removed =
            once.try_for_each(|path| plain_file::remove(&partial(&path)).and(plain_file::remove(&path)));
        removed.map_err(|reason| FolderError::NotWritable { path: self.path.clone(), reason })
    }

    /// Whether a folder contains other files than those of a run that was killed before it wrote any result.
    pub fn holds_results(path: &Path) -> bool {
        let is_leftover =
            |entry: &fs::DirEntry| LEFTOVERS.into_iter().any(|leftover| entry.file_name() == leftover);
        fs::read_dir(path).is_ok_and(|entries| entries.flatten().any(|entry| !is_leftover(&entry)))
    }

    /// Returns a function that removes the lock and empty new folders, for a process that ends without dropping this value.
    pub fn leaver(&self) -> impl FnOnce() + Send + use<> {
        let (lock, created) = (self.lock.path().to_owned(), NewFolders(self.created.0.clone()));
        move || {
            let _ = fs::remove_file(lock);
            drop(created);
        }
    }

    /// The path that the user named.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file `name` completely or not at all.
    ///
    /// # Errors
    /// [`OutputError::Write`]: the error of `write` or of the file system, with the file's path.
    pub fn replace(
        &self,
        name: &str,
        write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>,
    ) -> Result<(), OutputError> {
        let clock = Instant::now();
        let path = self.path.join(name);
        let written = plain_file::replace(&path, write);
        if name != UNFINISHED {
            let mut times = self.written.lock().unwrap_or_else(PoisonError::into_inner);
            times.insert(name.to_owned(), clock.elapsed());
        }
        written.map(drop).map_err(|reason| OutputError::Write { path, reason })
    }

    /// Writes `object` as the file `name`, in lines to be read, whole or not at all.
    ///
    /// # Errors
    /// As [`Folder::replace`].
    pub fn write_json(&self, name: &str, object: &impl Serialize) -> Result<(), OutputError> {
        self.replace(name, |out| {
            serde_json::to_writer_pretty(&mut *out, object)?;
            Ok(writeln!(out)?)
        })
    }

    /// Removes those of the files `names` that exist.
    ///
    /// # Errors
    /// [`OutputError::Replace`] if one exists and cannot be removed.
    pub fn remove<N: AsRef<str>>(&self, names: &[N]) -> Result<(), OutputError> {
        for name in names {
            let name = name.as_ref();
            let path = self.path.join(name);
            match fs::remove_file(&path) {
                Ok(()) if name == UNFINISHED => {}
                Ok(()) => {
                    let mut removed = self.removed.lock().unwrap_or_else(PoisonError::into_inner);
                    removed.insert(name.to_owned());
                }
                Err(reason) if reason.kind() == io::ErrorKind::NotFound => {}
                Err(reason) => return Err(OutputError::Replace { path, reason }),
            }
        }
        Ok(())
    }

    /// Time that it took to write each file since the folder was opened. Files are written side by side.
    pub fn writing_times(&self) -> BTreeMap<String, Duration> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Names of the results that were removed since the folder was opened, and not written again.
    pub fn removed(&self) -> Vec<String> {
        let removed = self.removed.lock().unwrap_or_else(PoisonError::into_inner);
        removed.iter().filter(|name| !self.path.join(name).exists()).cloned().collect()
    }
}

fn refuse_links_in(
    folder: &Path,
    names: impl IntoIterator<Item = impl AsRef<str>>,
) -> Result<(), FolderError> {
    let checked = names.into_iter().try_for_each(|name| refuse_link(&folder.join(name.as_ref())));
    checked.map_err(|reason| FolderError::Link { path: folder.to_owned(), reason })
}

/// Files that a run leaves if it is killed before it has written any result.
const LEFTOVERS: [&str; 4] =
    [LOCK, "partial-records.bin", "partial-partial-records.bin", "partial-unfinished.json"];

/// Whether a folder contains nothing but its lock.
fn is_empty(path: &Path) -> io::Result<bool> {
    for entry in fs::read_dir(path)? {
        if entry?.file_name() != LOCK {
            return Ok(false);
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: [&str; 0] = [];

    #[test]
    fn full_folders_need_force() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b");
        let folder = Folder::open(&path, false).unwrap();
        folder.replace("x.txt", |out| Ok(out.write_all(b"one")?)).unwrap();
        drop(folder);
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1, "the lock is gone");
        assert!(matches!(Folder::open(&path, false), Err(FolderError::NotEmpty { .. })));
        let folder = Folder::open(&path, true).unwrap();
        folder.remove(&["x.txt", "absent.txt"]).unwrap();
        assert_eq!(folder.removed(), ["x.txt"]);
        drop(folder);
        Folder::open(&path, false).unwrap();
    }

    #[test]
    fn empty_new_folders_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let [outer, inner] = ["a", "a/b/c"].map(|name| root.path().join(name));
        drop(Folder::open(&inner, false).unwrap());
        assert!(!outer.exists());
        fs::create_dir(&outer).unwrap();
        drop(Folder::open(&inner, false).unwrap());
        assert_eq!(fs::read_dir(&outer).unwrap().count(), 0, "what was there before stays");
        let folder = Folder::open(&inner, false).unwrap();
        fs::write(root.path().join("a/b/x"), "").unwrap();
        drop(folder);
        assert!(root.path().join("a/b/x").exists() && !inner.exists());
    }

    #[test]
    fn a_process_that_drops_nothing_can_remove_the_lock_and_new_folders() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(&root.path().join("a/b"), false).unwrap();
        let leave = folder.leaver();
        std::mem::forget(folder);
        leave();
        assert!(!root.path().join("a").exists());
        fs::write(root.path().join("x"), "").unwrap();
        let folder = Folder::open(root.path(), true).unwrap();
        folder.leaver()();
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1, "what was there before stays");
    }

    #[test]
    fn files_in_the_way_are_refused() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(matches!(Folder::open(&file, true), Err(FolderError::NotAFolder { .. })));
        assert!(matches!(Folder::open(&file.join("below"), true), Err(FolderError::NotWritable { .. })));
    }

    /// Several threads open and close the folder at the same time.
    #[test]
    fn a_folder_has_one_writer_at_a_time() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), false).unwrap();
        assert!(matches!(Folder::open(root.path(), true), Err(FolderError::InUse { .. })));
        drop(folder);
        let inside = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            let work = || {
                let held = || {
                    Folder::open(root.path(), true).ok().map(|_held| {
                        let others = inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                        std::thread::yield_now();
                        inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                        assert_eq!(others, 0, "two writers");
                    })
                };
                // Each thread has its turn 30 times; most attempts in between find another writer.
                std::iter::repeat_with(held).flatten().take(30).for_each(drop);
            };
            (0..4).for_each(|_| drop(scope.spawn(work)));
        });
        // The file that a killed process leaves is not locked.
        fs::write(root.path().join(LOCK), "").unwrap();
        Folder::open(root.path(), false).unwrap();
    }

    #[test]
    fn checking_a_folder_reports_the_same_and_writes_nothing() {
        let root = tempfile::tempdir().unwrap();
        let [new, file] = ["a/b", "file"].map(|name| root.path().join(name));
        Folder::check(&new, false, ["x.txt"]).unwrap();
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
        fs::write(&file, "").unwrap();
        assert!(matches!(Folder::check(&file, true, NONE), Err(FolderError::NotAFolder { .. })));
        assert!(matches!(Folder::check(&file.join("x"), true, NONE), Err(FolderError::NotWritable { .. })));
        assert!(matches!(Folder::check(root.path(), false, NONE), Err(FolderError::NotEmpty { .. })));
        Folder::check(root.path(), true, ["file"]).unwrap();
        let folder = Folder::open(&new, false).unwrap();
        assert!(matches!(Folder::check(&new, true, NONE), Err(FolderError::InUse { .. })));
        drop(folder);
        fs::create_dir_all(new.join("x.txt")).unwrap();
        assert!(matches!(Folder::check(&new, true, ["x.txt"]), Err(FolderError::Link { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_a_symbolic_link() {
        let root = tempfile::tempdir().unwrap();
        let [inside, outside] = ["inside", "outside"].map(|name| root.path().join(name));
        fs::write(&outside, "precious").unwrap();
        fs::create_dir(&inside).unwrap();
        for name in ["x.txt", "partial-x.txt", LOCK] {
            let link = inside.join(name);
            std::os::unix::fs::symlink(&outside, &link).unwrap();
            let failed = match Folder::open(&inside, true) {
                Ok(folder) => {
                    let named = folder.prepare(["x.txt"]).unwrap_err().to_string();
                    assert!(named.contains(&format!("{name} is a symbolic link")), "{named}");
                    folder.replace("x.txt", |out| Ok(out.write_all(b"one")?)).unwrap_err().to_string()
                }
                Err(error) => error.to_string(),
            };
            assert!(failed.contains(&format!("{name} is a symbolic link")), "{failed}");
            assert!(link.is_symlink() && fs::read_to_string(&outside).unwrap() == "precious", "{name}");
            fs::remove_file(link).unwrap();
        }
        // Opening a pipe would block.
        let pipe = inside.join("x.txt");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let folder = Folder::open(&inside, true).unwrap();
        let named = folder.prepare(["x.txt"]).unwrap_err().to_string();
        assert!(named.contains("x.txt is no plain file"), "{named}");
        drop(folder);
        fs::remove_file(pipe).unwrap();
        // The folder itself may be one.
        let link = root.path().join("link");
        std::os::unix::fs::symlink(&inside, &link).unwrap();
        Folder::open(&link, false).unwrap().replace("x.txt", |out| Ok(out.write_all(b"one")?)).unwrap();
        assert_eq!(fs::read_to_string(inside.join("x.txt")).unwrap(), "one");
    }

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), false).unwrap();
        folder.replace("x.txt", |out| Ok(out.write_all(b"one")?)).unwrap();
        let failed = folder.replace("x.txt", |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("disk full").into())
        });
        assert!(failed.unwrap_err().to_string().contains("x.txt: disk full"));
        assert_eq!(fs::read_to_string(root.path().join("x.txt")).unwrap(), "one");
        drop(folder);
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
