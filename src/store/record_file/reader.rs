//! Reading `records.bin`, past what is no good.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use crate::record::{Record, valid};
use crate::store::record_file::batch::{self, HEAD, Head};
use crate::store::record_file::columns::NAMES;
use crate::store::record_file::header::{self, Found};
use crate::store::record_file::{Identity, RecordFileError};

/// Bytes of damage that are searched for the next batch at a time.
const WINDOW: usize = 1 << 16;

/// In which order records may be taken up again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// In any: one that is lost costs itself alone.
    Any,
    /// As they were kept: what follows depends on what was before.
    AsKept,
}

/// What is no good in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Offset of the first byte that is lost.
    pub at: u64,
    /// Bytes that are, all together.
    pub bytes: u64,
    /// In how many places.
    pub places: usize,
    /// What is wrong in the first.
    pub what: &'static str,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Damage { at, bytes, places, what } = self;
        match places {
            0 => write!(f, "{what}"),
            1 => write!(f, "{bytes} bytes from byte {at} on are no good ({what})"),
            _ => write!(f, "{bytes} bytes in {places} places, from byte {at} on, are no good ({what})"),
        }
    }
}

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// Good records.
    pub count: usize,
    /// What is no good, if anything is.
    pub damage: Option<Damage>,
    /// Where good batches are; those side by side are one.
    pub(crate) good: Vec<Range<u64>>,
    /// The number of the next batch.
    pub(crate) next_number: u32,
}

impl Extent {
    fn lose(&mut self, lost: Range<u64>, what: &'static str) {
        let first = Damage { at: lost.start, bytes: 0, places: 0, what };
        let damage = self.damage.get_or_insert(first.clone());
        if damage.places == 0 {
            *damage = first;
        }
        damage.bytes += lost.end - lost.start;
        damage.places += 1;
    }

    fn keep(&mut self, good: Range<u64>) {
        match self.good.last_mut() {
            Some(last) if last.end == good.start => last.end = good.end,
            _ => self.good.push(good),
        }
    }
}

/// A record file whose header has been read.
pub(crate) struct Reader<'a> {
    file: &'a File,
    path: &'a Path,
    length: u64,
    /// Whose records follow.
    pub(crate) identity: Identity,
    /// How many columns its batches may have.
    columns: usize,
    /// Where batches begin.
    pub(crate) begin: u64,
    /// Whether both copies of the header are good.
    pub(crate) is_whole: bool,
}

