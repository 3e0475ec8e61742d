//! A batch of records in the file: a head that a reader can find again behind damage, and compressed columns.

use crate::record::Record;
use crate::store::record_file::columns;

/// First bytes of every batch.
const MARK: [u8; 8] = *b"\x93RTLBAT\n";
/// Number of bytes before the columns.
pub(crate) const HEAD: usize = 32;
/// Largest number of cells in a batch. It bounds the loss by one damaged byte and the memory of a reader.
pub(crate) const MOST_CELLS: usize = 1 << 16;

/// Largest number of bytes of a batch's columns. Where compression fails, it adds less than a thousandth.
const MOST_BYTES: usize = (columns::ROW + 1) * MOST_CELLS;

/// Head of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BatchHead {
    /// Number of the batch; it increases along the file.
    pub(crate) number: u32,
    cells: u32,
    /// A bit for each column that follows.
    columns: u32,
    /// Number of bytes that follow.
    pub(crate) bytes: u32,
    /// Checksum of these bytes.
    sum: u32,
}

/// Returns the bytes of a batch. `strobes` is the number of entries of strobe states.
pub(crate) fn encode(number: u32, batch: &[(u32, Record)], strobes: usize) -> std::io::Result<Vec<u8>> {
    let (columns, body) = columns::encode(batch, strobes)?;
    let (cells, bytes) = (batch.len() as u32, body.len() as u32);
    let head = BatchHead { number, cells, columns, bytes, sum: crc32fast::hash(&body) };
    Ok([&head.bytes()[..], &body].concat())
}

impl BatchHead {
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

    /// Returns the head that these bytes encode, or none if they are damaged.
    pub(crate) fn read(bytes: &[u8; HEAD]) -> Option<BatchHead> {
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let head =
            BatchHead { number: word(8), cells: word(12), columns: word(16), bytes: word(20), sum: word(24) };
        let is_possible = head.cells as usize <= MOST_CELLS && head.bytes as usize <= MOST_BYTES;
        (head.bytes() == *bytes && is_possible).then_some(head)
    }

    /// Returns the records that these bytes encode, or none if they are damaged.
    pub(crate) fn decode(&self, strobes: usize, body: &[u8]) -> Option<Vec<(u32, Record)>> {
        let is_good = crc32fast::hash(body) == self.sum;
        is_good.then(|| columns::decode(self.columns, self.cells as usize, strobes, body)).flatten()
    }
}

/// Returns the place of the first mark of a batch in these bytes.
pub(crate) fn find(bytes: &[u8]) -> Option<usize> {
    bytes.windows(MARK.len()).position(|place| place == MARK)
}
