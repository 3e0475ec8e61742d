//! `records.bin`: what a killed run leaves and the next one goes on from.
//!
//! A header identifies the run. Batches follow, appended as cells end, each with its checksum. All numbers are little-endian:
//!
//! ```text
//! magic "RTLMAP\0\x02"   length u32   crc32 u32   identity (JSON)
//! then per batch: cells before it u64   cells u32   crc32 u32 (over all else)   ids u32 each   records
//! ```
//!
//! A run that is killed while it writes leaves a torn last batch. A disk may do worse, anywhere.
//! Batches are good up to the first one that is not; what follows is cut off and computed again.

mod reader;

use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use fs4::fs_std::FileExt;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use reader::{Damage, Extent};

use crate::record::{RECORD_VERSION, Record};
use reader::Reader;

/// Its name in a map's folder.
pub const RECORDS: &str = "records.bin";

const MAGIC: [u8; 8] = *b"RTLMAP\0\x02";
const BATCH_HEAD: usize = 16;
const RECORD: usize = size_of::<Record>();
const ID: usize = size_of::<u32>();

const _: () = assert!(cfg!(target_endian = "little"), "records are written as they lie in memory");

/// Why a run cannot go on from a file.
#[derive(Debug, Error)]
pub enum RecordFileError {
    /// There is no record file in a folder that holds other things.
    #[error("--resume: there is no {RECORDS} in {}; leave --resume out, or name the folder of an interrupted run with --out", .folder.display())]
    NothingToResume {
        /// The folder.
        folder: PathBuf,
    },
    /// The records answer another question.
    #[error("--resume: {} holds another run: {differences}; ask for the same again, or start anew with --force", .path.display())]
    OtherRun {
        /// The file.
        path: PathBuf,
        /// What differs, with both values.
        differences: String,
    },
    /// It does not say whose records it holds, or holds what no run of this version asks for.
    #[error("--resume: {} is damaged at byte {at}: {what}; start anew with --force", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        at: u64,
        /// What is wrong there.
        what: &'static str,
    },
    /// Another run is writing it.
    #[error("{}: another run is writing to this folder; wait for it, or choose another one with --out", .path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The operating system will not have it.
    #[error("{}: {reason}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's words.
        reason: io::Error,
    },
}

/// Whose records a file holds: they may be continued by the same alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    record_version: u32,
    crate_version: String,
    engine: String,
    precision: String,
    device: String,
    scene: Vec<(String, String)>,
}

impl Identity {
    /// The identity of a run of this version of the crate.
    pub fn new(engine: &str, precision: &str, device: &str, scene: Vec<(String, String)>) -> Identity {
        Identity {
            record_version: RECORD_VERSION,
            crate_version: env!("CARGO_PKG_VERSION").to_owned(),
            engine: engine.to_owned(),
            precision: precision.to_owned(),
            device: device.to_owned(),
            scene,
        }
    }

    /// The identity of the run whose records a file holds.
    ///
    /// # Errors
    /// [`RecordFileError`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Identity, RecordFileError> {
        let file =
            File::open(path).map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })?;
        Reader::new(&file, path)?.identity()
    }

    /// The engine's name.
    pub fn engine(&self) -> &str {
        &self.engine
    }

    /// Its precision.
    pub fn precision(&self) -> &str {
        &self.precision
    }

    fn named(&self) -> Vec<(&str, String)> {
        let own = [
            ("record version", self.record_version.to_string()),
            ("rattlemap", self.crate_version.clone()),
            ("engine", self.engine.clone()),
            ("precision", self.precision.clone()),
            ("device", self.device.clone()),
        ];
        own.into_iter().chain(self.scene.iter().map(|(name, value)| (name.as_str(), value.clone()))).collect()
    }

    /// What differs from the identity that is `asked` for, in words; empty if nothing.
    fn differences(&self, asked: &Identity) -> String {
        let (mine, theirs) = (self.named(), asked.named());
        let value = |list: &[(&str, String)], name: &str| {
            list.iter().find(|(n, _)| *n == name).map_or("absent".to_owned(), |(_, value)| value.clone())
        };
        let mut names: Vec<&str> = mine.iter().map(|(name, _)| *name).collect();
        names.extend(theirs.iter().map(|(name, _)| *name).filter(|name| value(&mine, name) == "absent"));
        let differing = names.into_iter().filter(|name| value(&mine, name) != value(&theirs, name));
        let sentence = |name| format!("`{name}` was {}, now {}", value(&mine, name), value(&theirs, name));
        differing.map(sentence).collect::<Vec<_>>().join(", ")
    }
}

