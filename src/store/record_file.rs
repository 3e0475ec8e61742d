//! `records.bin`: what a killed run leaves and the next one goes on from.
//!
//! A header says whose records these are, twice. Batches follow, appended as cells end. All numbers are little-endian:
//!
//! ```text
//! twice: magic "RTLMAP2\0"   length u32   crc32 u32 (over all else)   format, columns, identity (JSON)
//! then per batch: mark "\x93RTLBAT\n"   number u32   cells u32   columns u32 (a bit each)   bytes u32
//!                 crc32 u32 (of what follows the head)   crc32 u32 (of the head)   columns, compressed
//! ```
//!
//! The header is there whole or not at all: it is written under another name. A run that is killed while it writes leaves
//! a torn last batch. A disk may do worse, anywhere: a damaged batch is lost, and its cells are computed again. So is
//! what follows it where cells depend on those before them.
//!
//! Files from before there were patterns name fewer columns: they are read, and not gone on with.

mod batch;
mod columns;
mod header;
mod identity;
mod reader;

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use thiserror::Error;

pub use identity::Identity;
pub use reader::{Damage, Extent, Order};

use crate::record::Record;
use crate::store::folder::{partial, refuse_link};
use reader::Reader;

/// Its name in a map's folder.
pub const RECORDS: &str = "records.bin";

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
    /// An earlier version wrote it.
    #[error(
        "{} is of format 1, without columns and compression, which this version does not read; make the map anew \
         with --force, or go on with the version that began it",
        .path.display()
    )]
    OldFormat {
        /// The file.
        path: PathBuf,
    },
    /// Another version wrote it.
    #[error(
        "{} is another version's: its records have other fields; make the map anew with --force, or go on with the \
         version that began it",
        .path.display()
    )]
    OtherFields {
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

/// A record file being written. Whoever writes it holds its [`Folder`](super::Folder), so that nobody else does.
#[derive(Debug)]
pub struct RecordFile {
    file: File,
    path: PathBuf,
    count: usize,
    next_number: u32,
    damage: Option<Damage>,
}

impl RecordFile {
    /// Starts a file anew, in the place of one that may be there.
    ///
    /// # Errors
    /// [`RecordFileError::Io`] if it cannot be written.
    pub fn create(path: &Path, identity: &Identity) -> Result<RecordFile, RecordFileError> {
        let begun =
            header::bytes(identity).map_err(io::Error::from).and_then(|header| begin(path, &header, None));
        let file = begun.map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })?;
        Ok(RecordFile { file, path: path.to_owned(), count: 0, next_number: 0, damage: None })
    }

    /// Starts a file that gets its name with [`RecordFile::put_in_place`] alone: one that has it meanwhile stays.
    ///
    /// # Errors
    /// [`RecordFileError::Io`] if it cannot be written.
    pub fn create_aside(path: &Path, identity: &Identity) -> Result<RecordFile, RecordFileError> {
        RecordFile::create(&partial(path), identity)
    }

    /// Removes a file that was started aside.
    pub fn discard(self) {
        let RecordFile { file, path, .. } = self;
        drop(file);
        // Best effort: whoever discards it has an error to tell.
        let _ = fs::remove_file(path);
    }

    /// Gives a file that was started aside its name, all on the disk.
    ///
    /// # Errors
    /// [`RecordFileError::Io`] if it cannot be renamed.
    pub fn put_in_place(self, path: &Path) -> Result<(), RecordFileError> {
        let RecordFile { file, path: aside, .. } = self;
        let placed = refuse_link(path).and_then(|()| {
            file.sync_all()?;
            // Windows renames no file that is open.
            drop(file);
            fs::rename(&aside, path)
        });
        placed.map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })
    }

    /// Opens the file of an interrupted run; `take` gets every batch that is good, ids with their
    /// records, and says whether the run asks for them. What is damaged is taken out of the file. One in
    /// which nothing was kept yet is started anew.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file is another run's, has no readable header or cannot be read or written.
    pub fn resume(
        path: &Path,
        identity: &Identity,
        order: Order,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<RecordFile, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        refuse_link(path).map_err(io)?;
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
        let Some(reader) = Reader::of(&file, path, identity)? else {
            return RecordFile::create(path, identity);
        };
        if !reader.has_all_columns() {
            return Err(RecordFileError::OtherFields { path: path.to_owned() });
        }
        let Extent { count, damage, good, next_number } = reader.batches(order, take)?;
        let (begin_of_batches, is_whole) = (reader.begin, reader.is_whole);
        let mended = match &good[..] {
            [] if is_whole => file.set_len(begin_of_batches).map(|()| file),
            [one] if is_whole && one.start == begin_of_batches => file.set_len(one.end).map(|()| file),
            _ => header::bytes(identity)
                .map_err(io::Error::from)
                .and_then(|header| begin(path, &header, Some((file, &good)))),
        };
        let mut file = mended.map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        Ok(RecordFile { file, path: path.to_owned(), count, next_number, damage })
    }

    /// Reads a file and leaves it alone; `take` is as for [`RecordFile::resume`].
    ///
    /// # Errors
    /// [`RecordFileError`] if the file is another run's, has no readable header or is unreadable.
    pub fn read(
        path: &Path,
        identity: &Identity,
        order: Order,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Extent, RecordFileError> {
        let file = open(path)?;
        Reader::of(&file, path, identity)?.map_or(Ok(Extent::default()), |reader| reader.batches(order, take))
    }

    /// Records that the file holds.
    pub fn count(&self) -> usize {
        self.count
    }

    /// What was no good when the file was opened, if anything was.
    pub fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Appends records with their ids and sees them onto the disk.
    ///
    /// # Errors
    /// [`RecordFileError::Io`], for instance on a full disk.
    pub fn append(&mut self, records: &[(u32, Record)]) -> Result<(), RecordFileError> {
        let batches: Vec<&[(u32, Record)]> = records.chunks(batch::MOST_CELLS).collect();
        let numbered = (self.next_number..).zip(&batches).collect::<Vec<_>>().into_par_iter();
        let encoded: io::Result<Vec<Vec<u8>>> =
            numbered.map(|(number, cells)| batch::encode(number, cells)).collect();
        encoded
            .and_then(|encoded| encoded.iter().try_for_each(|batch| self.file.write_all(batch)))
            .and_then(|()| self.file.sync_data())
            .map_err(|reason| RecordFileError::Io { path: self.path.clone(), reason })?;
        self.next_number += batches.len() as u32;
        self.count += records.len();
        Ok(())
    }
}

