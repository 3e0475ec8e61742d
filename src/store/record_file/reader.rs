//! Reads `records.bin` and skips damaged batches.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use crate::record::{Record, valid};
use crate::store::plain_file;
use crate::store::record_file::batch::{self, BatchHead, HEAD};
use crate::store::record_file::error::RecordFileError;
use crate::store::record_file::header::{self, Found};
use crate::store::record_file::identity::Identity;

/// Numbers of bytes that are searched at a time for the next batch behind damage: at first, and at most.
const WINDOW: Range<usize> = 1 << 10..1 << 16;

/// Whether records that follow a damaged batch can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// They can: no record depends on another.
    Any,
    /// They cannot: a record may depend on all records before it.
    Sequential,
}

/// Damage in a record file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Offset of the first damaged byte.
    pub at: u64,
    /// Number of damaged bytes in the whole file.
    pub bytes: u64,
    /// Number of damaged places.
    pub places: usize,
    /// Description of the first.
    pub what: &'static str,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Damage { at, bytes, places, what } = self;
        match places {
            1 => write!(f, "{bytes} bytes from byte {at} on are damaged ({what})"),
            _ => write!(f, "{bytes} bytes in {places} places, from byte {at} on, are damaged ({what})"),
        }
    }
}

/// Contents of a record file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// Number of undamaged records.
    pub count: usize,
    /// Damage, if there is any.
    pub damage: Option<Damage>,
    /// Byte ranges of undamaged batches; adjacent batches share a range.
    pub(crate) good: Vec<Range<u64>>,
    /// Number of the next batch.
    pub(crate) next_number: u32,
}

impl Extent {
    fn add_damage(&mut self, range: Range<u64>, what: &'static str) {
        let damage = self.damage.get_or_insert(Damage { at: range.start, bytes: 0, places: 0, what });
        damage.bytes += range.end - range.start;
        damage.places += 1;
    }

    fn add_good(&mut self, range: Range<u64>) {
        match self.good.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => self.good.push(range),
        }
    }
}

/// A batch with its head: numbers of runs and their records.
type Batch = (BatchHead, Vec<(u32, Record)>);

/// Damage of a batch.
struct Bad {
    what: &'static str,
    /// Number of bytes that were read behind its head.
    body: u64,
}

impl Identity {
    /// Reads the identity of the run from a record file; none if the run ended before it wrote anything.
    ///
    /// # Errors
    /// [`RecordFileError`] if the file or its header cannot be read.
    pub fn read(path: &Path) -> Result<Option<Identity>, RecordFileError> {
        let file = open(path)?;
        Ok(Reader::open(&file, path)?.map(|reader| reader.identity))
    }
}

/// Opens a file for reading.
pub(crate) fn open(path: &Path) -> Result<File, RecordFileError> {
    plain_file::open(path, OpenOptions::new().read(true))
        .map_err(|reason| RecordFileError::Io { path: path.to_owned(), reason })
}

/// A record file whose header has been read.
pub(crate) struct Reader<'a> {
    file: &'a File,
    path: &'a Path,
    length: u64,
    identity: Identity,
    /// Offset of the first batch.
    pub(crate) begin: u64,
}

