//! `records.bin`: what a killed run leaves and the next one goes on from.
//!
//! A header that says whose records these are, then batches, appended one by one as cells end,
//! each with its checksum. All numbers are little-endian:
//!
//! ```text
//! magic "RTLMAP\0\x02"   length u32   crc32 u32   identity (JSON)
//! then per batch: cells before it u64   cells u32   crc32 u32 (over all else)   ids u32 each   records
//! ```
//!
//! A run that is killed while it writes leaves a torn last batch; it is cut off and
//! computed again.

use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use fs4::fs_std::FileExt;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::record::{RECORD_VERSION, Record};

/// Its name in a map's folder.
pub const RECORDS: &str = "records.bin";

const MAGIC: [u8; 8] = *b"RTLMAP\0\x02";
const BATCH_HEAD: usize = 16;
const RECORD: usize = size_of::<Record>();
const ID: usize = size_of::<u32>();
/// Batches above this are no batches of ours.
const MOST_CELLS: u32 = 1 << 24;

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
    /// The file cannot be trusted.
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
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        Reader { input: BufReader::new(&file), path, at: 0, length }.identity()
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
        Ok(RecordFile { file, path: path.to_owned(), count: 0 })
    }

    /// Opens the file of an interrupted run; `take` gets every batch that is whole, ids with their
    /// records, and says whether the run asks for them. A torn last batch is
    /// cut off.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file is another run's, damaged, in use or unreadable.
    pub fn resume(
        path: &Path,
        identity: &Identity,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<RecordFile, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let mut file = lock(OpenOptions::new().read(true).write(true).open(path).map_err(io)?, path)?;
        let (done, end) = Reader::open(&file, path, identity)?.batches(take)?;
        file.set_len(end).and_then(|()| file.seek(SeekFrom::End(0))).map_err(io)?;
        Ok(RecordFile { file, path: path.to_owned(), count: done })
    }

    /// Reads a file and leaves it alone; `take` is as for [`RecordFile::resume`]. Returns how many
    /// records were read.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file is another run's, damaged or unreadable.
    pub fn read(
        path: &Path,
        identity: &Identity,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<usize, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let file = File::open(path).map_err(io)?;
        Ok(Reader::open(&file, path, identity)?.batches(take)?.0)
    }

    /// Records that the file holds.
    pub fn count(&self) -> usize {
        self.count
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

struct Reader<'a> {
    input: BufReader<&'a File>,
    path: &'a Path,
    at: u64,
    length: u64,
}

impl<'a> Reader<'a> {
    /// At the first batch of a file, which must be the run's that `identity` names.
    fn open(file: &'a File, path: &'a Path, identity: &Identity) -> Result<Reader<'a>, RecordFileError> {
        let length =
            file.metadata().map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })?.len();
        let mut reader = Reader { input: BufReader::new(file), path, at: 0, length };
        let differences = reader.identity()?.differences(identity);
        if !differences.is_empty() {
            return Err(RecordFileError::OtherRun { path: path.to_owned(), differences });
        }
        Ok(reader)
    }

    fn take(&mut self, buffer: &mut [u8]) -> Result<(), RecordFileError> {
        let path = self.path;
        self.input
            .read_exact(buffer)
            .map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })?;
        self.at += buffer.len() as u64;
        Ok(())
    }

    fn left(&self) -> u64 {
        self.length - self.at
    }

    fn damaged(&self, at: u64, what: &'static str) -> RecordFileError {
        RecordFileError::Damaged { path: self.path.to_owned(), at, what }
    }

    fn identity(&mut self) -> Result<Identity, RecordFileError> {
        let mut head = [0; 16];
        if self.left() < 16 {
            return Err(self.damaged(0, "its header is incomplete"));
        }
        self.take(&mut head)?;
        if head[..8] != MAGIC {
            return Err(self.damaged(0, "it is no record file of this version"));
        }
        let length = u32_at(&head, 8);
        if self.left() < u64::from(length) {
            return Err(self.damaged(16, "its header is incomplete"));
        }
        let mut identity = vec![0; length as usize];
        self.take(&mut identity)?;
        if crc32fast::hash(&identity) != u32_at(&head, 12) {
            return Err(self.damaged(16, "its header does not match the checksum"));
        }
        serde_json::from_slice(&identity).map_err(|_| self.damaged(16, "its header cannot be read"))
    }

    /// Reads batches up to the end or a torn last one; returns the number of records and the
    /// length of what is whole.
    fn batches(
        &mut self,
        mut take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<(usize, u64), RecordFileError> {
        let mut done = 0;
        let mut body = Vec::new();
        while self.left() >= BATCH_HEAD as u64 {
            let start = self.at;
            let mut head = [0; BATCH_HEAD];
            self.take(&mut head)?;
            let cells = u32_at(&head, 8);
            let bytes = u64::from(cells) * (ID + RECORD) as u64;
            if bytes > self.left() {
                // A batch this long may be torn, or its length may be wrong.
                let plausible = cells <= MOST_CELLS && head[..8] == (done as u64).to_le_bytes();
                return if plausible {
                    Ok((done, start))
                } else {
                    Err(self.damaged(start, "a batch that cannot be"))
                };
            }
            body.resize(bytes as usize, 0);
            self.take(&mut body)?;
            if checksum(&head[..8], &head[8..12], &body) != u32_at(&head, 12) {
                // A batch is torn only if nothing follows it.
                let torn = self.left() == 0;
                return if torn {
                    Ok((done, start))
                } else {
                    Err(self.damaged(start, "a batch does not match its checksum"))
                };
            }
            let (ids, records) = body.split_at(cells as usize * ID);
            let ids = ids.chunks_exact(ID).map(|id| u32_at(id, 0));
            let batch: Vec<(u32, Record)> =
                ids.zip(bytemuck::pod_collect_to_vec::<u8, Record>(records)).collect();
            if head[..8] != (done as u64).to_le_bytes() || !take(&batch) {
                return Err(self.damaged(start, "a batch is out of place"));
            }
            done += cells as usize;
        }
        Ok((done, self.at))
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