/// A record file being written.
#[derive(Debug)]
pub struct RecordFile {
    file: File,
    path: PathBuf,
    count: usize,
    damage: Option<Damage>,
}

impl RecordFile {
    /// Starts a file anew.
    ///
    /// # Errors
    /// [`RecordFileError`] if it cannot be written, or another run is writing it.
    pub fn create(path: &Path, identity: &Identity) -> Result<RecordFile, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        // Not truncated on opening: it may be another run's.
        let options = OpenOptions::new().create(true).truncate(false).write(true).clone();
        let mut file = lock(options.open(path).map_err(io)?, path)?;
        let identity = serde_json::to_vec(identity).map_err(|error| io(error.into()))?;
        let mut head = MAGIC.to_vec();
        head.extend((identity.len() as u32).to_le_bytes());
        head.extend(crc32fast::hash(&identity).to_le_bytes());
        head.extend(identity);
        file.set_len(0).and_then(|()| file.write_all(&head)).and_then(|()| file.sync_all()).map_err(io)?;
        Ok(RecordFile { file, path: path.to_owned(), count: 0, damage: None })
    }

    /// Opens the file of an interrupted run; `take` gets every batch that is good, ids with their
    /// records, and says whether the run asks for them. What follows the first damage is cut off.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file is another run's, has no readable header, is in use or unreadable.
    pub fn resume(
        path: &Path,
        identity: &Identity,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<RecordFile, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let mut file = lock(OpenOptions::new().read(true).write(true).open(path).map_err(io)?, path)?;
        let Extent { count, end, damage } = Reader::open(&file, path, identity)?.batches(take)?;
        file.set_len(end).and_then(|()| file.seek(SeekFrom::End(0))).map_err(io)?;
        Ok(RecordFile { file, path: path.to_owned(), count, damage })
    }

    /// Reads a file and leaves it alone; `take` is as for [`RecordFile::resume`].
    ///
    /// # Errors
    /// [`RecordFileError`] if the file is another run's, has no readable header or is unreadable.
    pub fn read(
        path: &Path,
        identity: &Identity,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Extent, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let file = File::open(path).map_err(io)?;
        Reader::open(&file, path, identity)?.batches(take)
    }

    /// Records that the file holds.
    pub fn count(&self) -> usize {
        self.count
    }

    /// What was cut off when the file was opened, if anything was.
    pub fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Appends the next batch, ids with their records, and sees it onto the disk.
    ///
    /// # Errors
    /// [`RecordFileError::Io`], for instance on a full disk.
    pub fn append(&mut self, batch: &[(u32, Record)]) -> Result<(), RecordFileError> {
        let ids: Vec<u8> = batch.iter().flat_map(|(id, _)| id.to_le_bytes()).collect();
        let records: Vec<Record> = batch.iter().map(|(_, record)| *record).collect();
        let bytes = [&ids, bytemuck::cast_slice(&records)].concat();
        let (before, cells) = ((self.count as u64).to_le_bytes(), (batch.len() as u32).to_le_bytes());
        let sum = checksum(&before, &cells, &bytes).to_le_bytes();
        let head = [&before[..], &cells, &sum].concat();
        self.file
            .write_all(&head)
            .and_then(|()| self.file.write_all(&bytes))
            .and_then(|()| self.file.sync_data())
            .map_err(|reason| RecordFileError::Io { path: self.path.clone(), reason })?;
        self.count += batch.len();
        Ok(())
    }
}

fn lock(file: File, path: &Path) -> Result<File, RecordFileError> {
    match FileExt::try_lock_exclusive(&file) {
        Ok(false) => Err(RecordFileError::InUse { path: path.to_owned() }),
        // Some network disks have no locks; that is no reason not to run there.
        Ok(true) | Err(_) => Ok(file),
    }
}

fn checksum(before: &[u8], cells: &[u8], body: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    [before, cells, body].into_iter().for_each(|part| hasher.update(part));
    hasher.finalize()
}
