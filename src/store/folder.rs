//! The output folder: proved writable before anything is computed, written by one command at a time, and guarded
//! against overwriting an earlier run by accident.

mod lock;

use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;
use thiserror::Error;

use crate::show::error::WriteError;
use crate::store::error::OutputError;
use crate::store::plain_file::{partial, refuse_link};
pub(crate) use lock::LOCK;
use lock::Lock;

/// Why a folder cannot be used.
#[derive(Debug, Error)]
pub enum FolderError {
    /// Something other than a folder has the name.
    #[error("{}: there is a file of this name; choose another folder", .path.display())]
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
    /// Another command has the folder.
    #[error("{}: another run is writing to this folder; wait for it, or choose another one", .path.display())]
    InUse {
        /// The folder asked for.
        path: PathBuf,
    },
    /// A file that is to be written is a symbolic link.
    #[error("{}: {reason}", .path.display())]
    Link {
        /// The folder asked for.
        path: PathBuf,
        /// Which file.
        reason: io::Error,
    },
    /// The folder cannot be made, read or written.
    #[error("{}: cannot write there ({reason}); choose another folder", .path.display())]
    NotWritable {
        /// The folder asked for.
        path: PathBuf,
        /// The operating system's words.
        reason: io::Error,
    },
}

/// A folder that exists and can be written, by nobody else while this lives.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    lock: Lock,
    // Dropped after the lock, whose file lies in it.
    made: Made,
}

/// Folders that were made for a run, outermost first; those that hold nothing in the end go again.
#[derive(Debug)]
struct Made(Vec<PathBuf>);

impl Made {
    /// Makes a folder and those around it.
    fn folders(path: &Path) -> io::Result<Made> {
        let is_missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let mut missing: Vec<PathBuf> = path.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        missing.reverse();
        let made = Made(missing);
        fs::create_dir_all(path).map(|()| made)
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        // The operating system removes no folder that holds anything.
        let _ = self.0.iter().rev().try_for_each(fs::remove_dir);
    }
}

impl Folder {
    /// Makes the folder if need be and takes its lock. A folder that was made here and holds nothing in the end goes
    /// again.
    ///
    /// # Errors
    /// [`FolderError`] if it cannot be written, another command has it, or it has something in it and `force` is not
    /// set.
    pub fn open(path: &Path, force: bool) -> Result<Folder, FolderError> {
        let path = path.to_owned();
        if path.exists() && !path.is_dir() {
            return Err(FolderError::NotAFolder { path });
        }
        // The lock's file shows that others can be written, too.
        let taken = Made::folders(&path).and_then(|made| Ok((Lock::take(&path)?, made)));
        match taken {
            Err(reason) => Err(FolderError::NotWritable { path, reason }),
            Ok((None, _)) => Err(FolderError::InUse { path }),
            Ok((Some(lock), made)) => match is_empty(&path) {
                Err(reason) => Err(FolderError::NotWritable { path, reason }),
                Ok(false) if !force => Err(FolderError::NotEmpty { path }),
                Ok(_) => Ok(Folder { path, lock, made }),
            },
        }
    }

