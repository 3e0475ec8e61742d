//! Reading `records.bin`, as far as it is good.

use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::{BATCH_HEAD, ID, Identity, MAGIC, RECORD, RecordFileError, checksum};
use crate::record::Record;

/// Where a file stops being good, and how much of it comes after.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Offset of the first byte that is lost.
    pub at: u64,
    /// Bytes from there to the end.
    pub bytes: u64,
    /// What is wrong.
    pub what: &'static str,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes from byte {} on are no good ({})", self.bytes, self.at, self.what)
    }
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Good records.
    pub count: usize,
    /// Bytes of them and the header.
    pub(super) end: u64,
    /// What comes after them, if anything does.
    pub damage: Option<Damage>,
}

/// A batch, or why there is none.
enum Next {
    Batch(Vec<(u32, Record)>),
    Damaged(&'static str),
    End,
}

/// A record file, read from the front.
pub(super) struct Reader<'a> {
    input: BufReader<&'a File>,
    path: &'a Path,
    at: u64,
    length: u64,
}

impl<'a> Reader<'a> {
    /// At the beginning of a file.
    pub(super) fn new(file: &'a File, path: &'a Path) -> Result<Reader<'a>, RecordFileError> {
        let length =
            file.metadata().map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })?.len();
        Ok(Reader { input: BufReader::new(file), path, at: 0, length })
    }

    /// At the first batch of a file, which must be the run's that `identity` names.
    pub(super) fn open(
        file: &'a File,
        path: &'a Path,
        identity: &Identity,
    ) -> Result<Reader<'a>, RecordFileError> {
        let mut reader = Reader::new(file, path)?;
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

    /// Whose records follow.
    pub(super) fn identity(&mut self) -> Result<Identity, RecordFileError> {
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

    /// Reads batches up to the first damage; `take` is as for [`RecordFile::resume`](super::RecordFile::resume).
    pub(super) fn batches(
        &mut self,
        mut take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Extent, RecordFileError> {
        let mut count = 0;
        loop {
            let at = self.at;
            match self.next(count)? {
                Next::End => return Ok(Extent { count, end: at, damage: None }),
                Next::Damaged(what) => {
                    let damage = Some(Damage { at, bytes: self.length - at, what });
                    return Ok(Extent { count, end: at, damage });
                }
                Next::Batch(batch) if take(&batch) => count += batch.len(),
                // No damage: these are cells of another order of work, and nothing may be cut off.
                Next::Batch(_) => return Err(self.damaged(at, "a batch of cells that nobody asked for")),
            }
        }
    }

    /// The next batch, before which there must be `done` records.
    fn next(&mut self, done: usize) -> Result<Next, RecordFileError> {
        if self.left() == 0 {
            return Ok(Next::End);
        }
        let mut head = [0; BATCH_HEAD];
        if self.left() < BATCH_HEAD as u64 {
            return Ok(Next::Damaged("a batch is cut short"));
        }
        self.take(&mut head)?;
        let cells = u32_at(&head, 8);
        let bytes = u64::from(cells) * (ID + RECORD) as u64;
        if bytes > self.left() {
            // Or its length is wrong: there is no telling.
            return Ok(Next::Damaged("a batch is cut short"));
        }
        let mut body = vec![0; bytes as usize];
        self.take(&mut body)?;
        if checksum(&head[..8], &head[8..12], &body) != u32_at(&head, 12) {
            return Ok(Next::Damaged("a batch does not match its checksum"));
        }
        if head[..8] != (done as u64).to_le_bytes() {
            return Ok(Next::Damaged("a batch is out of place"));
        }
        let (ids, records) = body.split_at(cells as usize * ID);
        let ids = ids.chunks_exact(ID).map(|id| u32_at(id, 0));
        Ok(Next::Batch(ids.zip(bytemuck::pod_collect_to_vec::<u8, Record>(records)).collect()))
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
