//! `records.bin`: the records of a run. An interrupted run resumes from this file.
//!
//! The file has a header that identifies the run, and batches of records, appended as cells end. All numbers are
//! little-endian:
//!
//! ```text
//! header: magic "RTLMAP3\0"   length u32   crc32 u32 (over all else)   format, columns, identity (JSON)
//! batch:  mark "\x93RTLBAT\n"   number u32   cells u32   columns u32 (a bit each)   bytes u32
//!         crc32 u32 (of what follows the head)   crc32 u32 (of the head)   columns, compressed
//! ```
//!
//! The header is written to a file of another name that is then renamed, so that it is never incomplete. A run that is
//! killed during a write leaves an incomplete last batch. Damaged batches are dropped and their cells computed again; so
//! are all batches behind the damage if cells depend on those before them.

mod batch;
mod columns;
mod error;
mod header;
mod identity;
mod reader;

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

pub use crate::store::file_names::RECORDS;
pub use error::RecordFileError;
pub use identity::Identity;
pub use reader::{Damage, Extent, Order};

use crate::record::Record;
use crate::store::plain_file::{self, partial, refuse_link};
use reader::Reader;

const _: () = assert!(cfg!(target_endian = "little"), "records are written as they lie in memory");

/// A record file that is being written. The writer holds the lock of its [`Folder`](super::folder::Folder).
#[derive(Debug)]
pub struct RecordFile {
    file: File,
    path: PathBuf,
    count: usize,
    next_number: u32,
    damage: Option<Damage>,
    /// Number of entries of strobe states.
    strobes: usize,
}

impl RecordFile {
    /// Creates a file without records and replaces an existing one.
    ///
    /// # Errors
    /// [`RecordFileError::Io`] if it cannot be written.
    pub fn create(path: &Path, identity: &Identity) -> Result<RecordFile, RecordFileError> {
        let file = begin(path, identity, None).map_err(|reason| io_error(path, reason))?;
        let strobes = identity.strobes();
        Ok(RecordFile { file, path: path.to_owned(), count: 0, next_number: 0, damage: None, strobes })
    }

    /// Creates a file under a temporary name. [`RecordFile::put_in_place`] gives it its name; until then an existing
    /// file is unchanged.
    ///
    /// # Errors
    /// [`RecordFileError::Io`] if it cannot be written.
    pub fn create_aside(path: &Path, identity: &Identity) -> Result<RecordFile, RecordFileError> {
        RecordFile::create(&partial(path), identity)
    }

    /// Removes a file that was created under a temporary name.
    pub fn discard(self) {
        let RecordFile { file, path, .. } = self;
        drop(file);
        // An error here is ignored: the caller reports the one that made it discard the file.
        let _ = fs::remove_file(path);
    }

    /// Gives a file that was created under a temporary name its name, once all of it is on the disk.
    ///
    /// # Errors
    /// [`RecordFileError::Io`] if it cannot be renamed.
    pub fn put_in_place(self, path: &Path) -> Result<(), RecordFileError> {
        let RecordFile { file, path: aside, .. } = self;
        let placed = refuse_link(path).and_then(|()| {
            file.sync_all()?;
            // Windows renames no open file.
            drop(file);
            plain_file::rename(&aside, path)
        });
        placed.map_err(|reason| io_error(path, reason))
    }

    /// Opens the file of an interrupted run and removes its damaged batches. A file without a batch is created anew.
    ///
    /// `take` receives the records of each undamaged batch with their ids, and returns whether the run asks for them.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file belongs to another run, its header is damaged, `take` returns false, or the file
    /// cannot be read or written.
    pub fn resume(
        path: &Path,
        identity: &Identity,
        order: Order,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<RecordFile, RecordFileError> {
        let io = |reason| io_error(path, reason);
        refuse_link(path).map_err(io)?;
        let file = plain_file::open(path, OpenOptions::new().read(true).write(true)).map_err(io)?;
        let Some(reader) = Reader::of(&file, path, identity)? else {
            return RecordFile::create(path, identity);
        };
        let Extent { count, damage, good, next_number } = reader.batches(order, take)?;
        let mended = match &good[..] {
            [] => file.set_len(reader.begin).map(|()| file),
            [one] if one.start == reader.begin => file.set_len(one.end).map(|()| file),
            _ => begin(path, identity, Some((file, &good))),
        };
        let mut file = mended.map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        let strobes = identity.strobes();
        Ok(RecordFile { file, path: path.to_owned(), count, next_number, damage, strobes })
    }

    /// Reads a file without changing it; `take` is described at [`RecordFile::resume`].
    ///
    /// # Errors
    /// As [`RecordFile::resume`].
    pub fn read(
        path: &Path,
        identity: &Identity,
        order: Order,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Extent, RecordFileError> {
        let file = reader::open(path)?;
        Reader::of(&file, path, identity)?.map_or(Ok(Extent::default()), |reader| reader.batches(order, take))
    }

    /// Number of records in the file.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Damage that was found when the file was opened.
    pub fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Appends records with their ids. [`RecordFile::sync`] waits until they are on the disk.
    ///
    /// # Errors
    /// [`RecordFileError::Io`], for instance if the disk is full.
    pub fn append(&mut self, records: &[(u32, Record)]) -> Result<(), RecordFileError> {
        let batches: Vec<&[(u32, Record)]> = records.chunks(batch::MOST_CELLS).collect();
        let numbered = (self.next_number..).zip(&batches).collect::<Vec<_>>().into_par_iter();
        let encoded: io::Result<Vec<Vec<u8>>> =
            numbered.map(|(number, cells)| batch::encode(number, cells, self.strobes)).collect();
        encoded
            .and_then(|encoded| encoded.iter().try_for_each(|batch| self.file.write_all(batch)))
            .map_err(|reason| io_error(&self.path, reason))?;
        self.next_number += batches.len() as u32;
        self.count += records.len();
        Ok(())
    }

    /// Waits until all records are on the disk.
    ///
    /// # Errors
    /// [`RecordFileError::Io`], for instance if the disk is full.
    pub fn sync(&self) -> Result<(), RecordFileError> {
        self.file.sync_data().map_err(|reason| io_error(&self.path, reason))
    }
}

fn io_error(path: &Path, reason: io::Error) -> RecordFileError {
    RecordFileError::Io { path: path.to_owned(), reason }
}

/// Creates a file with a header and, if `from` is given, copies of these byte ranges of another file. The file gets its
/// name when all of it is on the disk.
fn begin(path: &Path, identity: &Identity, from: Option<(File, &[Range<u64>])>) -> io::Result<File> {
    plain_file::replace(path, |file| {
        file.write_all(&header::bytes(identity)?)?;
        // The other file is closed before the renaming: Windows replaces no open file.
        if let Some((mut from, ranges)) = from {
            for range in ranges {
                from.seek(SeekFrom::Start(range.start))?;
                io::copy(&mut (&from).take(range.end - range.start), file)?;
            }
        }
        Ok(())
    })
}