    /// Looks whether a folder can be opened and the files `names` written there, and touches nothing: neither makes it
    /// nor locks it.
    ///
    /// # Errors
    /// As [`Folder::open`] and [`Folder::refuse_links`], as far as it can be seen.
    pub fn check<'n>(
        path: &Path,
        force: bool,
        names: impl IntoIterator<Item = &'n str>,
    ) -> Result<(), FolderError> {
        let own = || path.to_owned();
        if path.exists() && !path.is_dir() {
            return Err(FolderError::NotAFolder { path: own() });
        }
        let absolute = std::path::absolute(path).unwrap_or_else(|_| own());
        let around = absolute.ancestors().find(|folder| folder.exists()).unwrap_or(path);
        match fs::metadata(around) {
            Ok(data) if data.is_dir() && !data.permissions().readonly() => {}
            Ok(_) => {
                let reason = io::Error::other(format!("{} cannot be written", around.display()));
                return Err(FolderError::NotWritable { path: own(), reason });
            }
            Err(reason) => return Err(FolderError::NotWritable { path: own(), reason }),
        }
        if Lock::is_held(path) {
            return Err(FolderError::InUse { path: own() });
        }
        if !force && path.is_dir() && !is_empty(path).unwrap_or(false) {
            return Err(FolderError::NotEmpty { path: own() });
        }
        refuse_links_in(path, names)
    }

    /// Looks whether one of the files `names` is a symbolic link, before there is something to write to it.
    ///
    /// # Errors
    /// [`FolderError::Link`] for the first one.
    pub fn refuse_links<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<(), FolderError> {
        refuse_links_in(&self.path, names)
    }

    /// Whether a folder has anything in it but what a run leaves that was killed before it kept anything.
    pub fn holds_results(path: &Path) -> bool {
        let is_leftover =
            |entry: &fs::DirEntry| LEFTOVERS.into_iter().any(|leftover| entry.file_name() == leftover);
        fs::read_dir(path).is_ok_and(|entries| entries.flatten().any(|entry| !is_leftover(&entry)))
    }

    /// What leaves the folder as it was, as far as nothing was written to it, where the process is about to end without
    /// dropping this.
    pub fn leaver(&self) -> impl FnOnce() + Send + use<> {
        let (lock, made) = (self.lock.path().to_owned(), Made(self.made.0.clone()));
        move || {
            let _ = fs::remove_file(lock);
            drop(made);
        }
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
        // On the disk before it has its name, or a power cut leaves an empty file of that name.
        // Windows wants to see that whoever asks for it may write.
        let synced = || OpenOptions::new().write(true).open(&partial)?.sync_all();
        let whole = || Ok(synced().and_then(|()| fs::rename(&partial, &target))?);
        let written = write(&partial).and_then(|()| whole());
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
    pub fn remove<N: AsRef<str>>(&self, names: &[N]) -> Result<(), OutputError> {
        for name in names {
            let path = self.path.join(name.as_ref());
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

fn refuse_links_in<'n>(folder: &Path, names: impl IntoIterator<Item = &'n str>) -> Result<(), FolderError> {
    let check = |name| {
        let path = folder.join(name);
        refuse_link(&path).and_then(|()| refuse_link(&partial(&path)))
    };
    let checked = names.into_iter().try_for_each(check);
    checked.map_err(|reason| FolderError::Link { path: folder.to_owned(), reason })
}

/// What a run that was killed at once may leave in a folder: nothing of value. Earlier versions left a probe.
const LEFTOVERS: [&str; 4] = [LOCK, ".rattlemap-probe", "partial-records.bin", "partial-unfinished.json"];

/// Whether a folder has nothing in it but its lock.
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

    #[test]
    fn full_folders_need_force() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b");
        let folder = Folder::open(&path, false).unwrap();
        folder.replace("x.txt", |at| Ok(fs::write(at, "one")?)).unwrap();
        drop(folder);
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1, "the lock is gone");
        assert!(matches!(Folder::open(&path, false), Err(FolderError::NotEmpty { .. })));
        Folder::open(&path, true).unwrap().remove(&["x.txt", "absent.txt"]).unwrap();
        Folder::open(&path, false).unwrap();
    }

    #[test]
    fn folders_that_hold_nothing_go_again() {
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

    /// As a process does that ends without dropping anything.
    #[test]
    fn a_folder_can_be_left_as_it_was() {
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

    /// However many try at the same time, while locks come and go.
    #[test]
    fn a_folder_has_one_writer_at_a_time() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), false).unwrap();
        assert!(matches!(Folder::open(root.path(), true), Err(FolderError::InUse { .. })));
        drop(folder);
        let inside = std::sync::atomic::AtomicUsize::new(0);
        let opened: usize = std::thread::scope(|scope| {
            let work = || {
                let held = || {
                    Folder::open(root.path(), true).ok().map(|_held| {
                        let others = inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                        std::thread::yield_now();
                        inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                        assert_eq!(others, 0, "two writers");
                    })
                };
                (0..500).filter_map(|_| held()).count()
            };
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(work)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).sum()
        });
        assert!(opened > 100, "{opened} of 2000");
        // What a killed process leaves is no lock.
        fs::write(root.path().join(LOCK), "").unwrap();
        Folder::open(root.path(), false).unwrap();
    }

    /// It says what opening says, and leaves no trace.
    #[test]
    fn a_folder_is_checked_without_being_touched() {
        let root = tempfile::tempdir().unwrap();
        let [new, file] = ["a/b", "file"].map(|name| root.path().join(name));
        Folder::check(&new, false, ["x.txt"]).unwrap();
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
        fs::write(&file, "").unwrap();
        assert!(matches!(Folder::check(&file, true, []), Err(FolderError::NotAFolder { .. })));
        assert!(matches!(Folder::check(&file.join("x"), true, []), Err(FolderError::NotWritable { .. })));
        assert!(matches!(Folder::check(root.path(), false, []), Err(FolderError::NotEmpty { .. })));
        Folder::check(root.path(), true, ["file"]).unwrap();
        let folder = Folder::open(&new, false).unwrap();
        assert!(matches!(Folder::check(&new, true, []), Err(FolderError::InUse { .. })));
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
                    let named = folder.refuse_links(["x.txt"]).unwrap_err().to_string();
                    assert!(named.contains(&format!("{name} is a symbolic link")), "{named}");
                    folder.replace("x.txt", |at| Ok(fs::write(at, "one")?)).unwrap_err().to_string()
                }
                Err(error) => error.to_string(),
            };
            assert!(failed.contains(&format!("{name} is a symbolic link")), "{failed}");
            assert!(link.is_symlink() && fs::read_to_string(&outside).unwrap() == "precious", "{name}");
            fs::remove_file(link).unwrap();
        }
        // A pipe would be waited for.
        let pipe = inside.join("x.txt");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let folder = Folder::open(&inside, true).unwrap();
        let named = folder.refuse_links(["x.txt"]).unwrap_err().to_string();
        assert!(named.contains("x.txt is no plain file"), "{named}");
        drop(folder);
        fs::remove_file(pipe).unwrap();
        // The folder itself may be one.
        let link = root.path().join("link");
        std::os::unix::fs::symlink(&inside, &link).unwrap();
        Folder::open(&link, false).unwrap().replace("x.txt", |at| Ok(fs::write(at, "one")?)).unwrap();
        assert_eq!(fs::read_to_string(inside.join("x.txt")).unwrap(), "one");
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
        drop(folder);
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
