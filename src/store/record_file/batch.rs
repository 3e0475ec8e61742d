//! A batch of records in the file: a head that can be found again behind damage, and columns.

use crate::record::Record;
use crate::store::record_file::columns;

/// What every batch begins with.
const MARK: [u8; 8] = *b"\x93RTLBAT\n";
/// Bytes before the columns.
pub(crate) const HEAD: usize = 32;
/// Most cells of a batch: what one damaged byte costs, and what a reader must have room for.
pub(crate) const MOST_CELLS: usize = 1 << 16;

/// What the head of a batch tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Head {
    /// Raised from batch to batch.
    pub(crate) number: u32,
    cells: u32,
    /// Which columns follow, a bit for each.
    columns: u32,
    /// Bytes that follow.
    pub(crate) bytes: u32,
    /// Checksum of these.
    sum: u32,
}

/// A batch as it is written.
pub(crate) fn encode(number: u32, batch: &[(u32, Record)]) -> std::io::Result<Vec<u8>> {
    let (columns, body) = columns::encode(batch)?;
    Ok(framed(number, batch.len(), columns, &body))
}

/// These columns of so many cells behind their head.
pub(crate) fn framed(number: u32, cells: usize, columns: u32, body: &[u8]) -> Vec<u8> {
    let (cells, bytes) = (cells as u32, body.len() as u32);
    let head = Head { number, cells, columns, bytes, sum: crc32fast::hash(body) };
    [&head.bytes()[..], body].concat()
}

impl Head {
    fn bytes(&self) -> [u8; HEAD] {
        let mut bytes = [0; HEAD];
        bytes[..8].copy_from_slice(&MARK);
        let words = [self.number, self.cells, self.columns, self.bytes, self.sum];
        for (place, word) in bytes[8..HEAD - 4].chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        let sum = crc32fast::hash(&bytes[..HEAD - 4]);
        bytes[HEAD - 4..].copy_from_slice(&sum.to_le_bytes());
        bytes
    }

    /// The head that these bytes are, if they are a good one.
    pub(crate) fn read(bytes: &[u8; HEAD]) -> Option<Head> {
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let head =
            Head { number: word(8), cells: word(12), columns: word(16), bytes: word(20), sum: word(24) };
        (head.bytes() == *bytes && head.cells as usize <= MOST_CELLS).then_some(head)
    }

    /// The batch whose columns these are, in a file of so many; none if they are not.
    pub(crate) fn decode(&self, columns: usize, body: &[u8]) -> Option<Vec<(u32, Record)>> {
        let is_good = crc32fast::hash(body) == self.sum;
        is_good.then(|| columns::decode(columns, self.columns, self.cells as usize, body)).flatten()
    }
}

/// Where the first batch begins in these bytes, by its mark alone.
pub(crate) fn find(bytes: &[u8]) -> Option<usize> {
    bytes.windows(MARK.len()).position(|place| place == MARK)
}