impl<'a> Reader<'a> {
    /// Reads the header; none if the run ended before it wrote anything.
    fn open(file: &'a File, path: &'a Path) -> Result<Option<Reader<'a>>, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let length = file.metadata().map_err(io)?.len();
        let mut first = Vec::new();
        read_at(file, 0).map_err(io)?.take(header::MOST_BYTES as u64).read_to_end(&mut first).map_err(io)?;
        match header::find(&first, length == first.len() as u64) {
            Found::Header { identity, end: begin } => {
                Ok(Some(Reader { file, path, length, identity, begin }))
            }
            Found::Nothing => Ok(None),
            Found::OtherVersion => Err(RecordFileError::OtherVersion { path: path.to_owned() }),
            Found::Damaged(what) => Err(RecordFileError::Damaged { path: path.to_owned(), at: 0, what }),
        }
    }

    /// Reads the header of a file that must belong to the run of this identity.
    pub(crate) fn of(
        file: &'a File,
        path: &'a Path,
        identity: &Identity,
    ) -> Result<Option<Reader<'a>>, RecordFileError> {
        let Some(reader) = Reader::open(file, path)? else { return Ok(None) };
        let differences = reader.identity.differences(identity);
        match differences.is_empty() {
            true => Ok(Some(reader)),
            false => Err(RecordFileError::OtherRun { path: path.to_owned(), differences }),
        }
    }

    /// Reads every undamaged batch; `take` is described at [`RecordFile::resume`](super::RecordFile::resume).
    pub(crate) fn batches(
        &self,
        order: Order,
        mut take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Extent, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: self.path.to_owned(), reason };
        let damaged = |at, what| RecordFileError::Damaged { path: self.path.to_owned(), at, what };
        let mut extent = Extent::default();
        let (mut at, mut wasted) = (self.begin, 0);
        while at < self.length {
            match self.batch_at(at, extent.next_number).map_err(io)? {
                Err(Bad { what, body }) => {
                    wasted += body;
                    let next = match order {
                        // Heads inside the body of a damaged batch would let the reader read the same bytes again and again.
                        Order::Any if wasted > self.length => self.next_after(at + body).map_err(io)?,
                        Order::Any => self.next_after(at).map_err(io)?,
                        Order::Sequential => self.length,
                    };
                    extent.add_damage(at..next, what);
                    at = next;
                }
                Ok((head, batch)) => {
                    // The checksum of such a batch is right, so it is refused and not cut off as damaged.
                    if batch.iter().any(|(_, record)| record.valid & valid::FILLED != 0) {
                        return Err(damaged(
                            at,
                            "it has a filled record, and only integrated records are stored",
                        ));
                    }
                    if !take(&batch) {
                        return Err(damaged(at, "it has records of cells that the run does not ask for"));
                    }
                    let end = at + (HEAD as u64) + u64::from(head.bytes);
                    extent.count += batch.len();
                    extent.next_number = head.number.saturating_add(1);
                    extent.add_good(at..end);
                    at = end;
                }
            }
        }
        Ok(extent)
    }

    /// Reads the batch at an offset; its number must be at least `least`. The inner error describes the damage.
    fn batch_at(&self, at: u64, least: u32) -> io::Result<Result<Batch, Bad>> {
        let bad = |what| Ok(Err(Bad { what, body: 0 }));
        const CUT: &str = "a batch is cut short";
        let mut head = [0; HEAD];
        let left = self.length - at;
        if left < HEAD as u64 {
            return bad(CUT);
        }
        let mut input = read_at(self.file, at)?;
        input.read_exact(&mut head)?;
        let Some(head) = BatchHead::read(&head) else { return bad("the head of a batch is damaged") };
        if left - (HEAD as u64) < u64::from(head.bytes) {
            return bad(CUT);
        }
        if head.number < least {
            return bad("a batch is out of place");
        }
        let mut body = vec![0; head.bytes as usize];
        input.read_exact(&mut body)?;
        let batch = head.decode(self.identity.strobes(), &body).map(|batch| (head, batch));
        Ok(batch.ok_or(Bad { what: "a batch does not match its checksum", body: body.len() as u64 }))
    }

    /// Returns the offset of the next undamaged head of a batch behind `at`, or the length of the file.
    fn next_after(&self, at: u64) -> io::Result<u64> {
        let mut from = at + 1;
        let mut window = vec![0; WINDOW.start];
        while from + (HEAD as u64) <= self.length {
            let here = (window.len() as u64).min(self.length - from) as usize;
            read_at(self.file, from)?.read_exact(&mut window[..here])?;
            let mut searched = 0;
            while let Some(place) = batch::find(&window[searched..here]) {
                searched += place;
                let head = window[searched..here].first_chunk::<HEAD>();
                if head.is_some_and(|head| BatchHead::read(head).is_some()) {
                    return Ok(from + searched as u64);
                }
                searched += 1;
            }
            // The windows overlap, so that a head across their border is found.
            from += (here - (HEAD - 1)) as u64;
            window.resize(WINDOW.end.min(2 * window.len()), 0);
        }
        Ok(self.length)
    }
}

fn read_at(mut file: &File, at: u64) -> io::Result<&File> {
    file.seek(SeekFrom::Start(at))?;
    Ok(file)
}