fn open(path: &Path) -> Result<File, RecordFileError> {
    File::open(path).map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })
}

/// A file with a header and, of another file, these bytes. It has its name once all is on the disk.
fn begin(path: &Path, header: &[u8], of: Option<(File, &[Range<u64>])>) -> io::Result<File> {
    refuse_link(path)?;
    let partial = partial(path);
    refuse_link(&partial)?;
    match fs::remove_file(&partial) {
        Err(reason) if reason.kind() != io::ErrorKind::NotFound => return Err(reason),
        _ => {}
    }
    let mut file = OpenOptions::new().read(true).write(true).create_new(true).open(&partial)?;
    let write = |file: &mut File| {
        file.write_all(header)?;
        // It is closed then: Windows may put no other in the place of a file that is open.
        if let Some((mut from, ranges)) = of {
            for range in ranges {
                from.seek(SeekFrom::Start(range.start))?;
                io::copy(&mut (&from).take(range.end - range.start), file)?;
            }
        }
        file.sync_all()?;
        fs::rename(&partial, path)?;
        // The name, too; where a system does not let one open a folder it has to do without.
        let _ = path.parent().map(|folder| File::open(folder).and_then(|folder| folder.sync_all()));
        Ok(())
    };
    if let Err(reason) = write(&mut file) {
        // Best effort: the error that matters is the one already at hand.
        let _ = fs::remove_file(&partial);
        return Err(reason);
    }
    Ok(file)
}