impl<'a> Reader<'a> {
    /// Reads a file's header; none where nothing was kept yet.
    pub(crate) fn open(file: &'a File, path: &'a Path) -> Result<Option<Reader<'a>>, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: path.to_owned(), reason };
        let length = file.metadata().map_err(io)?.len();
        let mut first = Vec::new();
        read_at(file, 0).map_err(io)?.take(header::SEARCHED as u64).read_to_end(&mut first).map_err(io)?;
        match header::find(&first, length == first.len() as u64) {
            Found::Header { identity, columns, end: begin, is_whole } => {
                Ok(Some(Reader { file, path, length, identity, columns, begin, is_whole }))
            }
            Found::Nothing => Ok(None),
            Found::OldFormat => Err(RecordFileError::OldFormat { path: path.to_owned() }),
            Found::OtherFields => Err(RecordFileError::OtherFields { path: path.to_owned() }),
            Found::Damaged(what) => Err(RecordFileError::Damaged { path: path.to_owned(), at: 0, what }),
        }
    }

    /// At the first batch of a file, which must be the run's that `identity` names.
    pub(crate) fn of(
        file: &'a File,
        path: &'a Path,
        identity: &Identity,
    ) -> Result<Option<Reader<'a>>, RecordFileError> {
        let Some(reader) = Reader::open(file, path)? else { return Ok(None) };
        let differences = match reader.has_all_columns() {
            true => reader.identity.differences(identity),
            // What an older layout has it says as this one does.
            false => reader.identity.differences(&identity.clone().laid_out_as(&reader.identity)),
        };
        match differences.is_empty() {
            true => Ok(Some(reader)),
            false => Err(RecordFileError::OtherRun { path: path.to_owned(), differences }),
        }
    }

    /// Whether batches of this version may follow its own.
    pub(crate) fn has_all_columns(&self) -> bool {
        self.columns == NAMES.len()
    }

    /// Reads every good batch; `take` is as for [`RecordFile::resume`](super::RecordFile::resume).
    pub(crate) fn batches(
        &self,
        order: Order,
        mut take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Extent, RecordFileError> {
        let io = |reason| RecordFileError::Io { path: self.path.to_owned(), reason };
        let foreign = |at, what| RecordFileError::Damaged { path: self.path.to_owned(), at, what };
        let mut extent = Extent::default();
        if !self.is_whole {
            extent.damage = Some(Damage {
                at: 0,
                bytes: 0,
                places: 0,
                what: "one of the two copies of its header is damaged",
            });
        }
        let mut at = self.begin;
        while at < self.length {
            match self.batch_at(at, extent.next_number).map_err(io)? {
                Err(what) => {
                    let next = match order {
                        Order::Any => self.next_after(at).map_err(io)?,
                        Order::AsKept => self.length,
                    };
                    extent.lose(at..next, what);
                    at = next;
                }
                Ok((head, batch)) => {
                    // What follows is no damage: these are of another order of work, and nothing may be cut off.
                    if batch.iter().any(|(_, record)| record.valid & valid::FILLED != 0) {
                        return Err(foreign(
                            at,
                            "a record that was filled, where only integrated ones are kept",
                        ));
                    }
                    if !take(&batch) {
                        return Err(foreign(at, "a batch of cells that nobody asked for"));
                    }
                    let end = at + (HEAD as u64) + u64::from(head.bytes);
                    extent.count += batch.len();
                    extent.next_number = head.number.saturating_add(1);
                    extent.keep(at..end);
                    at = end;
                }
            }
        }
        Ok(extent)
    }

    /// The batch that begins there, with a number of at least `least`, or what is wrong with it.
    #[expect(clippy::type_complexity, reason = "read once")]
    fn batch_at(&self, at: u64, least: u32) -> io::Result<Result<(Head, Vec<(u32, Record)>), &'static str>> {
        const CUT: &str = "a batch is cut short";
        let mut head = [0; HEAD];
        let left = self.length - at;
        if left < HEAD as u64 {
            return Ok(Err(CUT));
        }
        let mut input = read_at(self.file, at)?;
        input.read_exact(&mut head)?;
        let Some(head) = Head::read(&head) else { return Ok(Err("the head of a batch is damaged")) };
        if left - (HEAD as u64) < u64::from(head.bytes) {
            return Ok(Err(CUT));
        }
        let mut body = vec![0; head.bytes as usize];
        input.read_exact(&mut body)?;
        if head.number < least {
            return Ok(Err("a batch is out of place"));
        }
        Ok(head
            .decode(self.columns, &body)
            .map(|batch| (head, batch))
            .ok_or("a batch does not match its checksum"))
    }

    /// Where the next good head of a batch behind `at` is, or the end.
    fn next_after(&self, at: u64) -> io::Result<u64> {
        let mut from = at + 1;
        let mut window = vec![0; WINDOW + HEAD];
        while from + (HEAD as u64) <= self.length {
            let here = window.len().min((self.length - from) as usize);
            read_at(self.file, from)?.read_exact(&mut window[..here])?;
            let mut searched = 0;
            while let Some(place) = batch::find(&window[searched..here]) {
                searched += place;
                let head = window[searched..here].first_chunk::<HEAD>();
                if head.is_some_and(|head| Head::read(head).is_some()) {
                    return Ok(from + searched as u64);
                }
                searched += 1;
            }
            // A head that begins within the last bytes is seen again.
            from += (here - (HEAD - 1)) as u64;
        }
        Ok(self.length)
    }
}

fn read_at(mut file: &File, at: u64) -> io::Result<&File> {
    file.seek(SeekFrom::Start(at))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::Write;

    use super::*;
    use crate::store::record_file::RecordFile;
    use flate2::Compression;
    use flate2::write::DeflateEncoder;

    /// As versions wrote them whose records had no patterns: rows of 164 bytes, the last 32 reserved.
    #[test]
    fn a_file_from_before_patterns_is_read_and_not_written() {
        let own = Identity::new("cpu", "f64", "d", Vec::new());
        let mut old = serde_json::to_value(&own).unwrap();
        old["record_version"] = 1.into();
        let old: Identity = serde_json::from_value(old).unwrap();
        // Ids 3 and 4, periods 2 and 1: id, period and valid, the most significant bytes first, a plane each.
        let plane = |low: [u8; 2]| [vec![0; 3 * 2], low.to_vec()].concat();
        let valid = valid::PERIOD as u8;
        let planes = [plane([3, 1]), plane([2, 1]), plane([valid; 2]), vec![0; 32 * 2]].concat();
        let mut columns = DeflateEncoder::new(Vec::new(), Compression::fast());
        columns.write_all(&planes).unwrap();
        let batch = batch::framed(0, 2, 1 | 1 << 9 | 1 << 13, &columns.finish().unwrap());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.bin");
        let bytes = [header::bytes_of(&old, &NAMES[..14]).unwrap(), batch].concat();
        fs::write(&path, &bytes).unwrap();
        let mut all = Vec::new();
        let take = |batch: &[(u32, Record)]| {
            all.extend_from_slice(batch);
            true
        };
        let extent = RecordFile::read(&path, &own, Order::Any, take).unwrap();
        let record = |period| Record { period, valid: valid::PERIOD, ..Record::default() };
        assert_eq!((all, extent.damage), (vec![(3, record(2)), (4, record(1))], None));
        let resumed = RecordFile::resume(&path, &own, Order::Any, |_| true);
        assert!(matches!(resumed, Err(RecordFileError::OtherFields { .. })), "{resumed:?}");
        assert_eq!(fs::read(&path).unwrap(), bytes);
    }
}
